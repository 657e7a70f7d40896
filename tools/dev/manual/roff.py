"""Man pages: `gritd(1)`, and `gritd-COMMAND(1)` for each command."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator, Mapping

from gritd import __version__
from gritd.tools.commands.table import COMMANDS
from gritd.tools.dev.manual.examples import EXAMPLES
from gritd.tools.dev.manual.page import EXIT_CODES, ManualEntry, ManualPage

OPTION = re.compile(r"(?<![\w-])-[\w-]+")  # its hyphens are minus signs, for who copies them
WORD = re.compile(r"[^ ,|]+")
FILES = {
    "/etc/gritd/config.yaml": "The configuration of the service.",
    "/var/lib/gritd": "The recordings of the service.",
}


def man_pages(of: Mapping[str, ManualPage]) -> dict[str, str]:
    """File name → text, as man reads it (roff, macros of man(7))."""
    own = {f"gritd-{name}.1": "\n".join(_page(name, page)) for name, page in of.items()}
    return {"gritd.1": "\n".join(_first()), **own}


def _first() -> Iterator[str]:
    yield from _head("gritd", "learn the soil under a rover wheel while the wheel drives")
    yield from (
        ".SH SYNOPSIS",
        r".B gritd",
        r".I COMMAND",
        r"[\fIoptions\fR]",
        ".br",
        r".B gritd \-\-help",
        ".br",
        r".B gritd \-\-version",
        ".SH DESCRIPTION",
        "A wheel drives in a testbed. gritd reads its encoders, its sinkage and the current of its",
        "motor, estimates the soil's cohesion c and friction tan φ while it drives, and keeps",
        "everything in an MCAP file. Where recordings and simulation differ, it names the physics",
        "that was left out.",
        ".SH COMMANDS",
    )
    for name, (_, summary) in COMMANDS.items():
        yield from _tagged(rf"\fBgritd\-{_literal(name)}\fR(1)", summary)

    yield ".SH FILES"
    for path, text in FILES.items():
        yield from _tagged(rf"\fI{_literal(path)}\fR", text)
    yield from _exit_codes()


def _page(name: str, page: ManualPage) -> Iterator[str]:
    yield from _head(f"gritd-{name}", page.summary)
    yield ".SH SYNOPSIS"
    yield from _verbatim(page.usage)
    yield from (".SH DESCRIPTION", _text(page.description))
    yield from _entries(page, ".SH", {True: "OPTIONS", False: "ARGUMENTS"})

    if page.below:
        yield ".SH COMMANDS"
    for below in page.below:
        yield f".SS {_literal(below.name)}"
        yield _text(below.summary or below.description)
        yield ".PP"
        yield from _verbatim(below.usage)
        yield from _entries(below, ".PP", {})

    if name in EXAMPLES:
        yield ".SH EXAMPLES"
        yield from _verbatim("\n".join(EXAMPLES[name].lines))
    yield from _exit_codes()
    yield from (".SH SEE ALSO", r"\fBgritd\fR(1)")


def _head(name: str, summary: str) -> Iterator[str]:
    day = time.strftime(
        "%Y-%m-%d", time.gmtime(int(os.environ.get("SOURCE_DATE_EPOCH", time.time())))
    )
    yield f'.TH {_literal(name.upper())} 1 "{day}" "gritd {__version__}" "Manual of gritd"'
    yield from (".SH NAME", rf"{_literal(name)} \- {_text(summary)}")


def _entries(page: ManualPage, begins: str, titles: Mapping[bool, str]) -> Iterator[str]:
    for options in (False, True):
        entries = [entry for entry in page.entries if entry.is_option is options]
        if entries and titles:
            yield f"{begins} {titles[options]}"
        for entry in entries:
            yield from _tagged(_tag(entry), entry.text)


def _tag(entry: ManualEntry) -> str:
    """Words of options bold, their values slanted."""
    return WORD.sub(
        lambda word: rf"\f{'B' if word[0].startswith('-') else 'I'}{_literal(word[0])}\fR",
        entry.written,
    )


def _tagged(tag: str, text: str) -> Iterator[str]:
    yield from (".TP", tag, _text(text))


def _exit_codes() -> Iterator[str]:
    yield ".SH EXIT STATUS"
    for code, text in EXIT_CODES.items():
        yield from _tagged(rf"\fB{code}\fR", text)


def _verbatim(text: str) -> Iterator[str]:
    yield ".nf"
    yield from (_at_start(_literal(line)) for line in text.splitlines())
    yield ".fi"


def _text(text: str) -> str:
    """A paragraph: what is written like an option has minus signs."""
    safe = " ".join(text.split()).replace("\\", r"\e")
    return _at_start(OPTION.sub(lambda option: option[0].replace("-", r"\-"), safe))


def _literal(text: str) -> str:
    return text.replace("\\", r"\e").replace("-", r"\-")


def _at_start(line: str) -> str:
    """A line that begins like a request is text."""
    return rf"\&{line}" if line.startswith((".", "'")) else line
