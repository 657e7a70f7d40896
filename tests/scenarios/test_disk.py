"""The disk fills, goes read-only or hangs, parts are deleted, and the daemon is reported to end."""

from __future__ import annotations

import os
import pwd
import random
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gritd.estimator.recording.parts import part_path
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import CHECKPOINT
from tests.scenarios.recorded import log_lines, recordings, rows, verified
from tests.scenarios.rig import ROOT, WIRES, DaemonProcess, Wires, driven, service
from tests.scenarios.users import as_root, hand_over

FULL = "disk full"
READ_ONLY = "log folder read-only"
TERM = "SIGTERM"
AGAIN = "recovery of the log"


@pytest.fixture
def small_disk(tmp_path):
    """A tmpfs of 16 MB: more than a scenario logs, however slow the machine."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(disk)],
        capture_output=True,
        text=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip(f"cannot mount a small tmpfs: {mounted.stderr.strip()}")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


def test_disk_full(tmp_path, small_disk, seed, figure):
    """Full for 3 s, then room again: what queued in the meantime is written and no tick is lost."""
    rng = random.Random(seed)
    wiring = tmp_path / "wires"
    wiring.mkdir()
    with service(wiring, driven(40.0, seed, skip=1.0), logging={"directory": str(small_disk)}) as (
        _,
        daemon,
    ):
        time.sleep(rng.uniform(0.5, 1.0))
        ballast = fill(small_disk)
        daemon.heard("log degraded")
        before = daemon.status()["loop"]["ticks"]
        time.sleep(rng.uniform(1.0, 2.0))
        daemon.wait_status(lambda report: report["loop"]["ticks"] > before)
        ballast.unlink()
        room = time.monotonic()
        back = daemon.heard("log writing") - room
        daemon.stop()
        kept = copied(daemon, tmp_path)
    stamps, missed = rows(kept, "/tick")["stamp"], rows(kept, "/loop")["missed"]
    gone = (
        round((stamps[-1] - stamps[0]) / 4e6) + 1 - len(stamps) - (int(missed[-1]) - int(missed[0]))
    )
    figure(
        FULL,
        f"{WIRES}, on a tmpfs of 16 MB",
        "logging back after there is room",
        back,
        "s",
        5.0,
        real=True,
    )
    figure(FULL, f"{WIRES}, on a tmpfs of 16 MB", "ticks lost", gone, "", 0)
    assert verified(kept)


SMALL_QUEUE = """
import gritd.estimator.recording.writer as m
m.WriterThread.__init__.__kwdefaults__["capacity"] = 3000
"""


def test_disk_full_for_longer_than_the_queue_holds(tmp_path, small_disk, seed, figure):
    """The oldest messages are dropped and counted; a new part goes on, and is verified from its
    checkpoint on.
    """
    wiring = tmp_path / "wires"
    wiring.mkdir()
    changes = {"logging": {"directory": str(small_disk)}, "prelude": SMALL_QUEUE}
    with service(wiring, driven(40.0, seed, skip=1.0), **changes) as (_, daemon):
        time.sleep(0.5)
        ballast = fill(small_disk)
        daemon.wait_status(lambda report: report["log"]["dropped"] > 2000)
        ballast.unlink()
        daemon.heard("log writing")
        reported = re.search(r"again, (\d+) messages were lost", daemon.lines("log writing")[0][1])
        time.sleep(1.5)
        daemon.stop()
        accepted, written, dropped, queued = daemon.account()
        kept = copied(daemon, tmp_path)
    assert reported and 0 < int(reported[1]) <= dropped, daemon.text
    figure(AGAIN, WIRES, "lines that do not say what was lost", 0, limit=0)
    first, second = recordings(kept)
    assert first.run.lost_before == 0 and second.run.lost_before == dropped
    level = f"{WIRES}, on a tmpfs of 16 MB, a queue of 3000 messages"
    figure(FULL, level, "messages not accounted for", accepted - written - dropped - queued, "", 0)
    assert verified(kept)


def fill(disk):
    ballast = disk / "ballast"
    with open(ballast, "wb", buffering=0) as out:
        try:
            while True:
                out.write(bytes(4096))
        except OSError:
            return ballast


def copied(daemon, folder):
    """The recording, off the disk that is unmounted in the end."""
    first = daemon.path()
    for part in first.parent.glob("*.mcap"):
        shutil.copy(part, folder)
    return folder / first.name


@as_root
def test_log_folder_read_only_at_the_start(folder_of_nobody, seed, figure):
    """Refused before anything heavy is loaded, which nobody could not: the code may lie where only
    root can read.
    """
    nobody, logs = pwd.getpwnam("nobody").pw_uid, folder_of_nobody / "logs"
    loaded = "import encodings.utf_8_sig, locale, os, shutil, sys"
    loaded += "; import gritd.tools.main, gritd.tools.commands.run"
    becoming = f"os.setgroups([]); os.setgid({nobody}); os.setuid({nobody})"
    code = f"{loaded}; {becoming}; sys.exit(gritd.tools.main.main(sys.argv[1:]))"
    with Wires(folder_of_nobody, logging={"directory": str(logs)}) as wires:
        logs.mkdir(mode=0o555)
        began = time.monotonic()
        daemon = subprocess.run(
            [sys.executable, "-c", code, "run", "--config", str(wires.config)],
            cwd=ROOT, capture_output=True, text=True, check=False,
        )  # fmt: skip
        took = time.monotonic() - began
    assert daemon.returncode == 1 and daemon.stdout == ""
    assert daemon.stderr == f"gritd: {logs}: cannot keep logs here: Permission denied\n"
    what = "at start: error and exit, from the start of its process"
    figure(READ_ONLY, f"{WIRES}, as nobody", what, took, "s", 1.0, real=True)


@as_root
def test_log_folder_read_only_during_a_run(folder_of_nobody, seed, figure):
    """Its permissions are taken away: the open part goes on, a new one cannot begin; said, and
    repaired when back.
    """
    nobody, logs = pwd.getpwnam("nobody").pw_uid, folder_of_nobody / "logs"
    logs.mkdir()
    changes = {"directory": str(logs), "part_time": "2 s"}
    with Wires(folder_of_nobody, logging=changes) as wires:
        hand_over(folder_of_nobody, wires, nobody)
        with DaemonProcess(wires.config, user=nobody) as daemon:
            daemon.ready()
            wires.play(driven(40.0, seed, skip=1.0))
            logs.chmod(0o555)
            degraded = daemon.heard("log degraded")
            assert "Permission denied" in daemon.text
            before = daemon.status()["loop"]["ticks"]
            time.sleep(0.5)
            daemon.wait_status(lambda report: report["loop"]["ticks"] > before)
            logs.chmod(0o755)
            back = daemon.heard("log writing") - degraded
            daemon.stop()
            assert daemon.account()[2] == 0
    said = degraded - max(when for when in parts_asked(daemon.path()) if when < degraded)
    level, back_again = (
        f"{WIRES}, as nobody",
        "during a run: logging back after 0.5 s without rights",
    )
    figure(
        READ_ONLY,
        level,
        "during a run: said, after a part could not begin",
        said,
        "s",
        1.0,
        real=True,
    )
    figure(READ_ONLY, level, back_again, back, "s", 2.5, real=True)
    assert verified(daemon.path())


def parts_asked(path):
    """When the loop asked for a new part, by our monotonic clock [s]."""
    wall = time.time() - time.monotonic()
    return [
        m[1] * 1e-9 - wall
        for recording in recordings(path)
        for m in recording.messages()
        if m[0] == CHECKPOINT
    ]


def test_the_open_part_is_deleted_by_somebody(tmp_path, figure):
    """What was in it is gone; what comes goes into a new part, and the log says so."""
    with service(tmp_path, driven(40.0, 1, skip=1.0)) as (_, daemon):
        time.sleep(1.5)
        daemon.path().unlink()
        daemon.heard("logging to", 2)
        daemon.heard("was deleted while it was written")
        time.sleep(1.0)
        daemon.stop()
    (part,) = tmp_path.glob("run-*.mcap")
    recording = read(part)
    assert recording.complete and any(
        "was deleted while it was written" in line for line in log_lines(part)
    )
    figure(
        "open part deleted",
        WIRES,
        "seconds in the part after it",
        len(recording.arrays("/tick")) / 250,
        "s",
    )
    assert verified(part)


# ---- SIGTERM -------------------------------------------------------------------------------------


def test_sigterm_under_load(tmp_path, seed, figure):
    rng = random.Random(seed)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    try:
        with service(tmp_path, driven(40.0, seed, skip=1.0)) as (_, daemon):
            time.sleep(rng.uniform(1.0, 2.0))
            took = daemon.stop()
    finally:
        for process in busy:
            process.kill()
            process.wait()
    # what a starved loop had to drop before is counted; what is there at SIGTERM is all written
    accepted, written, dropped, queued = daemon.account()
    assert queued == 0 and accepted == written + dropped
    (queue,) = [line for _, line in daemon.said if re.match("queue: received", line)]
    received, processed, lost, waiting = map(int, re.findall(r"\d+", queue))
    assert waiting == 0 and received == processed + lost

    recording = read(daemon.path())
    assert recording.complete and sum(1 for _ in recording.messages()) == written
    figure(
        TERM,
        f"{WIRES}, two busy processes",
        "to exit 0 with everything written",
        took,
        "s",
        2.0,
        real=True,
    )
    assert verified(daemon.path())


SLOW_MEDIUM = """
import time, gritd.estimator.recording.syncer as m
began, sync = time.monotonic(), m.sync
def waiting(file):
    if time.monotonic() > began + 3.0: time.sleep(3600)
    sync(file)
