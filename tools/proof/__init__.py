"""Blind trials of `gritd diagnose`: an independent plant, sealed answers, and the score."""
