"""The name that a mistyped one was meant to be."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

ALIKE = 0.7  # share of equal letters from which a word is likely to be meant


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """' (did you mean NAME?)' with the known name that is most like a word; '' for none."""
    close = get_close_matches(word[:60].lower(), list(known), n=1, cutoff=ALIKE)
    return f" (did you mean {close[0]}?)" if close else ""
