"""A line to say."""

from __future__ import annotations

from typing import NamedTuple


class Notice(NamedTuple):
    """over: that something has ended."""

    text: str
    over: bool = False
