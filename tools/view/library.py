"""The charts' library, uPlot, as an installed package carries it: nothing of it is kept here."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.cli.optional import INSTALL

PACKAGE = "metaflow-card-uplot"
FILES = {
    "uplot.js": "uPlot.iife.min.js",
    "uplot.css": "uPlot.min.css",
}  # served as -> in the package


def library() -> dict[str, Path]:
    """The library's files by the names they are served under. Raises CommandError where the
    package is not installed, or lacks one.
    """
    try:
        held = {Path(str(path)).name: path for path in metadata.files(PACKAGE) or ()}
        found = {served: Path(str(held[name].locate())) for served, name in FILES.items()}
    except (metadata.PackageNotFoundError, KeyError):
        found = {}
    if not found or not all(path.is_file() for path in found.values()):
        how = f"expected it installed: pip install {INSTALL[PACKAGE]}"
        raise CommandError(f"gritd view: found no {PACKAGE}; {how}", USAGE)
    return found
