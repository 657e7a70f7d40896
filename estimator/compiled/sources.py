"""Whether a compiled module is of the C beside it."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from zlib import crc32


def check_sources(*modules: ModuleType) -> None:
    """Raises ImportError where one was not built from the C beside it: it is of another version,
    left by an installation that could not compile.
    """
    files = sorted(Path(__file__).parent.glob("*.[ch]"))
    sources = crc32(b"".join(file.read_bytes() for file in files))
    for module in modules:
        if getattr(module, "SOURCES", None) != sources:
            raise ImportError(f"{module.__file__} was built from other sources")
