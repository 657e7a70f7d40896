"""The environment in which every command of `twenty` runs."""

from __future__ import annotations

import os

KEPT = ("PATH", "HOME", "LANG", "LC_ALL", "TMPDIR")  # of the environment
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUTF8": "1"}


def environment() -> dict[str, str]:
    """Ours without what could matter, and one thread a process."""
    return {name: os.environ[name] for name in KEPT if name in os.environ} | ONE_THREAD
