"""A real dask cluster on the loopback, with certificates: workers that are killed, hang, or have
another version, and a scheduler that goes.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from gritd.config import packaged
from tests.scenarios.hostile import honest
from tests.scenarios.rig import ROOT, until
from tests.tools.commands.certificates import certificates

pytest.importorskip("distributed", reason="dask.distributed is not installed")
pytestmark = [
    pytest.mark.slow,  # needs a scheduler
    pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is missing"),
]

CLUSTER = "dask: worker killed, hung, of another version; TLS"
LEVEL = "scheduler, workers and command as processes"
OTHER = "import gritd.tools.cli.cluster as c; c.__version__ = '0.0.1'\n"
CAMPAIGNS = 5


class Cluster:
    """A scheduler and workers, each a process, that encrypt what they say."""

    def __init__(self, folder):
        self._folder = folder
        keys = {f"DASK_{k.upper().replace('.', '__').replace('-', '_')}": v
                for k, v in certificates(folder).items()}  # fmt: skip
        self.environment = {
            **os.environ, **keys, "PYTHONPATH": str(ROOT),
            "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "15s",
        }  # fmt: skip
        self.processes = []
        at = folder / "scheduler.json"
        self.scheduler = self._start(
            "dask_scheduler", "--host", "tls://127.0.0.1", "--port", "0",
            "--no-dashboard", "--scheduler-file", at,
        )  # fmt: skip
        until(lambda: at.exists() and at.read_text().endswith("}"))
        self.address = json.loads(at.read_text())["address"]

    def worker(self, name, *options):
        """A worker, and where its work says that it began."""
        return self._start(
            "dask_worker", self.address, "--no-nanny", "--nthreads", "1", "--no-dashboard",
            "--name", name, "--local-directory", self._folder / name, *options,
        )  # fmt: skip

    def _start(self, program, *arguments):
        out = (self._folder / f"{len(self.processes)}.txt").open("w")
        command = [sys.executable, "-m", f"distributed.cli.{program}", *map(str, arguments)]
        self.processes.append(
            subprocess.Popen(command, env=self.environment, cwd=ROOT, stdout=out, stderr=out)
        )
        return self.processes[-1]

    def registered(self, count):
        """Wait for so many workers."""
        log = self._folder / "0.txt"
        until(lambda: log.read_text().count("Register worker") >= count, log.read_text)

    def gritd(self, *arguments):
        """A command on the cluster, begun."""
        return subprocess.Popen(
            [sys.executable, "-m", "gritd", *map(str, arguments), "--scheduler", self.address],
            cwd=ROOT, env=self.environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip


@contextmanager
def cluster(folder):
    made = Cluster(folder)
    try:
        yield made
    finally:
        for process in reversed(made.processes):
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()


def campaigns(folder, count=CAMPAIGNS):
    for number in range(count):
        (folder / str(number)).mkdir(parents=True)
        honest(folder / str(number) / "run.mcap", 8.0)
        shutil.copy(packaged(), folder / str(number) / "rig.yaml")
    return folder


def done(folder):
    return sum((each / "diagnosis.json").exists() for each in folder.iterdir())


def busy(process):
    """Whether a worker computes just now: half of a second of processor time in a second."""
    before = processor_time(process)
    time.sleep(1.0)
    return processor_time(process) - before > 0.5


def processor_time(process):
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def result(command, limit=900):
    out, error = command.communicate(timeout=limit)
    return command.returncode, out, error


def one_line(error):
    """The lines of an error, without those of progress."""
    return [line for line in error.splitlines() if line.startswith("gritd: ")]


@pytest.mark.slow
def test_workers_of_every_kind(tmp_path, figure):
    """One of another version and one that hangs from the start are left out and named; one is
    killed in the middle; what it had goes to the last.
    """
    folder = campaigns(tmp_path / "campaigns")
    other = tmp_path / "other.py"
    other.write_text(OTHER)
    with cluster(tmp_path) as at:
        good = [at.worker(name) for name in ("a", "b")]
        at.worker("other", "--preload", other)
        hanging = at.worker("hanging")
        at.registered(4)
        hanging.send_signal(signal.SIGSTOP)
        command = at.gritd("diagnose", "--campaigns", folder)
        until(lambda: done(folder) >= 1, limit=600)
        until(lambda: busy(good[0]) or done(folder) == CAMPAIGNS, limit=600)
        good[0].kill()
        code, out, error = result(command)

    notes = one_line(error)
    assert "has gritd 0.0.1" in error and "does not answer" in error and len(notes) == 2, error
    assert code == 0 and f"{CAMPAIGNS} of {CAMPAIGNS} campaigns diagnosed" in out, (out, error)
    figure(CLUSTER, LEVEL, "campaigns without a result, of 5", CAMPAIGNS - done(folder), limit=0)
    figure(CLUSTER, LEVEL, "workers left out and named, of 2", len(notes))


@pytest.mark.slow
def test_a_worker_that_hangs_in_the_middle(tmp_path, figure):
    """It is given up by the scheduler after its time, and what it had goes to the other."""
    folder = campaigns(tmp_path / "campaigns", 3)
    with cluster(tmp_path) as at:
        workers = [at.worker(name) for name in ("a", "b")]
        at.registered(2)
        command = at.gritd("diagnose", "--campaigns", folder)
        until(lambda: busy(workers[0]), limit=600)
        workers[0].send_signal(signal.SIGSTOP)
        code, out, error = result(command)
    assert code == 0 and "3 of 3 campaigns diagnosed" in out, (out, error)
    figure(
        CLUSTER,
        LEVEL,
        "campaigns without a result, of 3, one worker hangs",
        3 - done(folder),
        limit=0,
    )


@pytest.mark.slow
@pytest.mark.parametrize("ends", ["workers", "scheduler"])
def test_nobody_is_left(tmp_path, ends, figure):
    """One line, and what was finished stays."""
    folder = campaigns(tmp_path / "campaigns", 2)
    with cluster(tmp_path) as at:
        workers = [at.worker("a")]
        at.registered(1)
        command = at.gritd("diagnose", "--campaigns", folder)
        until(lambda: busy(workers[0]), limit=600)
        for process in workers if ends == "workers" else [at.scheduler]:
            process.kill()
        began = time.monotonic()
        code, out, error = result(command)
        took = time.monotonic() - began
    assert code == 1 and len(one_line(error)) == 1, (code, out, error)
    figure(
        CLUSTER,
        LEVEL,
        f"until it says that no {ends} are left".replace("no scheduler are", "no scheduler is"),
        took,
        "s",
        150,
        real=True,
    )


def test_blind_trials_on_it(tmp_path, figure):
    folder = tmp_path / "batch"
    with cluster(tmp_path) as at:
        for name in ("a", "b"):
            at.worker(name)
        at.registered(2)
        options = ("--cases", "2", "--seed", "1", "--strata", "none", "--seal-only")
        code, out, error = result(at.gritd("prove", *options, "--output", folder))
    assert code == 0 and not one_line(error), (out, error)
    sealed = len(list((folder / "answers").glob("*.json")))
    figure(CLUSTER, LEVEL, "blind trials not sealed, of 2", 2 - sealed, limit=0)
