"""Wheel-soil mechanics after Shibly, Iagnemma and Dubowsky (2005)."""
