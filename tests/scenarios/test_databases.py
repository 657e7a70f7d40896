"""Databases that cannot be, and recordings that end too early."""

from __future__ import annotations

import os
import shutil

from gritd.config import packaged
from gritd.drivers.dbc import MAX_DBC_BYTES
from tests.scenarios.commands import AS_PROCESSES, in_process
from tests.scenarios.hostile import honest, watched

IMPOSSIBLE = "DBC with impossible numbers, a pipe, a device"
NO_DBC = "a file that is no DBC"
CUT = "recover of a cut recording"
WRITABLE = "DBC that others may write"
LONGEST = 300  # characters of a line

WRONG = (  # of SinkagePot and MotorShunt, which are listened to
    ("SinkagePot: 8", "SinkagePot: 100000000"),
    ("SinkagePot: 8", "SinkagePot: 99999999999999999999"),
    ("Volts : 0|32@1- (1,0)", "Volts : 0|32@1- (0,0)"),
    ("Volts : 0|32@1- (1,0)", "Volts : 0|32@1- (1e999,0)"),
    ("Volts : 0|32@1- (1,0)", "Volts : 0|32@1- (1,-1e999)"),
    ("Volts : 0|32", "Volts : -5|32"),
    ("Volts : 0|32", "Volts : 0|1000000000"),
    ("Volts : 0|32", "Volts : 30|32"),
    ("BO_ 273 MotorShunt", "BO_ 272 MotorShunt"),
    ("BO_ 273 MotorShunt", "BO_ 273 SinkagePot"),
    ("Sequence", "Volts"),
)


def bench(folder):
    """The packaged configuration, and where its database is."""
    shutil.copy(packaged(), folder)
    return folder / "testbed.yaml", folder / "testbed.dbc"


def refusals(config, database, contents):
    """How many of these are not refused by `check-config` with one short line and code 2."""
    wrong = 0
    for content in contents:
        database.write_text(content)
        code, said = in_process("check-config", config)
        wrong += code != 2 or len(said) != 1 or len(said[0]) > LONGEST + len(str(config))
    return wrong


def test_a_database_that_cannot_be(tmp_path, figure):
    """One line at `check-config` already, whatever the numbers; little memory however large."""
    config, database = bench(tmp_path)
    good = packaged("testbed.dbc").read_text()
    assert all(old in good for old, _ in WRONG)
    contents = [good.replace(old, new) for old, new in WRONG]
    figure(IMPOSSIBLE, "check-config", "files", len(contents))
    wrong = refusals(config, database, contents)
    figure(IMPOSSIBLE, "check-config", "not refused with one line", wrong, limit=0)

    signal = ' SG_ S : 0|8@1+ (1,0) [0|0] "" X\n'
    room = MAX_DBC_BYTES - len(good) - 20
    for name, more in (("8 MiB of signals", signal), ("8 MiB of messages", "BO_ 7 A: 8 X\n")):
        database.write_text(good + "BO_ 6 B: 8 X\n" + more * (room // len(more)))
        done = watched("check-config", config)
        figure(IMPOSSIBLE, AS_PROCESSES, f"memory, {name}", done.memory, "MB", 100)

    database.unlink()
    os.mkfifo(database)
    done = watched("check-config", config)
    assert done.code == 2 and done.one_line, done
    figure(IMPOSSIBLE, AS_PROCESSES, "processor time, a pipe", done.seconds, "s", 5, real=True)


def test_what_is_no_database_is_not_quoted(tmp_path, figure):
    config, database = bench(tmp_path)
    secrets = (
        "root:$6$topsecret:19000:0:::\n",
        "BO_ topsecret\n",
        "topsecret",
        "SG_ topsecret : 1\n",
    )
    quoted = 0
    for secret in secrets:
        database.write_text(secret)
        code, said = in_process("check-config", config)
        quoted += code != 2 or "topsecret" in " ".join(said)
    figure(NO_DBC, "check-config", "quoted, or let pass", quoted, limit=0)


def test_a_database_that_anybody_may_change(tmp_path, figure):
    config, database = bench(tmp_path)
    shutil.copy(packaged("testbed.dbc"), database)
    silent = 0
    for mode in (0o644, 0o666):
        database.chmod(mode)
        code, said = in_process("check-config", config)
        warned = any("testbed.dbc: anybody may change it" in line for line in said)
        silent += code != 0 or warned != (mode == 0o666)
    figure(WRITABLE, "check-config", "warnings missing or without reason", silent, limit=0)


def test_a_recording_that_is_cut(tmp_path, figure):
    """At twenty places: `recover` says where it ends, and that the end is missing."""
    path = tmp_path / "a.mcap"
    honest(path, 10.0)
    data, silent = path.read_bytes(), 0
    for share in range(5, 100, 5):
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(data[: len(data) * share // 100])
        cut.with_suffix(".out").unlink(missing_ok=True)
        _, said = in_process("recover", cut, "-o", cut.with_suffix(".out"))
        reported = said[-1]
        silent += "it ends" not in reported or "what came later is not in it" not in reported
    figure(CUT, "recover", "of 19 cuts, the end not told", silent, limit=0)
