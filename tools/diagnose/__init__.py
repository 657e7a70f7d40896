"""`gritd diagnose`: is there a mismatch, where, which physics was left out, what to do next."""
