"""What a manual says of a command, as its parser has it."""

from __future__ import annotations

import os
from argparse import SUPPRESS, ArgumentParser, _HelpAction, _SubParsersAction
from collections.abc import Iterator
from dataclasses import dataclass
from unittest.mock import patch

from gritd.tools.commands.table import COMMANDS, parser_of

WIDTH = "80"  # columns of a usage line
EXIT_CODES = {
    0: "The command did what was asked.",
    1: "It did not succeed, or is not sure of its result; the output says why.",
    2: "Options, a configuration or another input are wrong; one line says which.",
    3: "A recording is damaged, and was read as far as it goes.",
    130: "It was interrupted.",
}


@dataclass(frozen=True)
class ManualEntry:
    """An argument, an option or a subcommand: how it is written, and what it does."""

    written: str  # "-o OUT, --output OUT"
    text: str
    is_option: bool


@dataclass(frozen=True)
class ManualPage:
    """A command, or a subcommand with its parents' names before its own."""

    name: str  # "gritd calibrate pot"
    summary: str
    usage: str
    description: str
    entries: tuple[ManualEntry, ...]
    below: tuple[ManualPage, ...]  # its subcommands


def pages() -> dict[str, ManualPage]:
    """Command → page."""
    with patch.dict(os.environ, COLUMNS=WIDTH):
        return {name: _page(parser_of(name), summary) for name, (_, summary) in COMMANDS.items()}


def _page(parser: ArgumentParser, summary: str) -> ManualPage:
    return ManualPage(
        name=parser.prog,
        summary=summary,
        usage=parser.format_usage().removeprefix("usage: ").rstrip().replace("\n       ", "\n"),
        description=" ".join((parser.description or summary).split()),
        entries=tuple(_entries(parser)),
        below=tuple(_below(parser)),
    )


def _entries(parser: ArgumentParser) -> Iterator[ManualEntry]:
    formatter = parser._get_formatter()  # argparse has no public way

    for action in parser._actions:
        if action.help == SUPPRESS or isinstance(action, _HelpAction | _SubParsersAction):
            continue

        plain = formatter._format_action_invocation(action)
        text = formatter._expand_help(action) if action.help else ""
        yield ManualEntry(plain, text, bool(action.option_strings))


def _below(parser: ArgumentParser) -> Iterator[ManualPage]:
    for action in parser._actions:
        if isinstance(action, _SubParsersAction):
            summaries = {each.dest: each.help or "" for each in action._choices_actions}
            for name, below in action.choices.items():
                yield _page(below, summaries.get(name, ""))
