"""What a file may cost the one who opens it: memory and time, whatever it holds."""

from __future__ import annotations

import gzip
import math
import os
import re
import struct
import warnings
from collections.abc import Iterator
from copy import deepcopy

import pytest
import yaml
from mcap.records import Metadata

from gritd.estimator.config.configuration import ConfigError, loads
from gritd.estimator.config.yamltree import dumped
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.mcapfile import MAGIC, record_bytes
from gritd.estimator.recording.metadata import RECOVERED, RUN, sealed
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools.commands import recover
from gritd.tools.commands.check_config import summary
from gritd.tools.dev.twenty.campaigns import SWEPT, HeldInRun, PlannedRun
from gritd.tools.importers.rigs.table import CONSTANTS, MEASURED
from tests.estimator.recording.samples import pieces
from tests.scenarios.commands import AS_PROCESSES, CONFIG, in_process
from tests.scenarios.hostile import bomb, honest, later, mcap, record, tiny_chunks, watched
from tests.scenarios.rig import TESTBED, driven

BOMB = "recording that unpacks to a thousand times its size"
MANY = "empty attachments, tiny chunks"
LATER = "last reading a day, fifty years later"
SPARSE = "sparse file of 9 GB, 4 GB of memory"
PACKED = "import of packed text"
MOVED = "chunks swapped or duplicated"
EMPTY = "file of 8 bytes"
NUMBERS = "metadata and configuration of impossible numbers"
ADDRESS = "300 and 500 MB of address space"
SLOWEST = "the slowest campaign of diagnose"


@pytest.mark.parametrize(
    ("command", "chunks"),
    [("replay", 40), ("recover", 8), ("recover", 40), ("compare", 40), ("diagnose", 40)],
)
def test_bomb_inside_the_limits_of_a_chunk(tmp_path, command, chunks, figure):
    path = tmp_path / "a.mcap"
    bomb(path, chunks)
    done = watched(command, path, *(() if command == "recover" else CONFIG))
    assert done.code == 3 and "unpacks to more than 50 times its size" in done.error + done.out
    assert "internal error" not in done.error
    figure(BOMB, AS_PROCESSES, "memory", done.memory, "MB", 400)
    figure(BOMB, AS_PROCESSES, "processor time", done.seconds, "s", 10, real=True)


@pytest.mark.slow
def test_the_campaign_that_a_diagnosis_takes_longest_for(tmp_path, figure):
    """Friction of the load axis follows the whole of every run; beside it a friction that does
    not.
    """
    seconds = {}
    for effects in (
        ("coulomb_friction.loss=0.15",),
        ("load_axis_friction.friction=3", "load_axis_friction.travel=0.0002"),
    ):
        acting = [each for effect in effects for each in ("--effect", effect)]
        runs = [_driven(tmp_path, load, acting) for load in (30, 45, 60, 75, 90, 105)]
        done = watched("diagnose", *runs, *CONFIG, "--jobs", 1)
        assert done.code == 0, done.error
        assert effects[0].partition(".")[0] in done.out
        figure(SLOWEST, AS_PROCESSES, "memory", done.memory, "MB", 600)
        seconds[effects] = done.seconds

    usual, slowest = seconds.values()
    figure(SLOWEST, AS_PROCESSES, "processor time over that of another", slowest / usual, "", 5)


def _driven(folder, load, acting):
    """A simulated run under a load [N] in which effects act."""
    schedule, run = folder / "schedule.yaml", folder / f"run-{load}.mcap"
    schedule.write_text(PlannedRun(float(load), (*SWEPT, HeldInRun(0.2, seconds=20.0))).schedule)
    where = ("--schedule", schedule, "--seed", load, "-o", run)
    run.unlink(missing_ok=True)
    code, said = in_process("simulate", *CONFIG, *where, *acting)
    assert code == 0, said
    return run


