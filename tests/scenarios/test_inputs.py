"""Arguments and files that nobody meant: one line, or done as asked."""

from __future__ import annotations

import os
import struct
import subprocess
import sys

import pytest

from gritd.drivers.build import used_devices
from gritd.drivers.wire_log import MAGIC, wire_path
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from tests.estimator.recording.samples import pieces
from tests.scenarios.commands import AS_PROCESSES, CONFIG, in_process
from tests.scenarios.conftest import slow
from tests.scenarios.hostile import shifted, watched
from tests.scenarios.rig import ROOT, TESTBED, driven

QUICK = True
REVERSED = "chunks in reverse order"
BYTES = "names and notes that are no UTF-8"
NESTED = "JSON nested 100,000 deep"
TIMES = "wire logs of impossible times"
COLUMNS = "table of 100,000 columns"


def answered(code, said):
    """Whether a command did as asked, or ended with one line that is no fault of its own."""
    wrong = [line for line in said if line.startswith("gritd: ")]
    ours = any("internal error" in line for line in said) or any("Traceback" in x for x in said)
    return code in (0, 1, 2, 3) and not ours and (code == 0 or len(wrong) <= 1)


def test_chunks_in_reverse_order(tmp_path, figure):
    """With and without the index that leads to them."""
    path = tmp_path / "a.mcap"
    writer = RunWriter(path, (), TESTBED.text, RunInfo("run"), chunk_size=20_000)
    for reading in driven(10.0, 1, skip=4.0):
        writer.reading(shifted(reading))
    writer.close()
    before, chunks, after = pieces(path)
    faults = []
    for end in (after, b""):
        path.write_bytes(before + b"".join(reversed(chunks)) + end)
        for command in (("replay", path), ("replay", path, "--verify"), ("compare", path, *CONFIG)):
            code, said = in_process(*command)
            faults += [] if answered(code, said) else [(command, code, said)]
    assert not faults, faults
    figure(REVERSED, "replay and compare", "internal errors", len(faults), limit=0)


def raw(*arguments, **environment):
    """A command whose arguments are bytes: exit code and lines."""
    done = subprocess.run(
        [sys.executable, "-m", "gritd", *arguments],
        cwd=ROOT, capture_output=True, timeout=120, check=False,
        env={**os.environ, **environment},
    )  # fmt: skip
    return done.returncode, (done.stdout + done.stderr).decode().splitlines()


NO_UTF_8 = (b"\xff\xfe", b"caf\xe9", b"\xed\xa0\x80", b"\xc2\x9b31m")  # the last: a C1 control


def test_text_that_is_no_utf_8(tmp_path, figure):
    check_text(tmp_path, figure, NO_UTF_8[:1], ("C",))


@pytest.mark.slow
def test_every_text_that_is_no_utf_8(tmp_path, figure):
    check_text(tmp_path, figure, NO_UTF_8, ("C", "C.UTF-8"))


def check_text(folder, figure, texts, locales):
    """Arguments and file names of any bytes, also where the system speaks ASCII."""
    config = folder / "c.yaml"
    config.write_text(TESTBED.text.replace("directory: runs", f"directory: {folder / 'logs'}"))
    wires = wire_logs(folder / "wires", 1_790_000_000 * 10**9)
    play = (b"run", b"--config", config, b"--from-tap", wires, b"--fast")
    place, faults, tried = os.fsencode(folder), [], 0
    for text in texts:
        path = place + b"/" + text + b".mcap"
        RunWriter(os.fsdecode(path), (), TESTBED.text, RunInfo("run")).close()
        commands = (
            (b"info", path),
            (b"recover", path, b"-o", path + b".out"),
            (*play, b"--notes", text, b"--operator", text),
            (*play, b"--name", text),
            (b"check-config", place + b"/" + text),
            (b"bed", b"new", text, b"--directory", place),
        )
        for command in commands:
            for locale in locales:
                code, said = raw(*command, LC_ALL=locale, PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")
                faults += [] if answered(code, said) else [(command, locale, code, said[-3:])]
                tried += 1
    assert not faults, faults
    figure(BYTES, AS_PROCESSES, "commands", tried)
    figure(BYTES, AS_PROCESSES, "internal errors", len(faults), limit=0)


def test_json_of_any_depth(tmp_path, figure):
    path = tmp_path / "earlier.json"
    path.write_text("[" * 100_000)
    given = (
        ("diagnose", tmp_path / "run.mcap", "--reference", path, *CONFIG),
        ("diagnose", "--redo", path),
        ("report", path),
    )
    faults = [(each, end) for each in given if not answered(*(end := in_process(*each)))]
    assert not faults, faults
    figure(NESTED, "diagnose and report", "internal errors", len(faults), limit=0)


def wire_logs(folder, received):
    """Wire logs that hold one reading for each device, received then [ns]."""
    folder.mkdir(exist_ok=True)
    for device in used_devices(TESTBED.settings):
        head = struct.pack("<qI", received, 4)
        wire_path(folder, device.name).write_bytes(MAGIC + (head + bytes(4)) * 2)
    return folder


def test_wire_logs_of_any_time(tmp_path, figure):
    config = tmp_path / "c.yaml"
    config.write_text(TESTBED.text.replace("directory: runs", f"directory: {tmp_path}"))
    faults = []
    for time in (0, -1, -(2**63), 2**63 - 1, 1, 2**31 * 10**9, 2**62):
        wires = wire_logs(tmp_path / "wires", time)
        code, said = in_process("run", "--config", config, "--from-tap", wires, "--fast")
        faults += [] if answered(code, said) and code else [(time, code, said)]
    assert not faults, faults
    figure(TIMES, "run --from-tap --fast", "internal errors", len(faults), limit=0)


@pytest.mark.parametrize("option", ["--map", slow("--guess")])
def test_a_table_of_many_columns(tmp_path, option, figure):
    """And one line of 150 kB: an error does not repeat it."""
    path, columns = tmp_path / "wide.csv", tmp_path / "map.yaml"
    names, row = (",".join(f"c{n}" for n in range(100_000)), ",".join(["1.5"] * 100_000))
    path.write_text("\n".join([names, *[row] * 3]) + "\n")
    columns.write_text("columns: {time: {channel: time, unit: s}}\n")

    given = (option, columns) if option == "--map" else (option,)
    done = watched("import", "csv", path, *given, "-o", tmp_path / "out")
    assert done.code in (0, 2, 3) and "internal error" not in done.error, done
    longest = max(map(len, done.error.splitlines()), default=0)
    figure(COLUMNS, AS_PROCESSES, f"processor time, {option}", done.seconds, "s", 10, real=True)
    figure(COLUMNS, AS_PROCESSES, f"memory, {option}", done.memory, "MB", 400)
    figure(COLUMNS, AS_PROCESSES, "characters of the longest error", longest, "", 400)
