"""What an importer offers, and all of them by name: every module of `rigs/` is one."""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, cast

from gritd.tools.importers import rigs

Tell = Callable[[str], None]  # takes a line for the user


class Importer(Protocol):
    """A module of `rigs/`. `run` gets `paths` and `output` beside its own arguments."""

    NAME: str
    SUMMARY: str

    @staticmethod
    def add_arguments(parser: argparse.ArgumentParser) -> None:
        """Options of this rig alone."""

    @staticmethod
    def run(args: argparse.Namespace, tell: Tell) -> list[Path]:
        """Write the recordings and their configuration; returns what was written. Raises
        RigFileError.
        """


def importers() -> dict[str, Importer]:
    """Every importer by its name."""
    names = sorted(module.name for module in pkgutil.iter_modules(rigs.__path__))
    modules = (cast(Importer, importlib.import_module(f"{rigs.__name__}.{name}")) for name in names)
    return {module.NAME: module for module in modules}
