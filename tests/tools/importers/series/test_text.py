"""The same table, however a logger or a spreadsheet writes it: read, or refused with one line."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile
from collections.abc import Callable, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from gritd.tools.cli.command import CommandError
from gritd.tools.importers.series import csv_text
from gritd.tools.importers.series.columns import SeriesTable
from gritd.tools.importers.series.mapping import Mapped
from gritd.tools.importers.series.stamps import TimeColumn

N = 120
TIMES = np.arange(N) * 0.02
SPEEDS = 60.0 + 0.125 * (np.arange(N) % 7)
WANTED = {
    "t": Mapped("time", "s"),
    "rpm": Mapped("wheel_speed", "rpm"),
    "v": Mapped("carriage_speed", "mm/s"),
}
ROWS = [(f"{TIMES[at]:.2f}", f"{7 * at}", f"{SPEEDS[at]}") for at in range(N)]


def text(
    separator: str = ",",
    header: str | None = "t,rpm,v",
    rows: Sequence[Sequence[str]] = ROWS,
    end: str = "\n",
) -> str:
    lines = [] if header is None else [header.replace(",", separator)]
    return end.join([*lines, *(separator.join(row) for row in rows)]) + end


def changed(at: int, *row: str) -> list[Sequence[str]]:
    """The rows with another in the place of one."""
    return [*ROWS[:at], row, *ROWS[at + 1 :]]


def comma(row: Sequence[str]) -> list[str]:
    return [cell.replace(".", ",") for cell in row]


def table(folder: Path, content: str | bytes, wanted: dict[str, Mapped] = WANTED) -> SeriesTable:
    data = content.encode() if isinstance(content, str) else content
    (folder / "run.csv").write_bytes(data)
    return csv_text.read(folder / "run.csv", wanted)


def check(found: SeriesTable, gone: Sequence[int] = ()) -> None:
    """The table is that of ROWS, without some."""
    time, rpm, speed = found.columns.values()
    kept = np.delete(np.arange(N), gone)
    np.testing.assert_allclose(time.numbers, TIMES[kept])
    np.testing.assert_array_equal(rpm.numbers, 7.0 * kept)
    np.testing.assert_array_equal(speed.numbers, SPEEDS[kept])
    assert time.instants is not None and rpm.resolution == 1.0


QUOTED = [(f'"{t}"', rpm, v, '"a, ""b"";\tc\nd"') for t, rpm, v in ROWS]
DIALECTS = {
    "semicolons": text(";"),
    "tabs": text("\t"),
    "bars": text("|"),
    "a spreadsheet's word on its separator": "sep=;\n" + text(";"),
    "blanks": text(" "),
    "columns of one width": "".join(
        "".join(f"{cell:>12}" for cell in row) + "\n" for row in [("t", "rpm", "v"), *ROWS]
    ),
    "blanks beside separators": text(" ; "),
    "decimal commas and semicolons": text(";", rows=[comma(row) for row in ROWS]),
    "decimal commas and tabs": text("\t", rows=[comma(row) for row in ROWS]),
    "decimal commas and blanks": text(" ", rows=[comma(row) for row in ROWS]),
    "numpy.savetxt": "# " + text(),
    "comments above": "# 2026, wheel 3\n# a,b,c,d\n\n# " + text(" "),
    "MATLAB's comments": "% " + text("\t"),
    "units": text(rows=[("s", "1/min", "mm/s"), *ROWS]),
    "units in brackets": text(";", rows=[("[s]", "[1/min]", "[mm/s]"), *ROWS]),
    "a preamble": "Test,Wheel 3\nLoad [N],50\nRate,50,Hz\nOperator;X\n\n" + text(),
    "a long preamble": "".join(f"line {n}: setting, {n}\n" for n in range(3000)) + text(),
    "names, units and kinds": '"TOA5","name","CR1000","1"\n"t","rpm","v"\n"s","rpm","mm/s"\n'
    + '"Smp","Smp","Smp"\n'
    + text(header=None),
    "quotes": text(header='"t","rpm","v","a note,\nfree"', rows=QUOTED),
    "a quote that does not end": text(header="t,rpm,v,note", rows=changed(9, *ROWS[9], '5" pipe')),
    "more columns": text(header="t,x,rpm,v", rows=[(r[0], "OK", *r[1:]) for r in ROWS]),
    "words and numbers in a column": text(
        header="t,rpm,v,state", rows=[(*r, "0" if r[0] != "0.20" else "E1") for r in ROWS]
    ),
    "a name twice, with the same values": text(header="t,rpm,v,t", rows=[(*r, r[0]) for r in ROWS]),
    "a name twice that is not used": text(
        header="t,x,rpm,v,x", rows=[(r[0], "1", *r[1:], "2") for r in ROWS]
    ),
    "an index without a name": text(header=",t,rpm,v", rows=[("7", *r) for r in ROWS]),
    "names of rows": text(" ", header="t,rpm,v", rows=[('"7"', *r) for r in ROWS]),
    "decimal commas in quotes": text(rows=[[f'"{cell}"' for cell in comma(row)] for row in ROWS]),
    "separators at the end": text(header="t,rpm,v,,", rows=[(*r, "", "") for r in ROWS]),
    "separators at the end of rows": text(rows=[(*r, "") for r in ROWS]),
    "ends of lines of Windows": text(end="\r\n"),
    "ends of lines of old Macintoshes": text(end="\r"),
    "ends of lines spoilt on the way": text(end="\r\r\n"),
    "no end of the last line": text().rstrip(),
    "an end of file of DOS": text() + "\x1a",
    "a minus of a spreadsheet, and Fortran's exponent": text(
        rows=[(f"{r[0]}D+00", r[1], r[2] + "e0") for r in ROWS]
    ),
}


@pytest.mark.parametrize("kind", DIALECTS)
def test_the_ways_to_write_a_table(tmp_path: Path, kind: str) -> None:
    check(table(tmp_path, DIALECTS[kind]))


@pytest.mark.parametrize("names", [("1", "2", "3"), ("column 1", "column 2", "column 3")])
def test_without_a_header_columns_have_numbers(tmp_path: Path, names: tuple[str, ...]) -> None:
    wanted = dict(zip(names, WANTED.values(), strict=True))
    check(table(tmp_path, text(header=None), wanted))
    found = csv_text.read(tmp_path / "run.csv")
    assert list(found.columns) == ["column 1", "column 2", "column 3"]


def test_a_column_may_be_called_by_its_number(tmp_path: Path) -> None:
    twice = text(header="t,rpm,v,t", rows=[("9", *r[1:], r[0]) for r in ROWS])
    with pytest.raises(CommandError, match=r"'t' twice, with other values; .* 'column 4'"):
        table(tmp_path, twice)
    columns = ("column 4", "rpm", "v")
    check(table(tmp_path, twice, dict(zip(columns, WANTED.values(), strict=True))))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"])
def test_encodings(tmp_path: Path, encoding: str) -> None:
    size = text(header="t,rpm,v,Größe", rows=[(*r, "µ") for r in ROWS])
    found = table(tmp_path, size.encode(encoding), WANTED | {"Größe": Mapped("run")})
    assert found.columns.pop("Größe").words == ["µ"] * N  # type: ignore[attr-defined]
    check(found)


PACKERS: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "bz2": lambda data: bz2.compress(data[:9000]) + bz2.compress(data[9000:]),
    "xz": lzma.compress,
    "zst": lambda data: zstandard.compress(data[:1000]) + zstandard.compress(data[1000:]),
}


@pytest.mark.parametrize("kind", PACKERS)
def test_a_packed_file_is_known_by_how_it_begins(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(1)
    note = [(*r, rng.bytes(3000).hex()) for r in ROWS]
    packed = PACKERS[kind](text(header="t,rpm,v,note", rows=note).encode())
    check(table(tmp_path, packed))

    cut = table(tmp_path, packed[: -len(packed) // 3])
    check(cut, range(cut.rows, N))
    assert 0 < cut.rows < N and any("packed" in n or "ompressed" in n for n in cut.notes)


def test_an_archive_of_one_file(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "run.csv", "w") as archive:
        archive.writestr("folder/run.csv", text())
    check(csv_text.read(tmp_path / "run.csv", WANTED))
    with zipfile.ZipFile(tmp_path / "run.csv", "a") as archive:
        archive.writestr("folder/other.csv", text())
    with pytest.raises(CommandError, match="2 files"):
        csv_text.read(tmp_path / "run.csv", WANTED)


LEFT_OUT = {
    "half a row": (text()[:-8], [119], "row 121"),
    "half a number": (text()[:-4], [119], "row 121"),
    "zero bytes in place of the last row": (text()[:-9].encode() + b"\0" * 5000, [119], "row 121"),
    "zero bytes at the end": (text().encode() + b"\0" * 5000, [], "row 122"),
    "zero bytes within": (text().replace("0.20,", "0.\0\0\0\0,"), [10], "row 12"),
    "too few fields": (text(rows=changed(20, "0.40", "1")), [20], "row 22"),
    "too many fields": (text(rows=changed(20, *ROWS[20], "1", "2")), [20], "row 22"),
    "the header again": (text(rows=[*ROWS[:50], ("t", "rpm", "v"), *ROWS[50:]]), [], "row 52"),
    "the header of another log": (
        text(rows=[*ROWS[:50], ("x", "y", "z"), *ROWS[50:]]),
        [],
        "row 52",
    ),
    "a remark": (text(rows=[*ROWS[:50], ("# stopped", " operator", ""), *ROWS[50:]]), [], "row 52"),
    "a field without end": (
        text(header="t,rpm,v,x", rows=changed(5, *ROWS[5], '"' + "x" * 150_000 + '"')),
        [5],
        "row 7",
    ),
}


@pytest.mark.parametrize("kind", LEFT_OUT)
def test_what_is_no_whole_row_is_left_out_and_told(tmp_path: Path, kind: str) -> None:
    content, gone, reported = LEFT_OUT[kind]
    found = table(tmp_path, content)
    check(found, gone)
    (note,) = found.notes
    assert f"{reported}:" in note and len(note) < 200


def test_a_gap_is_a_gap(tmp_path: Path) -> None:
    words = "|NaN|-nan|#N/A|#DIV/0!|#NV|1.#IND|-1.#IND00|1.#QNAN|-nan(ind)|NULL|-|inf"
    gaps = words.split("|")
    rows = [(t, rpm, gaps[at] if at < len(gaps) else v) for at, (t, rpm, v) in enumerate(ROWS)]
    for separator in (",", "\t"):
        found = table(tmp_path, text(separator, rows=rows)).columns["v"].numbers
        assert np.all(np.isnan(found[: len(gaps)]))
        np.testing.assert_array_equal(found[len(gaps) :], SPEEDS[len(gaps) :])


def odd(*row: str, separator: str = ",") -> str:
    return text(separator, rows=changed(20, *row))


REFUSED: dict[str, tuple[str | bytes, str]] = {
    "nothing": ("", "found nothing"),
    "prose": ("It was, as we know, a day.\nNothing here; or was it.\n" * 9, "found no"),
    "one column": ("x\n" + "1\n" * 50, "no table"),
    "a header alone": ("t,rpm,v\n", "no rows of numbers"),
    "a word in place of a number": (odd("0.40", "1", "ERR"), "row 22: v: found 'ERR'"),
    "1,234.5": (odd("0.40", "1", "1,234.5", separator=";"), "row 22: v"),
    "thousands in quotes": (odd("0.40", '"1,234"', "1"), "row 22: rpm: found '1,234'"),
    "1_000": (odd("0.40", "1_000", "1"), "row 22: rpm"),
    "a long word": (odd("0.40", "1", "x" * 150_000), "row 22: v: found 'xxx"),
    "a number beyond any": (odd("0.40", "1", "1e16"), "row 22: v"),
    "a word in place of a time": (odd("noon", "1", "1"), "row 22: t: found 'noon'"),
    "decimal commas beside commas": (text(rows=[comma(row) for row in ROWS]), "header of 3"),
    "rows that differ": (
        text(rows=[r if at % 9 < 4 else (r[0], "7") for at, r in enumerate(ROWS)]),
        "found no",
    ),
    "bytes that are no text": (bytes(range(256)) * 99, "no text"),
    "a line without end": ("t,rpm,v\n" + "1" * 17_000_000, "a line of more than"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_read_is_one_line(tmp_path: Path, kind: str) -> None:
    content, reported = REFUSED[kind]
    with pytest.raises(CommandError) as error:
        table(tmp_path, content)
    said = str(error.value)
    assert reported in said and said.startswith(f"{tmp_path / 'run.csv'}: ")
    assert "\n" not in said and len(said) - len(str(tmp_path)) < 300


def test_a_hundred_thousand_columns_cost_what_is_used_of_them(tmp_path: Path) -> None:
    more = ",".join(["1.25"] * 100_000)
    names = ",".join(f"c{n}" for n in range(100_000))
    found = table(tmp_path, text(header=f"t,rpm,v,{names}", rows=[(*r, more) for r in ROWS[:20]]))
    assert list(found.columns) == ["t", "rpm", "v"] and found.rows == 20


def test_more_than_can_be_kept_is_told_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GRITD_LIMITS", "series=300")
    with pytest.raises(CommandError, match="more than 300 values in 3 columns; GRITD_LIMITS="):
        table(tmp_path, text())


def test_blocks_make_no_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A row that begins in one and ends in the next, and the numbers of rows behind it."""
    from gritd.tools.importers.series import text_file

    rows = [(*r, '"two\nlines"' if at % 9 == 0 else "") for at, r in enumerate(ROWS)]
    rows[100] = ("2.00", "1")
    content = text(header="t,rpm,v,note", rows=rows)
    whole = table(tmp_path, content)
    monkeypatch.setattr(text_file, "BLOCK", 100)
    blocks = table(tmp_path, content)
    check(blocks, [100])
    assert blocks.notes == whole.notes and np.array_equal(blocks.lines, whole.lines)  # type: ignore[arg-type]
    assert f"row {content[: content.index('2.00,1')].count(chr(10)) + 1}:" in whole.notes[0]


