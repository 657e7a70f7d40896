"""How the chunks of a recording are compressed."""

from __future__ import annotations

from collections.abc import Callable

import lz4.frame  # type: ignore[import-untyped]
import zstandard

# Of zstd: it leaves literals as they are. Against its default, 3, a chunk takes half the time to
# pack and two thirds to unpack; the file becomes larger by a twentieth.
LEVEL = -1


def compressor(kind: str) -> Callable[[bytes], bytes]:
    """One for the whole file: a context for every chunk is half a megabyte, allocated and freed
    five times a second.

    kind: zstd, lz4 or none.
    """
    if kind == "zstd":
        return zstandard.ZstdCompressor(LEVEL, write_content_size=True).compress
    return lz4.frame.compress if kind == "lz4" else bytes
