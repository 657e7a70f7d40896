"""The name that a mistyped one was meant to be, and the names there are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

BEGINNING = 4  # letters of a name that are enough to propose it
ALIKE = 0.7  # share of equal letters from which a word is likely to be meant
KEYS_ALIKE = 0.6  # the same among the few keys and words of one place
ROOM = 120  # letters that a line has for all known names together
SHOWN = 40  # letters of one name


def did_you_mean(word: str, known: Iterable[str], alike: float = ALIKE) -> str:
    """' (did you mean NAME?)' with the known name that is most like a word; '' for none."""
    names, begun = list(known), word[:60].lower()
    close = get_close_matches(begun, names, n=1, cutoff=alike)
    if not close and len(begun) >= BEGINNING:
        close = [name for name in names if name.startswith(begun)][:1]
    return f" (did you mean {close[0]}?)" if close else ""


def listed(names: Sequence[str], room: int = ROOM) -> str:
    """Names with commas, as many as a line has room for."""
    length = 0
    for count, name in enumerate(names):
        length += min(len(name), SHOWN) + 2
        if length > room:
            return f"{', '.join(name[:SHOWN] for name in names[:count])} … ({len(names)} in all)"
    return ", ".join(name[:SHOWN] for name in names)
