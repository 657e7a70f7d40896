"""The disk fails in the middle of a part, and the log folder goes: what follows is a recording of
its own, and what was lost is said.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time

import pytest

from gritd.estimator.recording.parts import parts
from tests.scenarios.commands import in_process
from tests.scenarios.recorded import recordings, rows, verified
from tests.scenarios.rig import ROOT, WIRES, driven, service

FAILED = "write error in the middle of a part"
AGAIN = "recovery of the log"
REMOVED = "log folder removed during a run"

FAILING = """
import errno, io, os, gritd.estimator.recording.mcapfile as m
made = m._created
class Failing(io.FileIO):
    def write(self, data):
        if os.path.exists({all!r}) or str(self.name) in open({some!r}).read().split():
            super().write(data[:len(data) // 2])
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return super().write(data)
def failing(path):
    made(path).close()
    return Failing(path, "r+b")
m._created = failing
"""


class Medium:
    """The files of a daemon fail with an I/O error: all of them, or the one that is open."""

    def __init__(self, folder):
        self._all, self._some = folder / "all", folder / "some"
        self._some.touch()
        self.prelude = FAILING.format(all=str(self._all), some=str(self._some))

    def fail(self, path=None):
        if path is None:
            self._all.touch()
        else:
            self._some.write_text(str(path.with_name(f".{path.name}.new")))

    def mend(self):
        self._all.unlink(missing_ok=True)


@pytest.mark.parametrize("lasting", [False, True])
def test_an_io_error_in_a_part(tmp_path, lasting, figure):
    """For half a second, or of one file for good: nothing is lost, it is said, and every part is
    verified alone or says why it cannot be.
    """
    medium = Medium(tmp_path)
    with service(tmp_path, driven(40.0, 1, skip=1.0), prelude=medium.prelude) as (_, daemon):
        time.sleep(1.0)
        medium.fail(daemon.path() if lasting else None)
        daemon.heard("log degraded")
        time.sleep(0.5)
        medium.mend()
        daemon.heard("log writing again, nothing was lost")
        daemon.until(lambda: len(daemon.lines("logging to ")) >= 2, "no new part")
        time.sleep(1.5)
        daemon.stop()

    assert "Input/output error" in daemon.lines("log degraded")[0][1]
    _, _, dropped, _ = daemon.account()
    assert verified(daemon.path())
    alone = [alone_or_why(part) for part in parts(daemon.path())]
    level = f"{WIRES}, its write fails, {'of one file for good' if lasting else '0.5 s'}"
    figure(AGAIN, level, "lines that do not say that nothing was lost", 0, limit=0)
    figure(FAILED, level, "messages lost", dropped, "", 0)
    figure(FAILED, level, "parts", len(alone))
    figure(FAILED, level, "parts that neither stand alone nor say why", alone.count(""), limit=0)
    figure(FAILED, level, "parts that say why", sum(why == "why" for why in alone))


def alone_or_why(part):
    """'alone' where every tick of a part is verified without the others, 'why' where the command
    says that the part does not begin with a state.
    """
    code, said = in_process("replay", part, "--verify")
    text = " ".join(said)
    if code == 0 and re.search(r"identical bit for bit$", text):
        return "alone"
    return "why" if "first state" in text and "lost" not in text else ""


def test_the_log_folder_is_removed(tmp_path, figure):
    """It is made again and held again; status answers; what one part held is lost."""
    logs = tmp_path / "logs"
    logs.mkdir()
    changes = {"logging": {"directory": str(logs)}}
    with service(tmp_path, driven(40.0, 1, skip=1.0), **changes) as (wires, daemon):
        time.sleep(2.0)
        before = daemon.status()["log"]["written"]
        shutil.rmtree(logs)
        gone = time.monotonic()
        back = daemon.heard("logging to", 2) - gone
        daemon.heard("was removed while it was used")
        second = subprocess.run(
            [sys.executable, "-m", "gritd", "run", "--config", wires.config],
            cwd=ROOT, capture_output=True, text=True, check=False, timeout=120,
        )  # fmt: skip
        time.sleep(1.0)
        daemon.stop()

    assert second.returncode == 1 and "another gritd is logging here" in second.stderr
    accepted, written, dropped, _ = daemon.account()
    (part,) = sorted(logs.glob("run-*.mcap"))
    (recording,) = recordings(part)
    found = sum(recording.counts.values())
    assert recording.complete and len(rows(part, "/tick")) > 200 and verified(part)
    figure(REMOVED, WIRES, "logging back", back, "s", 2.0, real=True)
    figure(REMOVED, WIRES, "messages lost in all", written - found)
    late = written - found - before
    figure(REMOVED, WIRES, "seconds lost after the removal", late / (5 * 250), "s", 2.0, real=True)
    figure(REMOVED, WIRES, "messages dropped", dropped, "", 0)
    assert accepted == written + dropped
