"""Who runs it: a second instance, another user, and nobody who listens."""

from __future__ import annotations

import fcntl
import os
import pwd
import resource
import signal
import stat
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from threading import Thread

import numpy as np

from gritd.estimator.daemon.publish import MAX_CLIENTS
from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import CommandError
from gritd.tools.service.client import connected, reports
from tests.scenarios.recorded import rows, verified
from tests.scenarios.rig import LIMIT, ROOT, WIRES, DaemonProcess, Wires, driven, service
from tests.scenarios.users import as_root, hand_over

SOCKET = "second daemon on a socket, too many readers"


def test_second_instance(tmp_path, seed, figure):
    with service(tmp_path, driven(40.0, seed, skip=1.0)) as (wires, daemon):
        began, spent = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
        second = subprocess.run(
            [sys.executable, "-m", "gritd", "run", "--config", str(wires.config)],
            cwd=ROOT, capture_output=True, text=True, check=False,
        )  # fmt: skip
        took, after = time.monotonic() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
        assert second.returncode == 1 and second.stdout == ""
        assert second.stderr == f"gritd: {tmp_path}: another gritd is logging here\n"
        time.sleep(0.3)
        daemon.stop()
    assert len(list(tmp_path.glob("*.mcap"))) == 1 and verified(daemon.path())
    own = after.ru_utime + after.ru_stime - spent.ru_utime - spent.ru_stime
    row, level = "second instance", "two daemon processes"
    figure(row, level, "refused, from the start of its process", took, "s", 0.5, real=True)
    figure(row, level, "processor time until then", own, "s", 0.5, real=True)


def test_a_socket_is_never_taken_from_another_daemon(tmp_path, figure):
    """Another log folder, the same socket: the second is refused, the first goes on publishing."""
    other = tmp_path / "other"
    with service(tmp_path, driven(40.0, 1, skip=1.0)) as (wires, daemon):
        second = subprocess.run(
            [
                *(sys.executable, "-m", "gritd", "run", "--config", str(wires.config)),
                *("--directory", str(other), "--socket", daemon.socket),
            ],
            cwd=ROOT, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert second.returncode == 1
        reason = f"gritd: {daemon.socket}: another gritd publishes its status here\n"
        assert second.stderr == reason and not list(other.glob("*.mcap"))

        with ExitStack() as readers:
            for _ in range(MAX_CLIENTS):
                connection = readers.enter_context(connected(daemon.socket))
                assert next(reports(connection))["pid"] == daemon.pid
                # who does not read is disconnected, and makes room for another
                Thread(target=read_on, args=(connection,), daemon=True).start()
            late = subprocess.run(
                [sys.executable, "-m", "gritd", "status", "--socket", daemon.socket],
                cwd=ROOT, capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert (late.returncode, late.stdout) == (1, "")
            daemon.stop()
    words = "gritd: the daemon is busy: 16 readers are connected, which is the most\n"
    figure(SOCKET, WIRES, "wrong answers", (late.stderr != words) + 0.0, "", 0)


def talking(wires):
    """A daemon that says a line ten times a second, into a pipe."""
    command = [sys.executable, "-m", "gritd", "run", "--status", "0.1", "--config"]
    return subprocess.Popen(
        [*command, str(wires.config)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def test_nobody_listens_any_more(tmp_path, figure):
    """What it says goes into a pipe whose other end is closed: it runs on, and closes its log when
    it is told to.
    """
    with Wires(tmp_path) as wires:
        daemon = talking(wires)
        path = next(line for line in daemon.stdout if line.startswith("logging to ")).split()[-1]
        daemon.stdout.close()
        wires.play(driven(40.0, 1, skip=1.0))
        time.sleep(2.0)
        daemon.send_signal(signal.SIGTERM)
        assert daemon.wait(LIMIT) == 0
    recording = read(path)
    assert recording.complete and recording.counts["/tick"] > 100
    figure("nobody listens", WIRES, "exit code after SIGTERM", 0, "", 0)


def test_somebody_does_not_read(tmp_path, figure):
    """What it says goes into a pipe that is full and stays open: it ends when it is told to, all
    the same.
    """
    with Wires(tmp_path) as wires:
        daemon = talking(wires)
        fcntl.fcntl(daemon.stdout, fcntl.F_SETPIPE_SZ, resource.getpagesize())
        path = next(line for line in daemon.stdout if line.startswith("logging to ")).split()[-1]
        wires.play(driven(40.0, 1, skip=1.0))
        time.sleep(4.0)
        daemon.send_signal(signal.SIGTERM)
        assert daemon.wait(LIMIT) == 0
        daemon.stdout.close()
    recording = read(path)
    assert recording.complete and recording.counts["/tick"] > 100
    figure("nobody listens", f"{WIRES}, a full pipe", "exit code after SIGTERM", 0, "", 0)


def test_watchers_do_not_slow_the_loop(tmp_path, seed, figure):
    """Nobody watches, then as many as are let in and as many again, of whom half never read."""
    with ExitStack() as watching, service(tmp_path, driven(40.0, seed, skip=1.0)) as (_, daemon):
        time.sleep(3.0)
        began = daemon.status()["loop"]["stamp"]
        for number in range(2 * MAX_CLIENTS):
            client = watching.enter_context(connected(daemon.socket))
            with suppress(CommandError, OSError):  # half of them are turned away
                next(reports(client))
            if number % 2:
                Thread(target=read_on, args=(client,), daemon=True).start()
        time.sleep(3.0)
        daemon.stop()
    loop = rows(daemon.path(), "/loop")
    for name, some in (
        ("nobody watches", loop["stamp"] < began),
        ("32 ask for reports", loop["stamp"] > began),
    ):
        late = np.quantile(loop["lateness"][some], 0.99) * 1e3
        figure("watchers", WIRES, f"lateness, 99 %, while {name}", late, "ms", 4.0, real=True)
    assert verified(daemon.path())


def read_on(client):
    with suppress(OSError):
        while client.recv(1 << 16):
            pass


@as_root
def test_unprivileged_user(folder_of_nobody, seed, figure):
    nobody = pwd.getpwnam("nobody").pw_uid
    with Wires(folder_of_nobody) as wires:
        hand_over(folder_of_nobody, wires, nobody)
        with DaemonProcess(wires.config, user=nobody) as daemon:
            daemon.ready()
            wires.play(driven(40.0, seed, skip=1.0))
            daemon.wait_status(lambda report: report["status"] == "TRACKING")
            assert stat.S_IMODE(os.stat(daemon.socket).st_mode) == 0o660
            daemon.stop()
    assert verified(daemon.path())
    figure("unprivileged user", f"{WIRES}, as nobody", "exit code after SIGTERM", 0, "", 0)


@as_root
def test_a_device_it_may_not_open_is_a_clear_error(folder_of_nobody, figure):
    nobody = pwd.getpwnam("nobody").pw_uid
    with Wires(folder_of_nobody) as wires:
        hand_over(folder_of_nobody, wires, nobody)
        port = os.path.realpath(wires.encoders.plug.path)
        os.chown(port, 0, 0)
        os.chmod(port, 0o600)
        with DaemonProcess(wires.config, user=nobody) as daemon:
            daemon.heard("device encoders WAITING")
            assert (
                "Permission denied (is the user in the port's group, often dialout?)" in daemon.text
            )
            os.chmod(port, 0o666)
            daemon.heard("device encoders OPEN")
            daemon.stop()
    figure(
        "unprivileged user",
        f"{WIRES}, as nobody",
        "lines that say why a port cannot be opened",
        1,
        "",
    )