numbers = st.floats(-1e12, 1e12, allow_nan=False)


@given(
    rows=st.lists(st.tuples(numbers, numbers | st.none(), numbers), min_size=3, max_size=9),
    form=st.sampled_from([",", ";", "\t", " ", ";,", "\t,", " ,"]),
    places=st.sampled_from(["r", ".6f", ".3e", "g"]),
)
def test_numbers_come_back(
    tmp_path_factory: pytest.TempPathFactory,
    rows: list[tuple[float, float | None, float]],
    form: str,
    places: str,
) -> None:
    """Of any separator, with decimal points or commas, with gaps."""

    def shown(value: float | None) -> str:
        if value is None:
            return "nan"
        word = repr(value) if places == "r" else format(value, places)
        return word.replace(".", ",") if form[1:] else word

    words = [[shown(value) for value in row] for row in rows]
    wanted = {name: Mapped("sinkage", "m") for name in "abc"}
    folder = tmp_path_factory.mktemp("numbers")
    found = table(folder, text(form[0], "a,b,c", words), wanted)
    made = np.array([[float(word.replace(",", ".")) for word in row] for row in words])
    np.testing.assert_array_equal(np.transpose([c.numbers for c in found.columns.values()]), made)


@given(st.binary(max_size=400), st.booleans())
def test_any_bytes_are_a_table_or_one_line(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, behind: bool
) -> None:
    folder = tmp_path_factory.mktemp("bytes")
    try:
        table(folder, text().encode()[: 500 if behind else 0] + data)
    except CommandError as error:
        assert "\n" not in str(error) and len(str(error)) - len(str(folder)) < 300


# --- the quick way is the other way, quicker ---


@given(
    st.lists(st.decimals(-(10**10), 10**10, places=9), min_size=1, max_size=20),
    st.sampled_from(["s", "ms", "us", "ns", "h"]),
)
def test_numbers_that_are_times_become_what_their_words_do(
    given_: list[Decimal], unit: str
) -> None:
    words = [f"{number:f}" for number in given_]
    column = TimeColumn(Mapped("time", unit))
    quick = column.plain(np.array(list(map(float, words))))
    assert quick is None or quick.tolist() == column.read(words).tolist()


def test_blanks_within_fields_between_tabs(tmp_path: Path) -> None:
    """A date and its time are one field, and a gap is one too."""
    rows = [(*row, "26.11.2026 14:03:05", "", "") for row in ROWS]
    check(table(tmp_path, text("\t", "t,rpm,v,since,no,nothing", rows)))


def test_rows_that_lack_a_column_of_the_map(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="fewer than 3 fields"):
        table(tmp_path, text(rows=[row[:2] for row in ROWS]))
