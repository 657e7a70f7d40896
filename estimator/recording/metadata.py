"""The metadata records of a recording: their names, their checksums, and the versions they keep."""

from __future__ import annotations

import os
import platform
import zlib
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from gritd.estimator.visible import writable

CONFIG, RUN, RECOVERED = "gritd.config", "gritd.run", "gritd.recovered"
TICK_REVISION = "tick_revision"  # entry of CONFIG: messages.tick.REVISION of what computed /tick
CHECKSUM = "crc32"


def sealed(name: str, entries: Mapping[str, str]) -> dict[str, str]:
    """A metadata record's entries and their checksum: MCAP has none, and a flipped bit must not
    pass for a setting.
    """
    kept = {key: writable(value) for key, value in entries.items() if key != CHECKSUM}
    return {**kept, CHECKSUM: _checksum(name, kept)}


def seal_holds(name: str, entries: Mapping[str, str], required: bool) -> bool:
    """Whether the entries are as sealed; without a seal (another writer's), whether none is
    required.
    """
    return sealed(name, entries) == entries if CHECKSUM in entries else not required


def _checksum(name: str, entries: Mapping[str, str]) -> str:
    text = "\0".join((name, *(part for item in sorted(entries.items()) for part in item)))
    return f"{zlib.crc32(text.encode()):08x}"


def changed_versions(then: Mapping[str, str]) -> list[str]:
    """What computes otherwise than `versions` said then, in words."""
    now = versions()
    return [
        f"{name} {now.get(name, 'absent')}, then {then.get(name, 'absent')}"
        for name in {**now, **then}
        if name != TICK_REVISION and then.get(name) != now.get(name)
    ]


@cache
def versions() -> Mapping[str, str]:
    """What computed this run: a replay that differs can say what changed."""
    installed = {"python": platform.python_version(), "machine": _machine()}
    for package in ("gritd", "numpy", "filterpy", "scipy"):
        with suppress(PackageNotFoundError):
            installed[package] = version(package)
    return installed


def _machine() -> str:
    """The kind of processor, and the C library whose sin, cos, exp and log are used. Without FMA,
    those of glibc on x86-64 give other last digits than with it, or than on aarch64.
    """
    machine, libc = platform.machine(), ""
    with suppress(OSError):
        flags = Path("/proc/cpuinfo").read_text("utf-8").partition("flags")[2].partition("\n")[0]
        machine += " without FMA" * bool(flags and "fma" not in flags.split())
    with suppress(ValueError, OSError):  # no glibc
        libc = os.confstr("CS_GNU_LIBC_VERSION") or ""
    return f"{machine}, {libc}" if libc else machine
