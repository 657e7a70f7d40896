"""The faults that gritd must survive, by the names that the scenarios give them, with the numbers
of the list that they were found under.
"""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """rows: numbers in the list of faults; none for one that was added since."""

    rows: tuple[int, ...]
    name: str


# numbers in the list, - for one that was added since | name
LISTED = """
1 | device unplugged and back
2 | serial garbage, bad CRC, truncated frame
3 | encoder rollover
4 | encoder counter jump
5 | stuck sensor
6 | NaN, Inf, out of range
7 | wall-clock step
8 | duplicate, late or reordered stamps
9 | CAN error frame or failing bus
10 | hostile CAN or UDP datagram
11 | bus flood
12 | queue overflow
13 | disk full
14 | log folder read-only
15 | kill -9 while logging
16 | power cut while logging
17 | SIGTERM
18 | SIGHUP with bad YAML
19 | YAML bomb, unsafe tag, duplicate key, 1e3 as text, no as false, NaN
20 | hostile or huge recording
21 | recording with flipped bits
22 | wheel in the air
23 | zero slip
24 | negative slip, reverse driving
25 | stall (100 % slip)
26 | θ₁ → 0, f → 0
27 | filter divergence
28 | CPU starvation
29 | a thread dies
30 | garbage-collector pause
31 | second instance
32 | unprivileged user
34 | one wrong stamp of a device clock
35 | step of a device clock
36 | random histories of a device clock
37 69 | wall clock in 1901, 1970, 2040, 2200, 2603
38 39 | step, ramp or patch of the soil
40 | recording that unpacks to a thousand times its size
41 | last reading a day, fifty years later
42 | sparse file of 9 GB, 4 GB of memory
43 | import of packed text
44 | empty attachments, tiny chunks
45 | hostile checkpoints
46 | 300 and 500 MB of address space
47 | hostile worker behind --scheduler
48 | terminal escapes in names
49 | names that lead out of the folder
50 | symlinked lock, FIFO, killed parent
51 | world-writable configuration, readable recordings
52 | silence, garbage, counter jumps, a stopped process
53 | second daemon on a socket, too many readers
54 | links and folders named like recordings
55 | ten crashes in a minute
56 | chunks swapped or duplicated
57 | file of 8 bytes
58 | metadata and configuration of impossible numbers
59 | every allocation of the hot path fails once
60 | YAML cut at every byte
61 | encoder silent while its counter wraps
61 | random counter of the wheel
61 | sensor frozen but for its last digit
62 | second daemon on a port of the first
63 64 65 | plug-in that ends the program, raises, hangs
66 | chunks in reverse order
67 | names and notes that are no UTF-8
68 | JSON nested 100,000 deep
70 | wire logs of impossible times
71 | DBC with impossible numbers, a pipe, a device
72 | write error in the middle of a part
73 | log folder removed during a run
74 75 | bed file that cannot be, or of another time
76 | recovery of the log
77 | recover of a cut recording
78 | DBC that others may write
79 | a file that is no DBC
80 | table of 100,000 columns
81 | the slowest campaign of diagnose
82 | two readings in one read of the bus
83 | readings stamped on receipt, 16 to 116 ms late
84 | dask: worker killed, hung, of another version; TLS
- | message that cannot be written
- | a filter out of its depth
"""


def _listed(line: str) -> Fault:
    rows, name = line.split(" | ")
    return Fault(tuple(map(int, rows.replace("-", "").split())), name)


FAULTS = tuple(map(_listed, LISTED.strip().splitlines()))
