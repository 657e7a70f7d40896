"""Tables as laboratories write them, and what a user is reported of those that cannot be read."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import DAMAGED, CommandError
from gritd.tools.commands.import_rig import main
from gritd.tools.importers.series import csv_text
from gritd.tools.importers.series.noise import scatter

MAP = """
columns:
  t: {channel: time, unit: s}
  rpm: {channel: wheel_speed, unit: rpm}
  v: {channel: carriage_speed, unit: mm/s}
  M: {channel: torque, unit: N*m}
wheel: {radius: 72 mm, width: 71 mm}
load: 50 N
"""


def table(folder: Path, name: str = "run.csv", seconds: float = 5.0) -> Path:
    """A wheel at 10 rpm and a carriage at 60 mm/s, at 50 Hz, and a torque that scatters."""
    rng, t = np.random.default_rng(1), np.arange(0.0, seconds, 0.02)
    rows = [f"{x:.2f},10.0,60.0,{3.0 + 0.1 * rng.standard_normal():.4f}" for x in t]
    (folder / name).write_text("\n".join(["t,rpm,v,M", *rows]) + "\n")
    return folder / name


def imported(folder: Path, *files: Path, text: str = MAP) -> Path:
    (folder / "map.yaml").write_text(text)
    output = folder / "out"
    named = [*map(str, files), "--map", str(folder / "map.yaml"), "-o", str(output)]
    assert main(["csv", *named]) == 0
    return output


def complaint(code: int, *arguments: object) -> str:
    with pytest.raises(CommandError) as error:
        main(["csv", *map(str, arguments)])
    assert error.value.code == code and "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ("encoding", "first"),
    [("utf-8-sig", "rpm"), ("utf-16", "rpm"), ("cp1252", "Größe [°]"), ("utf-8", "Größe [°]")],
)
def test_a_text_of_any_usual_encoding(tmp_path: Path, encoding: str, first: str) -> None:
    """Spreadsheets write "Unicode" in UTF-16 with a mark, older programs one byte a letter."""
    text = table(tmp_path).read_text().replace("rpm", first, 1)
    (tmp_path / "other.csv").write_bytes(text.encode(encoding))
    found = csv_text.read(tmp_path / "other.csv")
    assert list(found.columns) == ["t", first, "v", "M"]
    assert found.rows == 250 and found.columns["v"].numbers[-1] == 60.0


def test_empty_columns_and_separators_at_the_end_hold_nothing(tmp_path: Path) -> None:
    lines = table(tmp_path).read_text().splitlines()
    (tmp_path / "named.csv").write_text("\n".join(f"{line},," for line in lines))
    (tmp_path / "rows.csv").write_text("\n".join([lines[0], *(f"{line}," for line in lines[1:])]))
    for name in ("named.csv", "rows.csv"):
        assert list(csv_text.read(tmp_path / name).columns) == ["t", "rpm", "v", "M"]

    index = ["," + lines[0], *(f"{number},{line}" for number, line in enumerate(lines[1:]))]
    (tmp_path / "pandas.csv").write_text("\n".join(index))
    assert list(csv_text.read(tmp_path / "pandas.csv").columns) == [
        "column 1",
        "t",
        "rpm",
        "v",
        "M",
    ]


def test_rows_written_twice_count_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    header, *rows = table(tmp_path).read_text().splitlines()
    twice = [line for row in rows for line in (row, row)]
    (tmp_path / "run.csv").write_text("\n".join([header, *twice]))
    output = imported(tmp_path, tmp_path / "run.csv")
    assert len(read(output / "run.mcap").arrays("/raw/wheel_encoder")) == len(rows)
    assert f"run: {len(rows)} rows that repeat the row before" in capsys.readouterr().out

    other = [row + "1" for row in rows]  # at the same times
    mixed = [line for pair in zip(rows, other, strict=True) for line in pair]
    (tmp_path / "run.csv").write_text("\n".join([header, *mixed]))
    said = complaint(DAMAGED, tmp_path / "run.csv", "--map", tmp_path / "map.yaml", "-o", tmp_path)
    assert "250 of 500 rows" in said and "row 3" in said and "rate:" in said

    text = MAP + "rate: 100 Hz\n"  # says when they were taken
    output = imported(tmp_path, tmp_path / "run.csv", text=text)
    stamps = read(output / "run.mcap").arrays("/raw/wheel_encoder")["stamp"]
    assert len(stamps) == 500 and set(np.diff(stamps)) == {10_000_000}


@pytest.mark.parametrize(
    ("broken", "left_out"),
    [
        ({22: ("0.40", "0.38")}, "row 22"),  # the same stamp, other values
        ({22: ("0.40", "0.10"), 23: ("0.42", "0.12")}, "rows 22, 23"),  # set back
        ({22: ("0.40", "0.00")}, "row 22"),
        ({22: ("0.40", "4000.00")}, "row 22"),  # one odd stamp ahead
        ({22: ("0.40", "")}, "row 22"),
        ({22: ("0.40", "-nan"), 23: ("0.42", "#N/A")}, "rows 22, 23"),
    ],
)
def test_a_row_whose_time_does_not_rise_is_left_out_and_told(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    broken: dict[int, tuple[str, str]],
    left_out: str,
) -> None:
    lines = table(tmp_path).read_text().splitlines()
    for number, (old, new) in broken.items():
        old_row = lines[number - 1]
        assert old_row.startswith(old + ",")
        lines[number - 1] = new + old_row.removeprefix(old).replace("60.0", "60.1")
    (tmp_path / "run.csv").write_text("\n".join(lines))

    output = imported(tmp_path, tmp_path / "run.csv")
    stamps = read(output / "run.mcap").arrays("/raw/wheel_encoder")["stamp"]
    assert len(stamps) == 250 - len(broken) and stamps[-1] - stamps[0] == 4_980_000_000
    assert f"{left_out}:" in capsys.readouterr().out


def test_a_time_that_begins_again_begins_a_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A logger that was started twice into one file, with another header in between."""
    header, *rows = table(tmp_path).read_text().splitlines()
    (tmp_path / "run.csv").write_text("\n".join([header, *rows[:100], *rows, *rows[:3]]))
    text = MAP.replace("load: 50 N", "runs: {run.csv: {load: 40 N}}")
    output = imported(tmp_path, tmp_path / "run.csv", text=text)
    found = {p.stem: read(p) for p in output.glob("*.mcap")}
    assert {name: r.counts["/raw/wheel_encoder"] for name, r in found.items()} == {
        "run-1": 100,
        "run-2": 250,
    }
    assert all(recording.run.nominal_load == 40.0 for recording in found.values())
    said = capsys.readouterr().out
    assert "rows 352, 353, 354" in said and "row 102" in said