@pytest.mark.slow
def test_the_limit_can_be_raised(tmp_path):
    """By whoever trusts the file and has the memory."""
    path = tmp_path / "a.mcap"
    bomb(path, 2)
    done = watched("recover", path, GRITD_LIMITS="ratio=2000")
    assert done.code == 0 and int(re.search(r"saved (\d+)", done.out)[1]) > 1_000_000, done
    wrong = watched("recover", path, GRITD_LIMITS="rato=2000")
    assert wrong.code == 2 and wrong.one_line


@pytest.mark.slow
def test_records_that_cost_time_and_hold_nothing(tmp_path, figure):
    """30 MB of attachments, 140 MB of chunks with one reading each, and bare messages."""
    attachment = record(9, struct.pack("<QQIIQI", 0, 0, 0, 0, 0, 0))
    mcap(tmp_path / "attachments.mcap", attachment * (30_000_000 // len(attachment)))
    mcap(tmp_path / "bare.mcap", record(5, bytes(22)) * (45_000_000 // 31))
    tiny_chunks(tmp_path / "tiny.mcap", 140_000_000)
    for path in sorted(tmp_path.glob("*.mcap")):
        done = watched("recover", path)
        assert done.code == 3 and "the rest is not read" in done.error, done
        figure(MANY, AS_PROCESSES, "processor time", done.seconds, "s", 10, real=True)
        figure(MANY, AS_PROCESSES, "memory", done.memory, "MB", 400)
        path.unlink()


DAY = 86_400.0
GAPS = {"a day": DAY, "fifty years": 50 * 365.25 * DAY}


@pytest.mark.parametrize(
    ("command", "gap"),
    [
        ("replay", "a day"),
        *((c, "fifty years") for c in ("replay", "replay -o", "recover", "compare", "diagnose")),
    ],
)
def test_a_reading_much_later(tmp_path, command, gap, figure):
    """The gap takes neither time nor memory."""
    path, out = tmp_path / "a.mcap", tmp_path / "out.mcap"
    later(path, GAPS[gap])
    name, *output = command.split()
    given = () if name == "recover" else CONFIG
    done = watched(name, path, *given, *((output[0], out) if output else ()))
    assert done.code == 0, done
    figure(LATER, AS_PROCESSES, "memory", done.memory, "MB", 400)
    figure(
        LATER,
        AS_PROCESSES,
        "processor time",
        done.seconds,
        "s",
        10 if name != "diagnose" else 60,
        True,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "bound"),
    [
        (2_000_000_000, 1_000_000_000),
        pytest.param(9_000_000_000, 4_000_000_000, marks=pytest.mark.slow),
    ],
)
def test_a_sparse_file_is_hashed_piece_by_piece(tmp_path, size, bound, figure):
    """Almost all of it a hole, in less address space than it has bytes."""
    path = tmp_path / "a.mcap"
    honest(path, 20.0)
    os.truncate(path, size)
    done = watched("compare", path, *CONFIG, bound=bound)
    assert done.code == 0, done
    figure(SPARSE, AS_PROCESSES, "memory", done.memory, "MB", 400)
    figure(SPARSE, AS_PROCESSES, "processor time", done.seconds, "s", 60, real=True)


@pytest.mark.slow
def test_packed_text(tmp_path, figure):
    """2 MB of gzip in an import: rows without end, and a line without end."""
    for name, unpacked in (("rows", b"0.5," * 99 + b"0\n"), ("line", b"0" * 400)):
        folder = tmp_path / name
        folder.mkdir()
        columns = ",".join(CONSTANTS + MEASURED).encode() + b"\n"
        head = gzip.compress(columns if name == "rows" else b"")
        (folder / "bomb.csv.gz").write_bytes(head + gzip.compress(unpacked * 250_000) * 20)
        done = watched("import", "table", folder, "-o", tmp_path / "out")
        assert done.code == 3 and done.one_line, done
        figure(PACKED, AS_PROCESSES, "packed", (folder / "bomb.csv.gz").stat().st_size / 1e6, "MB")
        figure(PACKED, AS_PROCESSES, "memory", done.memory, "MB", 400)
        figure(PACKED, AS_PROCESSES, "processor time", done.seconds, "s", 10, real=True)


@pytest.mark.slow
def test_chunks_in_another_order(tmp_path, figure):
    """Every exchange of two chunks of a recording, and each chunk twice: `recover` says so."""
    path = tmp_path / "a.mcap"
    writer = RunWriter(path, (), TESTBED.text, RunInfo("run"), chunk_size=20_000)
    for reading in driven(7.0, 1, skip=4.0):
        writer.reading(reading)
    writer.close()
    before, chunks, after = pieces(path)
    cases = 0
    silent = []
    for i in range(len(chunks)):
        for j in range(i, len(chunks)):
            moved = list(chunks)
            if i == j:
                moved.insert(j, chunks[i])
            else:
                moved[i], moved[j] = moved[j], moved[i]
            (tmp_path / "b.mcap").write_bytes(before + b"".join(moved) + after)
            said = recovered(tmp_path / "b.mcap")
            silent += [] if said == 3 else [(i, j)]
            cases += 1
    assert recovered(path) == 0
    figure(MOVED, "recover", "exchanges and repetitions", cases)
    figure(MOVED, "recover", "not said, or exit code other than 3", len(silent), limit=0)


def recovered(path):
    """The exit code of recover, in this process."""
    target = path.with_suffix(".out")
    target.unlink(missing_ok=True)
    return recover.main([str(path), "-o", str(target)])


def test_a_file_that_holds_nothing(tmp_path, figure):
    """The first 8 bytes of a recording, and every other cut before its first message."""
    path, wrong = tmp_path / "a.mcap", 0
    honest(path, 1.0)
    data, short = path.read_bytes(), tmp_path / "short.mcap"
    for size in range(len(MAGIC), 60):
        short.write_bytes(data[:size])
        short.with_suffix(".out").unlink(missing_ok=True)
        code, said = in_process("recover", short, "-o", short.with_suffix(".out"))
        wrong += code != 3 or "nothing in it is lost" in " ".join(said)
    figure(EMPTY, "recover", "said that nothing is lost, of 52 cuts", wrong, limit=0)


WRONG = {
    RUN: {
        "pass_number": ("9" * 5000, "0", "-1", "1e3", "1.5", "two", "10001"),
        "start_position": ("nan", "inf", "1e300", "left"),
        "nominal_load": ("nan", "-70", "1e300", "heavy"),
        "part": ("-1", "nan", "9" * 30),
        "lost_before": ("-5", "abc", "9" * 40),
    },
    RECOVERED: {"lost": ("abc", "-3", "nan", "9" * 5000, "١٢")},
}


def test_metadata_of_impossible_numbers(tmp_path, figure):
    cases = [
        (name, key, value) for name in WRONG for key in WRONG[name] for value in WRONG[name][key]
    ]
    faults = []
    for number, (name, key, value) in enumerate(cases):
        path = tmp_path / f"{number}.mcap"
        with_metadata(path, name, {key: value})
        for command, more in (("replay", CONFIG), ("recover", ("-o", tmp_path / f"{number}.out"))):
            code, said = in_process(command, path, *more)
            lines = [line for line in said if key in line]
            named = len(lines) == 1 and code == 3 if name == RUN else code == 0
            faults += [] if named else [(command, key, value[:20], code, said[:3])]
        path.unlink()
    assert not faults, faults
    figure(NUMBERS, "replay and recover", "metadata values", len(cases))
    figure(NUMBERS, "replay and recover", "not said in one line", len(faults), limit=0)


def with_metadata(path, name, entries):
    """A second of readings, unclosed, with a metadata record before its own, its seal intact."""
    honest(path, 1.0)
    found = {**RunInfo("run", 70.0).entries(), **entries} if name == RUN else entries
    before, chunks, _ = pieces(path)
    header = len(MAGIC) + 9 + int.from_bytes(before[9:17], "little")
    more = record_bytes(Metadata(name=name, metadata=sealed(name, found)))
    path.write_bytes(before[:header] + more + before[header:] + b"".join(chunks))


EXTREMES = ("1.0e+300", "1.0e-300", "1.0e+12", "1.0e-12")


@pytest.mark.slow
def test_configured_numbers_of_any_size(figure):
    """Every number of a configuration, one at a time: refused in one line, or the filter lives."""
    check_extremes(figure, EXTREMES, lambda path: True)


def test_filter_settings_of_any_size(figure):
    check_extremes(figure, EXTREMES, lambda path: path[0] in ("filter", "rates"))


def check_extremes(figure, sizes, chosen):
    document = yaml.safe_load(TESTBED.text)
    places = [(path, text) for path, text in numbers(document) if chosen(path)]
    taken, faults = 0, []
    for path, text in places:
        for size in sizes:
            try:
                configuration = loads(dumped(changed(document, path, text, size)), "rig.yaml")
            except ConfigError as error:
                assert re.match(r"rig\.yaml:\d+: .+: found .+; expected .+", str(error))
                continue
            taken += 1
            try:
                summary(configuration.settings)
                filtered(configuration.settings)
            except Exception as error:
                faults.append((path, size, error))
    assert not faults, faults
    level = "configuration reader and pipeline"
    figure(NUMBERS, level, "numbers changed", len(places) * len(sizes))
    figure(NUMBERS, level, "of them accepted", taken)
    figure(NUMBERS, level, "that crash the filter", len(faults), limit=0)


def numbers(node, path=()) -> Iterator[tuple]:
    """Where a document has a number, with a unit or without."""
    if isinstance(node, dict):
        for key, value in node.items():
            yield from numbers(value, (*path, key))
    elif isinstance(node, list):
        for key, value in enumerate(node):
            yield from numbers(value, (*path, key))
    elif not isinstance(node, bool) and path[0] != "devices" and NUMBER.match(str(node)):
        yield path, node


NUMBER = re.compile(r"^[+-]?[\d.]+(?:e[+-]?\d+)?")


def changed(document, path, text, size):
    new = deepcopy(document)
    at = new
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = NUMBER.sub(size, text) if isinstance(text, str) else float(size)
    return new


def filtered(settings):
    """Three seconds of driving through the pipeline."""
    readings = driven(7.0, 1, skip=4.0)
    pipeline, taken = Pipeline(settings, "plain"), 0
    state = pipeline.start()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for tick in range(0, readings[-1].received, 4_000_000):
            first = taken
            while taken < len(readings) and readings[taken].received <= tick:
                taken += 1
            state, _ = pipeline.step(state, readings[first:taken], tick)


COMMANDS = ("replay", "recover", "compare", "diagnose", "simulate", "check-config", "reproduce")


@pytest.mark.slow
@pytest.mark.parametrize("size", [100, 300, 500])
def test_little_address_space(tmp_path, size, figure):
    """Every command does its work or ends with one line."""
    path = tmp_path / "run.mcap"
    honest(path, 20.0)
    arguments = {
        "replay": (path,), "recover": (path,), "compare": (path, *CONFIG),
        "diagnose": (path, *CONFIG, "--jobs", "2"), "simulate": ("-o", tmp_path / "x.mcap"),
        "check-config": (), "reproduce": (), "status": ("--socket", tmp_path / "none"),
        "import": ("table", tmp_path, "-o", tmp_path),
    }  # fmt: skip
    faults, worked = [], 0
    for command, given in arguments.items():
        done = watched(command, *given, bound=size * 1_000_000)
        worked += done.code == 0
        fine = done.code == 0 and not math.isnan(done.memory)
        faults += [] if fine or done.one_line else [(command, done)]
    assert not faults, faults
    figure(ADDRESS, AS_PROCESSES, f"commands that work in {size} MB, of {len(arguments)}", worked)
    figure(ADDRESS, AS_PROCESSES, "ended otherwise than with one line", len(faults), limit=0)
