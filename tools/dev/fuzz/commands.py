"""Every file argument of every command with damaged files, and every text argument with strings
that nobody means. A command does as asked or ends with one line that is not of its own making.
"""

from __future__ import annotations

import io
import json
import os
import random
import re
import shutil
import signal
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path

from gritd.__main__ import main
from gritd.tools.cli.progress import Progress
from gritd.tools.dev.fuzz.case import Case, mutated
from gritd.tools.dev.fuzz.good import good_files, suffix

LONGEST = 450  # characters of a line, `gritd:` and `see … --help` included
PATIENCE = 60  # [s] after which a command hangs
NUMBER = re.compile(rb"\d+(?:\.\d+)?")
WILD = (b"0", b"-1", b"1e999", b"nan", b"99999999999999999999", b"1e-320", b"", b"inf")

# {bad}: the damaged file; {out}: a name that is free; what else stands in braces: a good file
FILES: tuple[tuple[str, str], ...] = (
    ("mcap", "replay {bad}"),
    ("mcap", "replay {bad} --verify"),
    ("mcap", "replay {mcap} {bad} --carry --config {yaml}"),
    ("yaml", "replay {mcap} --config {bad}"),
    ("mcap", "recover {bad} -o {out}.mcap"),
    ("mcap", "compare {bad} --config {yaml}"),
    ("yaml", "compare {mcap} --config {bad}"),
    ("mcap", "estimate {bad} {mcap} --config {yaml}"),
    ("yaml", "estimate {mcap} --config {bad}"),
    ("mcap", "report {bad} -o {out}.html"),
    ("mcap", "info {bad}"),
    ("mcap", "diff {mcap} {bad}"),
    ("mcap", "export {bad} --csv -o {out}"),
    ("mcap", "runs ."),
    ("mcap", "diagnose {bad} --config {yaml} --quick --jobs 1"),
    ("mcap", "diagnose {other} --reference {bad} --config {yaml} --quick --jobs 1"),
    ("json", "diagnose {other} --reference {bad} --config {yaml} --quick --jobs 1"),
    ("json", "diagnose --redo {bad} --data {here} --quick"),
    ("yaml", "check-config {bad}"),
    ("mcap", "check-config {yaml} --against {bad}"),
    ("yaml", "simulate --config {bad} --schedule {schedule} -o {out}.mcap"),
    ("schedule", "simulate --schedule {bad} -o {out}.mcap"),
    ("mcap", "simulate --motion {bad} -o {out}.mcap"),
    ("csv", "import csv {bad} --map {map} -o {out}"),
    ("csv", "import csv {bad} --guess"),
    ("map", "import csv {csv} --map {bad} -o {out}"),
    ("yaml", "import csv {csv} --map {map} --config {bad} -o {out}"),
    ("mcap", "import csv {bad} --guess"),
    ("npz", "import csv {bad} --guess"),
    ("table", "import table {bad} soils.csv -o {out}"),
    ("plates", "calibrate soil {bad} --map {press} --config {yaml}"),
    ("press", "calibrate soil {plates} --map {bad} --config {yaml}"),
    ("mcap", "calibrate pot --config {yaml} --known '0, 1 mm' --from {bad}"),
    ("yaml", "calibrate pot --config {bad} --known '0, 1 mm' --from {mcap}"),
    ("bed", "bed show --directory ."),
    ("wire", "run --config {yaml} --from-tap . --fast"),
    ("yaml", "run --config {bad} --from-tap . --fast"),
)
KINDS = tuple(dict.fromkeys(kind for kind, _ in FILES))
TEXTS: tuple[str, ...] = (
    "{text}",
    "run --config {yaml} --from-tap . --fast --name {text}",
    "run --config {yaml} --from-tap . --fast --notes {text}",
    "run --config {yaml} --from-tap . --fast --operator {text}",
    "run --config {yaml} --from-tap . --fast --load {text}",
    "run --config {yaml} --from-tap . --fast --pass {text}",
    "run --config {yaml} --from-tap . --fast --start {text}",
    "run --config {yaml} --from-tap . --fast --status {text}",
    "run --config {yaml} --from-tap {text} --fast",
    "simulate --schedule {schedule} --effect {text} -o {out}.mcap",
    "simulate --schedule {schedule} --effect coulomb_friction.loss={text} -o {out}.mcap",
    "simulate --schedule {schedule} --soil {text} -o {out}.mcap",
    "simulate --schedule {schedule} --soil cohesion={text} -o {out}.mcap",
    "simulate --schedule {schedule} --pass {text} -o {out}.mcap",
    "simulate --schedule {schedule} --notes {text} -o {out}.mcap",
    "simulate --schedule {schedule} --operator {text} -o {out}.mcap",
    "simulate --schedule {schedule} --seed {text} -o {out}.mcap",
    "simulate --schedule {schedule} -o {text}",
    "estimate {mcap} --config {yaml} --repeatability {text}",
    "estimate {mcap} --config {yaml} --repeatability cohesion={text}",
    "export {mcap} --csv --topic {text} -o {out}",
    "replay {mcap} --jobs {text}",
    "replay {mcap} --engine {text}",
    "replay {text}",
    "info {text}",
    "recover {text}",
    "check-config {text}",
    "effects {text}",
    "runs . --rig {text}",
    "runs . --status {text}",
    "runs . --text {text}",
    "runs . --load {text}",
    "runs . --sort {text}",
    "runs {text}",
    "bed new {text} --directory {out}",
    "calibrate pot --config {yaml} --known {text} --from {mcap}",
    "calibrate pot --config {yaml} --known '0, 1 mm' --known-sigma {text} --from {mcap}",
    "calibrate pot --config {yaml} --known '0, 1 mm' --serial {text} --from {mcap}",
    "calibrate pot --config {yaml} --known '0, 1 mm' --date {text} --from {mcap}",
    "calibrate pot --config {yaml} --known '0, 1 mm' --seconds {text} --from {mcap}",
    "calibrate soil {plates} --map {press} --config {yaml} --plate {text}",
    "calibrate {text} --config {yaml}",
    "diagnose {mcap} --config {yaml} --quick --jobs 1 --seed {text}",
    "diagnose {mcap} --config {yaml} --bed {text}",
    "diagnose --campaigns {text}",
    "diagnose --campaigns . --scheduler {text}",
    "prove --strata {text} --output {out}",
    "prove --worlds {text} --output {out}",
    "prove --cases {text} --strata nothing --output {out}",
    "status --socket {text}",
    "monitor --once --socket {text}",
    "import {text}",
    "import csv {text} --guess",
    "import table {table} soils.csv --speed {text} -o {out}",
    "import table {table} soils.csv --load-sigma {text} -o {out}",
    "import table {table} soils.csv --soil-strength {text} -o {out}",
    "reproduce --seed {text} --simulations nothing",
    "completion {text}",
    "init {text}",
)
STRINGS = (
    "", " ", "nan", "inf", "-inf", "1e999", "-1", "0", "1e-320", "9" * 400, "1" * 5000, "a" * 9000,
    "\udcff", "caf\udce9", "\x9b31m", "\x1b[2J", "\u202egnp", "a\nb", "a\rb", "\t", "é", "٣", "−1",
    "..", "../../x", "/dev/null", "/proc/self/mem", "{0}", "%s%n", "$HOME", "`id`", "'", '"',
    "[[[", "1 parsec", "1 N", "1 mm", "-1 mm", "1e300 Pa", "0 Pa", "=", "a=b", "a.b=c", "--", "-x",
    "tls://127.0.0.1:1", "tcp://x", "tls://", "😀" * 300,
)  # fmt: skip


