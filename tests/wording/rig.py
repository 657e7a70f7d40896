"""Commands as a user calls them, in a folder of their own, and what they print as one text."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from gritd.config import packaged
from gritd.tools import main as cli

Output = Callable[[Path], Iterator[str]]
OUTPUTS: dict[str, Output] = {}
# what changes from day to day and from machine to machine
PASSING = (
    (re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d(:\d\d(\.\d+)?)?( UTC|Z)?"), "DATE"),
    (re.compile(r"\b(\d+(\.\d+)?) (kB|MB)\b"), "SIZE"),
    (
        re.compile(r"\b(gritd|python|numpy|filterpy|scipy) \d+\.\d+(\.\d+)?[a-z0-9.]*"),
        r"\1 VERSION",
    ),
    (re.compile(r"\bmachine [^,]+(, glibc [\d.]+)?"), "machine VERSION"),
    (re.compile(r"Unknown mat file type[^;]*"), "REASON"),
    (re.compile(r"\btick_revision \w+"), "tick_revision VERSION"),
)


def output(make: Output) -> Output:
    """Register a snapshot by the name of what makes it; `make` takes an empty folder."""
    OUTPUTS[make.__name__.replace("_", "-")] = make
    return make


def text_of(name: str, folder: Path) -> str:
    """The snapshot as it is now."""
    text = "\n".join(OUTPUTS[name](folder)).replace(f"{folder}/", "").replace(str(packaged()), "F")
    for pattern, word in PASSING:
        text = pattern.sub(word, text)
    return "\n".join(line.rstrip() for line in text.splitlines()) + "\n"


def said(folder: Path, *arguments: str) -> Iterator[str]:
    """A command, all that it prints, and its exit code where that is not 0."""
    out = io.StringIO()
    before = Path.cwd()
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            try:
                code: object = cli.main([*arguments])
            except SystemExit as stop:
                code = stop.code
    finally:
        os.chdir(before)

    yield f"$ gritd {' '.join(arguments)}"
    yield from out.getvalue().splitlines()
    if code:
        yield f"[exit code {code}]"
    yield ""
