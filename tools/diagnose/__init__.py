"""`gritd diagnose`: is there a mismatch, where is it, which physics was left out, what to do next."""
