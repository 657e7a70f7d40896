"""Proofs on other laboratories' recordings: a channel is concealed, `gritd diagnose` speaks, the
channel judges.
"""