m.sync = waiting
"""


def test_sigterm_while_the_medium_hangs(tmp_path, seed, figure):
    """It is not waited for: the kernel has everything, and the last line says that the medium has
    not confirmed it.
    """
    with service(tmp_path, driven(40.0, seed, skip=1.0), prelude=SLOW_MEDIUM) as (_, daemon):
        time.sleep(3.0)
        took = daemon.stop()
    assert daemon.text.endswith("the medium has not confirmed the last of it")
    figure(TERM, f"{WIRES}, a sync that never returns", "to exit 0", took, "s", 2.0, real=True)
    assert read(daemon.path()).complete and verified(daemon.path())


def test_the_open_part_is_never_deleted(tmp_path, figure):
    """Parts of a second under a cap of 1 MB: the oldest go first, what remains is verified part by
    part.
    """
    old = tmp_path / "old.mcap"
    old.write_bytes(bytes(990_000))
    os.utime(old, (0, 0))
    with service(
        tmp_path, driven(40.0, 1, skip=1.0), logging={"part_time": "1 s", "disk_cap": "1 MB"}
    ) as (_, daemon):
        daemon.heard("old.mcap: deleted, over logging.disk_cap")
        daemon.heard("logging to", 5)
        time.sleep(0.5)
        daemon.stop()
    parts = sorted(tmp_path.glob("run-*.mcap"), key=lambda path: path.stat().st_mtime)
    kept = sum(part.stat().st_size for part in parts) / 1e6
    figure("disk cap and rotation", WIRES, "kept, of a cap of 1 MB", kept, "MB", 1.2, real=True)
    assert len(parts) >= 4
    assert verified(daemon.path())
    assert all(verified(part) for part in parts[1:])
    figure("disk cap and rotation", WIRES, "parts written and verified one by one", len(parts), "")
    assert Path(daemon.path()).exists()


def test_links_and_folders_named_like_recordings(tmp_path, figure):
    """A dangling link, a link to somebody's file, a folder, and both in the place of the next
    parts: the cap holds, and what is no recording stays.
    """
    precious, old = tmp_path / "precious", tmp_path / "old.mcap"
    precious.write_bytes(bytes(2_000_000))
    old.write_bytes(bytes(990_000))
    os.utime(old, (0, 0))
    (tmp_path / "gone.mcap").symlink_to(tmp_path / "nothing")
    (tmp_path / "link.mcap").symlink_to(precious)
    (tmp_path / "folder.mcap").mkdir()
    changes = {"part_time": "1 s", "disk_cap": "1 MB"}
    with service(tmp_path, driven(40.0, 1, skip=1.0), logging=changes) as (_, daemon):
        last = put_in_the_way(daemon.path(), tmp_path / "nothing")
        daemon.until(lambda: newest(daemon) > last, "did not go past what is in its way")
        daemon.heard("old.mcap: deleted, over logging.disk_cap")
        daemon.heard(".mcap: deleted, over logging.disk_cap", 4)
        time.sleep(0.5)
        daemon.stop()

    files = [path for path in tmp_path.glob("*.mcap") if path.is_file() and not path.is_symlink()]
    kept = sum(path.stat().st_size for path in files)
    obstacles = [path for path in tmp_path.glob("*.mcap") if path not in files]
    assert len(obstacles) == 5 and precious.stat().st_size == 2_000_000
    assert not daemon.lines("cannot be kept"), daemon.text
    _, _, dropped, _ = daemon.account()
    row = "links and folders named like recordings"
    figure(row, WIRES, "kept, of a cap of 1 MB", kept / 1e6, "MB", 1.2, real=True)
    figure(row, WIRES, "messages lost", dropped, "", 0)


def put_in_the_way(path, target):
    """A folder and a dangling link in the place of the next two parts that nobody has begun yet;
    the number of the second.
    """
    number, left = 3, 2
    while left:
        try:
            if left == 2:
                part_path(path, number).mkdir()
            else:
                part_path(path, number).symlink_to(target)
            left -= 1
        except FileExistsError:
            pass  # a part was begun there meanwhile
        number += 1
    return number - 1


def newest(daemon):
    """The number of the part that it began last."""
    line = daemon.lines("logging to ")[-1][1]
    found = re.search(r"\.(\d+)\.mcap$", line)
    return int(found[1]) if found else 0