def file_arguments(folder: Path) -> Case:
    """A command with one file that is damaged."""
    goods = good_files(folder / "good", KINDS)

    def case(rng: random.Random) -> str:
        kind, template = rng.choice(FILES)
        data = damaged(goods[kind].read_bytes(), kind, rng)
        with workplace(folder, goods) as place:
            bad = place / (goods[kind].name if "{bad}" not in template else f"bad.{suffix(kind)}")
            bad.write_bytes(data)
            return checked(words(template, goods, place, bad=str(bad)), template)

    return case


def text_arguments(folder: Path) -> Case:
    """A command with one text that is none."""
    goods = good_files(folder / "good", KINDS)

    def case(rng: random.Random) -> str:
        template, text = rng.choice(TEXTS), rng.choice(STRINGS)
        if rng.random() < 0.3:
            text = (
                mutated(os.fsencode(text) or b"x", rng, 3)
                .replace(b"\0", b"")
                .decode(errors="surrogateescape")
            )
        with workplace(folder, goods) as place:
            return checked(words(template, goods, place, text=text), f"{template} {text[:30]!r}")

    return case


# --- what is done ---


def words(template: str, goods: Mapping[str, Path], place: Path, **given: str) -> list[str]:
    """The arguments of a command."""
    known = {kind: str(path) for kind, path in goods.items()}
    known |= {"out": str(place / "out"), "here": str(goods["mcap"].parent), **given}
    quoted = re.findall(r"'[^']*'|\S+", template)
    return [re.sub(r"\{(\w+)\}", lambda m: known[m[1]], word.strip("'")) for word in quoted]


