"""A thread of the daemon dies or hangs."""

from __future__ import annotations

import time
from contextlib import suppress

import pytest

from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import CommandError
from tests.scenarios.rig import WIRES, driven, service

DIES = "a thread dies"

DYING = """
import time
first, told = [], []
def dying(method):
    def call(*arguments, **options):
        first.append(time.monotonic())
        if first[-1] > first[0] + 2.0:
            told or print("fault injected", flush=True)
            told.append(1)
            raise ZeroDivisionError("injected")
        return method(*arguments, **options)
    return call
"""
VICTIMS = {
    "reader": "import gritd.drivers.reader as m; m.Reader._take = dying(m.Reader._take)",
    "loop": "import gritd.estimator.online.pipeline as m; m.Pipeline.step = dying(m.Pipeline.step)",
    "writer": "import gritd.estimator.recording.writer as m\n"
    "m.WriterThread._attempt = dying(m.WriterThread._attempt)",
    "writer-sync": "import gritd.estimator.recording.syncer as m\n"
    "m.Syncer._sync = dying(m.Syncer._sync)",
    "publisher": "import gritd.estimator.daemon.publish as m\n"
    "m.Publisher._accept = dying(m.Publisher._accept)",
}


@pytest.mark.parametrize("victim", VICTIMS)
def test_a_thread_dies(tmp_path, victim, seed, figure):
    with service(tmp_path, driven(40.0, seed, skip=1.0), prelude=DYING + VICTIMS[victim]) as (
        _,
        daemon,
    ):
        daemon.until(
            lambda: daemon.lines("fault injected") or (victim == "publisher" and poke(daemon)),
            "no fault",
        )
        code = daemon.exit_code()
        took = time.monotonic() - daemon.heard("fault injected")
    assert code == 1, daemon.text
    ((_, line),) = daemon.lines("gritd: ")
    assert victim.partition("-")[0] in line, line
    assert "Traceback" not in daemon.text
    figure(
        DIES,
        f"{WIRES}, an exception raised inside",
        f"{victim}: from the fault to the exit",
        took,
        "s",
        1.0,
        real=True,
    )
    read(daemon.path())


def poke(daemon):
    with suppress(CommandError):
        daemon.status()


HANGING = """
import time, threading
import gritd.drivers.serial_link as m
first, read = [], m.SerialLink.read
def hanging(self):
    first.append(time.monotonic())
    if first[-1] > first[0] + 4.0: time.sleep(3600)
    return read(self)
m.SerialLink.read = hanging
"""


@pytest.mark.slow
def test_a_thread_that_hangs_starves_the_watchdog(tmp_path, seed, figure):
    with service(tmp_path, driven(40.0, seed, skip=1.0), prelude=HANGING, watchdog=0.6) as (
        _,
        daemon,
    ):
        assert daemon.strokes(2.0) > 0
        daemon.heard("hanging: reader encoders; the watchdog is not stroked")
        strokes = daemon.strokes(2.0)
        figure(
            DIES,
            f"{WIRES}, a read that never returns",
            "watchdog strokes while a reader hangs",
            strokes,
            "",
            0,
        )
        assert not daemon.status()["healthy"]
