"""Names that become part of a file's name."""

from __future__ import annotations

import re

EXPECTED = "a name of up to 60 characters, without '/', not beginning with '.'"
PATTERN = r"(?:[^./][^/]{0,59})?"


def is_file_name(text: str) -> bool:
    """Whether a file's name may begin with a text: it leads to no other folder."""
    return text.isprintable() and re.fullmatch(PATTERN, text) is not None
