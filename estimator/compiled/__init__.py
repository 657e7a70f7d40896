"""The arithmetic that a tick spends most of its time in, as C: see arithmetic.py."""