def stamps_of(folder: Path, times: list[str], time: str) -> list[int]:
    """Of the first encoder, with these times and this line of the map for them."""
    header, *rows = table(folder).read_text().splitlines()
    body = [f"{t},{row.partition(',')[2]}" for t, row in zip(times, rows, strict=False)]
    (folder / "run.csv").write_text("\n".join([header, *body]))
    output = imported(
        folder, folder / "run.csv", text=MAP.replace("{channel: time, unit: s}", time)
    )
    found: list[int] = read(output / "run.mcap").arrays("/raw/wheel_encoder")["stamp"].tolist()
    return found


@pytest.mark.parametrize(
    ("unit", "epoch", "first"),
    [("s", "1904-01-01", "3878546585.00"), ("d", "1899-12-30", "46352.5854747685185")],
)
def test_a_time_counts_from_the_day_that_the_map_states(
    tmp_path: Path, unit: str, epoch: str, first: str
) -> None:
    """As LabVIEW and spreadsheets count."""
    per_row = Decimal("0.02") / (1 if unit == "s" else 86400)
    times = [f"{Decimal(first) + at * per_row:.13f}" for at in range(250)]
    stamps = stamps_of(tmp_path, times, f"{{channel: time, unit: {unit}, epoch: {epoch}}}")
    assert abs(stamps[0] - 1795701785_000_000_000) < 10**9
    np.testing.assert_allclose(np.diff(stamps), 20_000_000, atol=20_000)


@pytest.mark.parametrize(("unit", "bits", "step"), [("us", 32, 20_000), ("ms", 16, 20)])
def test_a_counter_that_begins_again_goes_on(
    tmp_path: Path, unit: str, bits: int, step: int
) -> None:
    """A clock of 32 bits in microseconds does so every 71 minutes."""
    times = [str((2**bits - 100 * step - 7 + at * step) % 2**bits) for at in range(250)]
    stamps = stamps_of(tmp_path, times, f"{{channel: time, unit: {unit}}}")
    assert len(stamps) == 250 and set(np.diff(stamps)) == {20_000_000}


def test_a_row_that_is_left_out_keeps_its_time(tmp_path: Path) -> None:
    """Where the rows are counted, the ones behind it are not earlier for it."""
    lines = table(tmp_path).read_text().splitlines()
    lines[100] = "1.98,10.0"
    lines[150:150] = ["# a remark, of three, fields, "]
    (tmp_path / "run.csv").write_text("\n".join(lines))
    text = MAP.replace("  t: {channel: time, unit: s}\n", "") + "rate: 50 Hz\n"
    output = imported(tmp_path, tmp_path / "run.csv", text=text)
    stamps = read(output / "run.mcap").arrays("/raw/wheel_encoder")["stamp"]
    assert stamps[-1] - stamps[0] == 249 * 20_000_000 and len(stamps) == 249


