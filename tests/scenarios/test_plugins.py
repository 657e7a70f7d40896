"""Packages of others that add to gritd, and are wrong."""

from __future__ import annotations

import time

import pytest

from tests.plugin_package import made, offer, python
from tests.scenarios.commands import AS_PROCESSES
from tests.scenarios.conftest import slow

PLUGINS = "plug-in that ends the program, raises, hangs"
OFFERED = (
    ("effects", "second = my_rig.ends", ("effects",)),
    ("effects", "third = my_rig.nowhere:X", ("effects",)),
    ("importers", "badarg = my_rig.badarg", ("import", "--help")),
    ("importers", "mylab = my_rig.ends", ("import", "--help")),
    ("importers", "mylab = my_rig.prints", ("import", "--help")),
    ("sensors", "sinkage_pot = my_rig.ends", ("check-config",)),
    ("sensors", "sinkage_pot = my_rig.mylab", ("check-config",)),
)
HANGS = ("effects", "second = my_rig.hangs", ("effects",))
OWN = {"effects": "bulldozing", "import": "cmu"}


@pytest.mark.parametrize("offered", [OFFERED, slow((HANGS,))], ids=["wrong", "hangs"])
def test_plugins_that_are_wrong(tmp_path, offered, figure):
    """Each is named with its package in one line; what is gritd's own works on, and what would
    need the plug-in ends with code 2.
    """
    package, wrong, longest = made(tmp_path), [], 0.0
    for group, line, command in offered:
        offer(package, f"[gritd.{group}]\n{line}\n")
        began = time.monotonic()
        done = python(package, "-m", "gritd", *command)
        longest = max(longest, time.monotonic() - began)

        named = "(package my-rig)" in done.stderr and done.stderr.count("\n") == 1
        own = OWN.get(command[0], "")
        works = done.returncode == 0 and own in done.stdout if own else done.returncode == 2
        wrong += [] if named and works else [(line, done)]
    assert not wrong, wrong
    figure(PLUGINS, AS_PROCESSES, "plug-ins", len(offered))
    figure(PLUGINS, AS_PROCESSES, "not named in one line, or in the way of others", 0, limit=0)
    figure(PLUGINS, AS_PROCESSES, "longest until then", longest, "s", 15, real=True)
