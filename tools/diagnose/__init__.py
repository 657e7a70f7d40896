"""`gritd diagnose`: is there a mismatch, where, which physics was left out, how does the fit improve, what to do next."""