def test_a_time_that_falls_all_the_way_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="249 times that fall, the first at row 3"):
        stamps_of(tmp_path, [f"{9.0 - 2 * at}" for at in range(250)], "{channel: time, unit: s}")


def test_a_day_beside_a_time_of_day(tmp_path: Path) -> None:
    header, *rows = table(tmp_path).read_text().splitlines()
    body = [
        f"11/{26 + (at >= 50)}/2026,{'23:59:59' if at < 50 else f'00:00:0{at // 50 - 1}'}"
        f".{at % 50 * 20:03d},{row.partition(',')[2]}"
        for at, row in enumerate(rows)
    ]
    (tmp_path / "run.csv").write_text("\n".join(["day," + header, *body]))
    text = MAP.replace("  t: {channel: time, unit: s}", "  t: {channel: time, unit: clock}")
    text = text.replace("columns:", "columns:\n  day: {channel: date, order: month-day-year}")
    stamps = read(imported(tmp_path, tmp_path / "run.csv", text=text) / "run.mcap")
    found = stamps.arrays("/raw/wheel_encoder")["stamp"]
    assert found[0] == 1795737599 * 10**9 and set(np.diff(found)) == {20_000_000}


def test_sixteen_digits_of_a_speed_are_no_resolution(tmp_path: Path) -> None:
    """Programs write every digit of a float; an encoder has counts of a size."""
    rng, t = np.random.default_rng(1), np.arange(0.0, 5.0, 0.02)
    speeds = 10.0 + 0.01 * rng.standard_normal(t.size)
    rows = [f"{x!r},{rpm!r},60.0,3.0" for x, rpm in zip(t.tolist(), speeds.tolist(), strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["t,rpm,v,M", *rows]))
    output = imported(tmp_path, tmp_path / "run.csv")
    scale = config.load(output / "csv.yaml").settings.channels["wheel_encoder"].calibration.scale
    counts = read(output / "run.mcap").arrays("/raw/wheel_encoder")["count"]
    turned = float(counts[-1] - counts[0]) * scale.value
    assert scale.value >= 0.99e-11
    assert turned == pytest.approx(np.trapezoid(speeds, t) * np.pi / 30, abs=1e-7)


TURN = "turn: {channel: wheel_angle, unit: mrad}"
WAY = "way: {{channel: carriage_position, unit: mm, factor: {}}}"


@pytest.mark.parametrize("factor", [1.0, 0.0153])
def test_counts_kept_as_floats_are_counts(tmp_path: Path, factor: float) -> None:
    """MDF, HDF5, NumPy and MATLAB keep whole numbers as floats that write no last digit."""
    rng, t = np.random.default_rng(1), np.arange(0.0, 8.0, 0.02)
    torque, way = 3.0 + 0.1 * rng.standard_normal(t.size), np.round(900.0 * t)
    np.savez(tmp_path / "run.npz", t=t, way=way, turn=np.round(9000.0 * t), M=torque)
    text = MAP.replace("rpm: {channel: wheel_speed, unit: rpm}", TURN)
    text = text.replace("v: {channel: carriage_speed, unit: mm/s}", WAY.format(factor))
    output = imported(tmp_path, tmp_path / "run.npz", text=text)
    settings = config.load(output / "csv.yaml").settings
    scale = settings.channels["carriage_encoder"].calibration.scale.value
    assert scale * settings.pulley_radius == pytest.approx(1e-3 * factor)
    counts = read(output / "run.mcap").arrays("/raw/carriage_encoder")["count"]
    assert counts.tolist() == way.tolist()


def test_speeds_become_counts_that_give_them_back(tmp_path: Path) -> None:
    output = imported(tmp_path, table(tmp_path))
    settings = config.load(output / "csv.yaml").settings
    recording = read(output / "run.mcap")
    for name, rate in (("wheel_encoder", 10 * np.pi / 30), ("carriage_encoder", 0.06)):
        rows, scale = recording.arrays(f"/raw/{name}"), settings.channels[name].calibration.scale
        time = (rows["stamp"] - rows["stamp"][0]) * 1e-9
        assert np.polyfit(time, rows["count"] * scale.value, 1)[0] == pytest.approx(rate, rel=1e-6)
    assert settings.drive.torque_source == "wrench"
    assert recording.arrays("/raw/wrench")["fz"] == pytest.approx(50.0)
    assert settings.wrench is not None and settings.wrench.torque_noise == pytest.approx(0.1, 0.2)
    assert not recording.counts["/raw/motor_shunt"]