def checked(arguments: Sequence[str], shown: str) -> str:
    """What is wrong with the answer of a command; '' for nothing."""
    out, error = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(error), in_time():
        try:
            code: object = main(arguments)
        except SystemExit as end:  # of the parser of options
            code = end.code or 0
        except TimeoutError:
            return f"{shown}: hangs"

    said = [line for line in error.getvalue().splitlines() if line.startswith("gritd: ")]
    lines = [line for line in said if not line.startswith("gritd: note: ")]
    if code not in (0, 1, 2, 3) or "internal error" in error.getvalue() or len(lines) > 1:
        return f"{shown}: code {code}: {error.getvalue()[-300:]}"
    if code == 2 and not lines:
        return f"{shown}: code 2 without a word"
    longest = max(map(len, lines), default=0)
    return f"{shown}: a line of {longest} characters" if longest > LONGEST else ""


@contextmanager
def in_time() -> Iterator[None]:
    """Raises TimeoutError in what takes longer than PATIENCE."""

    def late(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(PATIENCE)
    shown, Progress.shown = Progress.shown, False
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        Progress.shown = shown


@contextmanager
def workplace(folder: Path, goods: Mapping[str, Path]) -> Iterator[Path]:
    """A folder of its own to work in, with the wire logs and the bed of the good files."""
    place = folder / "case"
    place.mkdir()
    beside = goods["wire"].parent
    for path in (*beside.glob("*.wire"), beside / "testbed.dbc", beside / "soils.csv"):
        shutil.copy(path, place)
    try:
        with chdir(place):
            yield place
    finally:
        shutil.rmtree(place, ignore_errors=True)


# --- what is damaged ---


def damaged(data: bytes, kind: str, rng: random.Random) -> bytes:
    """Bytes changed at random, numbers that cannot be, a cut, nesting, or a bed sealed anew."""
    change = rng.randrange(6)
    if change == 0:
        return data[: rng.randrange(len(data) + 1)]
    if change == 1 and kind in ("json", "bed", "yaml", "schedule", "map"):
        at = rng.randrange(len(data) + 1)
        return data[:at] + b"[" * rng.choice((1, 50, 100_000)) + data[at:]
    if change <= 3 and kind not in ("mcap", "npz", "wire"):
        return resealed(_wild(data, rng), kind)
    if change == 4 and kind == "mcap":
        return _moved(data, rng)
    return mutated(data, rng, 4)


def _wild(text: bytes, rng: random.Random) -> bytes:
    found = list(NUMBER.finditer(text))
    places = {match.start() for match in rng.sample(found, min(2, len(found)))}
    return NUMBER.sub(lambda m: rng.choice(WILD) if m.start() in places else m[0], text)


def resealed(text: bytes, kind: str) -> bytes:
    """A bed file with the checksum that its other values ask for, where it still is JSON."""
    if kind == "bed":
        with suppress(ValueError):
            plain = json.loads(text)
            plain.pop("crc32", None)
            return json.dumps({**plain, "crc32": zlib.crc32(json.dumps(plain).encode())}).encode()
    return text


def _moved(data: bytes, rng: random.Random) -> bytes:
    """Records of a recording left out, repeated, or in another order."""
    records, at = [], 8
    while at + 9 <= len(data) - 8:
        end = at + 9 + struct.unpack_from("<Q", data, at + 1)[0]
        records.append(data[at:end])
        at = end
    first, second = (rng.randrange(1, len(records)) for _ in range(2))
    match rng.randrange(3):
        case 0:
            records[first], records[second] = records[second], records[first]
        case 1:
            records.insert(first, records[second])
        case _:
            del records[first]
    return data[:8] + b"".join(records) + data[-8:]
