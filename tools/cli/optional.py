"""Packages that gritd can do without: what needs one says so in one line."""

from __future__ import annotations

from importlib.util import find_spec

from gritd.tools.cli.command import USAGE, CommandError

FORMATS = "'gritd[formats]'"
INSTALL = {
    "matplotlib": "matplotlib",
    "distributed": "'gritd[cluster]'",
    "pyarrow": "'gritd[parquet]'",
    "asammdf": "'gritd[mdf]'",
    **dict.fromkeys(("h5py", "nptdms", "pyulog", "python_calamine", "rosbags"), FORMATS),
    "starlette": "'gritd[view]'",
    "uvicorn": "'gritd[view]'",
    "metaflow-card-uplot": "'gritd[view]'",
    "foxglove": "'gritd[foxglove]'",
}


def missing(package: str) -> str:
    """That a package is not installed, and how to get it; empty where it is."""
    if find_spec(package):
        return ""
    return f"found no {package}; expected it installed: pip install {INSTALL[package]}"


def require(package: str, what: str) -> None:
    """Raises CommandError where `what` needs a package that is not installed."""
    if how := missing(package):
        raise CommandError(f"{what}: {how}", USAGE)