def test_a_run_column_parts_one_file(tmp_path: Path) -> None:
    table(tmp_path)
    lines = (tmp_path / "run.csv").read_text().splitlines()
    rows = [
        f"{line},{'A' if n < 100 else 'B'},{40 + (n >= 100) * 30}"
        for n, line in enumerate(lines[1:])
    ]
    (tmp_path / "all.csv").write_text("\n".join([f"{lines[0]},trial,W0", *rows]))
    text = MAP.replace(
        "wheel:", "  trial: {channel: run}\n  W0: {channel: nominal_load, unit: N}\nwheel:"
    )
    output = imported(tmp_path, tmp_path / "all.csv", text=text)
    loads_of = {p.stem: read(p).run.nominal_load for p in output.glob("*.mcap")}
    assert loads_of == {"A": 40.0, "B": 70.0}


@pytest.mark.parametrize(
    "text",
    [
        "t;rpm;v\n0,0;10,5;60\n0,1;10,5;60\n0,2;10,5;61\n",
        "# a rig\n# of 2026\nt,rpm,v\n0.0,10.5,60\n0.1,10.5,60\n0.2,10.5,61\n",
        "\ufefft\trpm\tv\n[s]\t(1/min)\t[mm/s]\n0.0\t10.5\t60\n0.1\t10.5\t60\n0.2\t10.5\t61\n",
        "t,rpm,v,\r\n0.0,10.5,60,\r\n0.1,10.5,60,\r\n0.2,10.5,61,\r\n",
        '"t","rpm","v"\n0.0,10.5,60\n\n0.1,10.5,60\n0.2,10.5,61\n',
    ],
)
def test_the_ways_to_write_a_table(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.csv").write_text(text, encoding="utf-8", newline="")
    found = csv_text.read(tmp_path / "x.csv")
    assert list(found.columns) == ["t", "rpm", "v"]
    np.testing.assert_allclose(found.columns["t"].numbers, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(found.columns["rpm"].numbers, 10.5)
    assert found.columns["t"].resolution == pytest.approx(0.1)


def test_slow_data_slow_the_filter_and_its_patience(tmp_path: Path) -> None:
    rows = [f"{x / 10:.1f},10,60,{3 + x % 3 / 10}" for x in range(100)]
    (tmp_path / "slow.csv").write_text("\n".join(["t,rpm,v,M", *rows]))
    settings = config.load(imported(tmp_path, tmp_path / "slow.csv") / "csv.yaml").settings
    assert settings.rates.update == 2.0
    assert settings.channels["wheel_encoder"].stale_after == pytest.approx(0.5)


def test_a_guess_takes_no_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One of them would not be used."""
    with pytest.raises(SystemExit) as stop:
        main(["csv", str(tmp_path / "a.csv"), "--guess", "--map", str(tmp_path / "map.yaml")])
    said = capsys.readouterr()
    assert stop.value.code == 2 and said.out == "" and said.err.count("\n") == 1
    assert "--map: not allowed with argument --guess" in said.err


@pytest.mark.parametrize("sigma", [0.02, 0.3])
def test_the_scatter_of_a_column_is_its_noise(sigma: float) -> None:
    """Whatever the signal does slowly, and whatever steps it makes."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.005, 0.015, 4000))
    signal = 3.0 * np.sin(t) + 5.0 * (t > 20.0)
    values = signal + sigma * rng.standard_normal(t.size)
    values[rng.random(t.size) < 0.1] = np.nan
    assert scatter(t, values, 1e-6) == pytest.approx(sigma, rel=0.06)
    assert scatter(t, np.full(t.size, 2.0), 0.1) == pytest.approx(0.1 / 12**0.5)


def test_a_stamp_keeps_its_nanoseconds(tmp_path: Path) -> None:
    header, *rows = table(tmp_path).read_text().splitlines()
    first = 1764166980_000_000_001
    stamps = [first + at * 20_000_003 for at in range(len(rows))]
    for unit, places in (("ns", 0), ("us", 3), ("s", 9)):
        texts = [
            f"{s // 10**places}" + f".{s % 10**places:0{places}d}" * bool(places) for s in stamps
        ]
        body = [f"{t},{row.partition(',')[2]}" for t, row in zip(texts, rows, strict=True)]
        (tmp_path / "run.csv").write_text("\n".join([header, *body]))
        text = MAP.replace("unit: s}", f"unit: {unit}}}")
        output = imported(tmp_path, tmp_path / "run.csv", text=text)
        found = read(output / "run.mcap").arrays("/raw/wheel_encoder")["stamp"]
        assert found.tolist() == stamps


def test_series_and_csv_are_one_command(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="--map"):
        main(["series", str(tmp_path)])
    with pytest.raises(CommandError, match="--map"):
        main(["csv", str(tmp_path)])
