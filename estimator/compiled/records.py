"""The messages of a recording, found and copied by C, where it was built.

Python or numpy with the same result stands next to each function: `chunks` is recording/walk.py one
by one, `walk` is recording/piles.py by the message index, `fill` is recording/tables.py. A test
reads the same files by both. `crc32` is that of zlib.
"""

from __future__ import annotations

from gritd.estimator.compiled.sources import check_sources

try:
    from gritd.estimator.compiled import checksum

    check_sources(checksum)
    from gritd.estimator.compiled.checksum import crc32
except ImportError:  # no compiler, or a processor that zlib knows better
    from zlib import crc32
try:
    from gritd.estimator.compiled import messages

    check_sources(messages)
    from gritd.estimator.compiled.messages import chunks, fill, walk
except ImportError:  # no compiler where gritd was installed
    BUILT = False
else:
    BUILT = True

NOT_FIXED, UNKNOWN = -1, -2  # in the place of a message's size

__all__ = ["BUILT", "NOT_FIXED", "UNKNOWN", "chunks", "crc32", "fill", "walk"]
