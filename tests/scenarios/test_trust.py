"""What comes from outside and wants more than to be read: escapes, names, other people's files."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import asdict
from threading import Thread

import pytest

from gritd.config import packaged
from gritd.estimator.daemon.daemon import TOPICS
from gritd.estimator.messages.readings import Reading
from gritd.estimator.recording.cdr import Topic
from gritd.estimator.recording.run import RunInfo, RunWriter
from tests.scenarios.rig import ROOT, TESTBED, driven

QUICK = True
ESCAPES = "terminal escapes in names"

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
    level = "the commands as processes"
    figure(ESCAPES, level, "outputs looked at", len(said))
    figure(ESCAPES, level, "control characters sent", sum(map(len, sent.values())), limit=0)
