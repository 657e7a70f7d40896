"""What an importer offers, and all of them by name: every module of `rigs/` is one, and what other
packages add.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Protocol, cast

from gritd.estimator.plugins import IMPORTERS, PluginError, leave_out, plugins, refused
from gritd.tools.importers import rigs

Tell = Callable[[str], None]  # takes a line for the user
PARTS = ("NAME", "SUMMARY", "add_arguments", "run")  # of an importer


class Importer(Protocol):
    """A module of `rigs/`. `run` gets `paths` and `output` beside its own arguments. ALIASES, where
    it has some, are further names.
    """

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
    """Every importer by its name: ours, and those of other packages."""
    names = sorted(module.name for module in pkgutil.iter_modules(rigs.__path__))
    modules = (cast(Importer, importlib.import_module(f"{rigs.__name__}.{name}")) for name in names)
    own = {module.NAME: module for module in modules}
    return own | _added(own)


def aliases(importer: Importer) -> tuple[str, ...]:
    """Further names of an importer."""
    return getattr(importer, "ALIASES", ())


def _added(own: Mapping[str, Importer]) -> dict[str, Importer]:
    """Importers of other packages: modules like those of `rigs/`; without what is none, which is
    said.
    """
    importers: dict[str, Importer] = {}
    named = {*own, *(alias for each in own.values() for alias in aliases(each))}
    for name, importer in plugins(IMPORTERS).items():
        try:
            _check(name, importer, named)
            importers[name] = importer
        except PluginError as error:
            leave_out(IMPORTERS, name, error)
    return importers


def _check(name: str, importer: object, own: Collection[str]) -> None:
    """Raises PluginError."""
    lacking = [part for part in PARTS if not hasattr(importer, part)]
    if lacking or name != getattr(importer, "NAME", None):
        found = f"no {lacking[0]}" if lacking else f"the name {getattr(importer, 'NAME', None)}"
        why = f"found {found}; expected {', '.join(PARTS)}, NAME {name!r}"
        raise refused(IMPORTERS, name, why)
    if not isinstance(getattr(importer, "SUMMARY", None), str):
        raise refused(IMPORTERS, name, "SUMMARY is no text; expected one line")
    if name in own:
        raise refused(IMPORTERS, name, "found one of gritd's own; expected another name")
