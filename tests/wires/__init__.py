"""A library of recorded wires: the bytes of real runs of the daemon, good and bad, and what the
drivers and the filter make of them.

`python -m tests.wires.record NAME…` records a session anew; `--outcomes` writes what the present
code makes of the sessions, to be reviewed like code. A fault of the drivers that somebody meets
becomes one more session: `gritd run --tap` keeps its bytes.
"""
