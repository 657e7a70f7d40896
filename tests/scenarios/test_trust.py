"""What comes from outside and wants more than to be read: escapes, names, other people's files."""

from __future__ import annotations

import hashlib
import json
import os
import re
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread

from gritd.config import packaged
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.cdr import Topic
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.topics import TOPICS
from tests.scenarios.commands import AS_PROCESSES
from tests.scenarios.recorded import log_lines
from tests.scenarios.rig import ROOT, TESTBED, WIRES, DaemonProcess, Wires, driven, until

QUICK = True
ESCAPES = "terminal escapes in names"
OUTSIDE = "names that lead out of the folder"
OBSTACLES = "symlinked lock, FIFO, killed parent"
READABLE = "world-writable configuration, readable recordings"
SCHEDULER = "hostile worker behind --scheduler"

EVIL = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e\r\nfake line"
CONTROL = re.compile(r"[^\S\n ]|[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e]")


def gritd(*arguments, timeout=120):
    """A command as a user runs it: exit code, standard output and error as text."""
    done = subprocess.run(
        [sys.executable, "-m", "gritd", *map(str, arguments)],
        cwd=ROOT, capture_output=True, timeout=timeout, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def evil_recording(path):
    """Readings of two seconds under a name, a topic and notes full of escapes."""
    topic = Topic(f"/{EVIL}", f"msg/{EVIL}", (("n", "int64", ""),))
    run = RunInfo(EVIL, 70.0, notes=EVIL)
    writer = RunWriter(path, (*TOPICS, topic), TESTBED.text, run)
    for reading in driven(4.0, 1, skip=1.0):
        writer.reading(reading)
    writer.message(topic.name, 1, (1,))
    writer.flush()
    writer.reading(Reading(5, "sinkage_pot", 1.0, 5))
    writer.close()
    return path


@contextmanager
def speaking(path, report):
    """A socket on which somebody says what he likes to the first who connects."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(path))
    listener.listen()

    def answer():
        connection, _ = listener.accept()
        with connection:
            connection.sendall(json.dumps(report, ensure_ascii=False).encode() + b"\n")

    Thread(target=answer, daemon=True).start()
    with listener:
        yield


def evil_report():
    tick = dict.fromkeys(
        ("cohesion", "cohesion_sigma", "tan_phi", "tan_phi_sigma", "separability", "consistency"),
        1.0,
    )
    tick |= dict.fromkeys(("updates", "resets", "late", "duplicates", "invalid", "jumps"), EVIL)
    device = dict.fromkeys(("readings", "frames", "bad", "lost", "errors", "quarantined"), 1)
    device |= {"state": EVIL, "rate": 1.0, "reopened": 0, "last_error": EVIL}
    return {
        "pid": EVIL, "uptime": 1.0, "healthy": True, "hanging": EVIL, "real_time": EVIL,
        "configuration": EVIL, "status": EVIL, "flags": [EVIL], "channels": {EVIL: EVIL},
        "tick": tick, "devices": {EVIL: device},
        "loop": {"ticks": EVIL, "missed": EVIL}, "queue": {"queued": EVIL, "dropped": EVIL},
        "log": {"state": EVIL, "error": EVIL, "file": EVIL, "queued": 0, "dropped": 0, "files": 1},
    }  # fmt: skip


def test_escapes_are_shown_not_sent(tmp_path, figure):
    """Recordings, a report and a status socket that try to write to the reader's terminal."""
    path = evil_recording(tmp_path / "evil.mcap")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1  # a chunk that does not hold its checksum
    path.write_bytes(data)
    redo = {
        "redo": {"files": {EVIL: "0"}, "configuration": EVIL, "seed": 0, "versions": {EVIL: EVIL}},
        "verdict": EVIL,
        "hypotheses": [],
    }
    (tmp_path / "evil.json").write_text(json.dumps(redo))
    with_config = ("--config", packaged())
    said = {
        command: gritd(command, *arguments)
        for command, arguments in {
            "replay": (path,),
            "recover": (path,),
            "compare": (path, *with_config),
            "diagnose": (path, *with_config),
            "check-config": (tmp_path / EVIL.replace("\n", ""),),
        }.items()
    }
    said["redo"] = gritd("diagnose", "--redo", tmp_path / "evil.json")
    for form in ("status", "status --json", "status --prometheus", "monitor --once"):
        where = tmp_path / form.replace(" ", "")
        with speaking(where, evil_report()):
            said[form] = gritd(*form.split(), "--socket", where)
    sent = {name: CONTROL.findall(out + error) for name, (_, out, error) in said.items()}
    spoofed = [name for name, (_, out, error) in said.items() if "\nfake" in out + error]
    assert not any(sent.values()) and not spoofed, (sent, spoofed, said)
    assert [said[name][0] for name in ("replay", "recover")] == [3, 3]
    assert r"\x1b[2J" in said["status"][1] and r"\x1b[2J" in said["monitor --once"][1]
    assert json.loads(said["status --json"][1])["status"] == EVIL
    figure(ESCAPES, AS_PROCESSES, "outputs looked at", len(said))
    figure(ESCAPES, AS_PROCESSES, "control characters sent", sum(map(len, sent.values())), limit=0)


def refused(code, out, error, expected=(1, 2)):
    """Whether a command ended with one line and nothing else."""
    one_line = error.count("\n") == 1 and error.startswith("gritd: ") and "internal" not in error
    return code in expected and not out and one_line


def files_below(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_names_that_lead_elsewhere(tmp_path, figure):
    """A run's name on the command line and in the configuration, and a report that names files of
    its reader.
    """
    inside = tmp_path / "a" / "b"
    inside.mkdir(parents=True)
    text = TESTBED.text.replace("directory: runs", f"directory: {inside}")
    config = tmp_path / "c.yaml"
    config.write_text(text)
    before = files_below(tmp_path)
    names = ("../../evil", "/tmp/evil", "..", ".hidden", "a/b", "a\nb", "x" * 200)
    leaks = [
        name for name in names if not refused(*gritd("run", "--config", config, "--name", name))
    ]

    for name in names:
        config.write_text(f"{text}run: {{name: {json.dumps(name)}}}\n")
        leaks += [] if refused(*gritd("run", "--config", config)) else [name]

    secret, report = tmp_path / "secret", inside / "report.json"
    secret.write_bytes(b"secret")
    (inside / "link").symlink_to(secret)
    for name in (str(secret), "../../secret", "link"):
        redo = {"files": {name: "0" * 64}, "configuration": "", "seed": 0, "versions": {}}
        document = {"redo": redo, "verdict": "", "hypotheses": []}
        report.write_text(json.dumps(document))
        said = gritd("diagnose", "--redo", report)
        shown = hashlib.sha256(b"secret").hexdigest()[:8] in said[2]
        leaks += [name] if shown or not refused(*said) else []
    left = files_below(tmp_path) - before - {"secret", "a/b/report.json", "a/b/link"}
    assert left <= {"a/b/.gritd.lock"}, left
    figure(OUTSIDE, AS_PROCESSES, "names tried", 2 * len(names) + 3)
    figure(OUTSIDE, AS_PROCESSES, "not refused with one line", len(leaks), limit=0)


def test_what_lies_in_the_way(tmp_path, figure):
    """A lock that is a link, and pipes in place of files: nobody waits, nothing is lost."""
    logs, precious = tmp_path / "logs", tmp_path / "precious"
    logs.mkdir()
    precious.write_bytes(b"kept")
    (logs / ".gritd.lock").symlink_to(precious)
    config = tmp_path / "c.yaml"
    config.write_text(TESTBED.text.replace("directory: runs", f"directory: {logs}"))
    said = {"lock": gritd("run", "--config", config, timeout=30)}

    campaign = tmp_path / "campaigns" / "one"
    campaign.mkdir(parents=True)
    os.mkfifo(campaign / "run.mcap")
    (campaign / "c.yaml").write_text(TESTBED.text)
    one = ("diagnose", "--campaigns", campaign.parent, "--jobs", "1")
    said["campaign"] = gritd(*one, timeout=60)
    said |= {
        command: gritd(command, campaign / "run.mcap", *more, timeout=60)
        for command, more in {
            "replay": (), "recover": (), "compare": ("--config", config),
            "diagnose": ("--config", config),
        }.items()
    }  # fmt: skip
    os.mkfifo(tmp_path / ".x.mcap.new")
    said["draft"] = gritd("simulate", "--config", config, "-o", tmp_path / "x.mcap", timeout=60)

    code, out, error = said.pop("campaign")
    assert code == 1 and "one: not diagnosed: " in out and "no regular file" in out
    assert all(line.startswith("campaigns: ") for line in error.splitlines())  # a sign of life
    wrong = {name: each for name, each in said.items() if not refused(*each, expected=(1, 2, 3))}
    assert precious.read_bytes() == b"kept" and not wrong, wrong
    figure(OBSTACLES, AS_PROCESSES, "obstacles not refused with one line", len(wrong), limit=0)


WORKING = """
import sys, time
from pathlib import Path
from gritd.tools.cli.workers import workers
if __name__ == "__main__":
    with workers(2, None) as (pool, _):
        jobs = [pool.submit(Path.touch, Path(f"{sys.argv[1]}/{n}")) for n in range(2)]
        [job.result() for job in jobs]
        more = [pool.submit(time.sleep, 100.0) for n in range(2)]
        print("working", flush=True)
        more[0].result()
"""


def test_workers_end_with_a_killed_parent(tmp_path, seed, figure):
    script = tmp_path / "work.py"
    script.write_text(WORKING)
    parent = subprocess.Popen(
        [sys.executable, script, tmp_path],
        stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert parent.stdout.readline() == b"working\n"
    children = children_of(parent.pid)
    assert len(children) >= 2
    parent.kill()
    began = time.monotonic()
    parent.wait()
    until(lambda: not any(map(runs, children)))
    took = time.monotonic() - began
    assert took < 60.0  # they have work for longer
    level = "processes of diagnose --campaigns"
    figure(OBSTACLES, level, "workers end after their killed parent", took, "s", 1.0, real=True)


def children_of(pid):
    """Processes whose parent this is, by their ids."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = path.read_text().rpartition(")")[2].split()
            found += [int(path.parent.name)] if int(fields[1]) == pid else []
    return found


def runs(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_who_may_write_the_configuration_and_read_the_recordings(tmp_path, figure):
    """A configuration that anybody may write is warned of by the daemon, in its log and by
    check-config; one that only its owner may write is not.
    """
    modes = wrong = 0
    for readable, mode, writable in (("owner", 0o600, 0o600), ("group", 0o640, 0o666)):
        folder = tmp_path / readable
        folder.mkdir()
        with Wires(folder, logging={"readable_by": readable}) as wires:
            wires.config.chmod(writable)
            with DaemonProcess(wires.config) as daemon:
                daemon.ready()
                daemon.stop()
        modes += daemon.path().stat().st_mode & 0o777 != mode
        _, _, error = gritd("check-config", wires.config)
        lines = (daemon.text, "\n".join(log_lines(daemon.path())), error)
        warned = ["anybody may change it" in text for text in lines]
        wrong += sum(each != (writable == 0o666) for each in warned)
    figure(READABLE, WIRES, "recordings of another mode than configured", modes, limit=0)
    figure(READABLE, WIRES, "warnings missing or without reason, of 6 places", wrong, limit=0)


def test_a_scheduler_that_does_not_prove_who_it_is(tmp_path, figure):
    """What it answers would be unpickled, which runs what it likes: it is not even connected to."""
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "run.mcap").write_bytes(b"")
    (tmp_path / "a" / "rig.yaml").write_bytes(b"")
    with socket.create_server(("127.0.0.1", 0)) as hostile:
        hostile.settimeout(0.5)
        given = ("--scheduler", f"tcp://127.0.0.1:{hostile.getsockname()[1]}")
        commands = {
            "diagnose": ("--campaigns", tmp_path, *given),
            "prove": ("--cases", "1", "--output", tmp_path / "proof", *given),
        }
        said = {name: gritd(name, *more, timeout=600) for name, more in commands.items()}
        connections = 0
        with suppress(TimeoutError):
            while hostile.accept():
                connections += 1
    wrong = [name for name, end in said.items() if not refused(*end, expected=(2,))]
    assert not wrong and not (tmp_path / "proof").exists(), said
    figure(SCHEDULER, AS_PROCESSES, "connections to a scheduler over tcp://", connections, limit=0)
    figure(SCHEDULER, AS_PROCESSES, "not refused with one line", len(wrong), limit=0)
