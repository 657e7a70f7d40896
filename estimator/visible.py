"""Text from a file, a device or a socket, fit to be shown.

A terminal obeys what stands between letters: escape sequences, a carriage return, marks that turn
the direction of writing. Shown text has none of them.
"""

from __future__ import annotations

import re

LONGEST_WORD, LONGEST = 120, 400  # characters: of a name or a number, of a line


def visible(text: str) -> str:
    """The text in one line: what cannot be printed stands as an escape, such as `\\x1b`."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else _escape(c) for c in text)


def brief(text: str) -> str:
    """The text in one visible line, long words and a long line without their middle."""
    words = re.split(r"( +)", visible(text))
    return _cut("".join([_cut(word, LONGEST_WORD) for word in words]), LONGEST)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]}…{text[-(most // 2 - 1) :]}"


def _escape(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")


def writable(text: str) -> str:
    """The text as UTF-8 can hold it: bytes of a name or an argument that are none stand as escapes,
    such as `\\udcff`.
    """
    try:
        text.encode()
        return text
    except UnicodeEncodeError:
        return "".join(_escape(c) if "\ud800" <= c <= "\udfff" else c for c in text)
