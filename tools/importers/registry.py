"""Importers of other rigs' public data, one file a rig. A module here with the names of `Rig` is
found by itself.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, cast

SHARED = (
    "registry",
    "_files",
    "_recording",
    "_segments",
)  # modules of this package that are no importer

Progress = Callable[[str], None]


class Rig(Protocol):
    """What a module of this folder offers. `run` gets `paths` and `output` beside its own
    arguments.
    """

    NAME: str
    SUMMARY: str

    @staticmethod
    def add_arguments(parser: argparse.ArgumentParser) -> None:
        """Options of this rig alone."""

    @staticmethod
    def run(args: argparse.Namespace, progress: Progress) -> list[Path]:
        """Write the recordings and their configuration; returns what was written. Raises
        RigFileError.
        """


def rigs() -> dict[str, Rig]:
    """Every importer by its name; the modules of SHARED are none."""
    folder = str(Path(__file__).parent)
    names = sorted(info.name for info in pkgutil.iter_modules([folder]) if info.name not in SHARED)
    modules = (cast(Rig, importlib.import_module(f"{__package__}.{name}")) for name in names)
    return {module.NAME: module for module in modules}


def positive(text: str) -> float:
    """A command-line number that is finite and above zero. Raises ArgumentTypeError."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a number above 0")
    return value
