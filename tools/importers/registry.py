"""What an importer offers, and all of them by name: every module of `rigs/` is one, and what other
packages add.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol, cast

from gritd.estimator.plugins import IMPORTERS, plugins, refused
from gritd.tools.importers import rigs

Tell = Callable[[str], None]  # takes a line for the user
PARTS = ("NAME", "SUMMARY", "add_arguments", "run")  # of an importer


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
    """Every importer by its name: ours, and those of other packages. Raises PluginError."""
    names = sorted(module.name for module in pkgutil.iter_modules(rigs.__path__))
    modules = (cast(Importer, importlib.import_module(f"{rigs.__name__}.{name}")) for name in names)
    own = {module.NAME: module for module in modules}
    return own | _added(own)


def _added(own: Mapping[str, Importer]) -> dict[str, Importer]:
    """Importers of other packages: modules like those of `rigs/`."""
    importers: dict[str, Importer] = plugins(IMPORTERS)
    for name, importer in importers.items():
        lacking = [part for part in PARTS if not hasattr(importer, part)]
        if lacking or name != importer.NAME:
            why = f"found no {lacking[0]}" if lacking else f"found the name {importer.NAME}"
            raise refused(IMPORTERS, name, f"{why}; expected {', '.join(PARTS)}, NAME {name!r}")
        if name in own:
            raise refused(IMPORTERS, name, "found one of gritd's own; expected another name")
    return importers
