"""What `--guess` proposes for the headers of public logs, what it asks, and that every answer is a
map that can be imported.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import gritd
from gritd.tools.cli.command import CommandError
from gritd.tools.commands.import_rig import main
from gritd.tools.importers.series import csv_text
from gritd.tools.importers.series.guess import guessed
from gritd.tools.importers.series.sources import read
from tests.tools.importers.series import headers

LINE = re.compile(
    r"^  (?P<off># )?(?P<name>'[^']*'|[A-Za-z_]\w*): \{channel: (?P<channel>\w+)", re.M
)
ASKED = re.compile(r"^  # \? (?P<name>'[^']*'|[A-Za-z_]\w*): ", re.M)
ROWS = 60


def cells(name: str, number: int) -> list[str]:
    """Values that a column of such a name may hold, rising a little and scattered."""
    rng, t = np.random.default_rng(number), 0.02 * np.arange(ROWS)
    if "iso" in name:
        return [f"2026-11-26T14:03:{x + 5:09.6f}" for x in t]
    if re.search(r"(?i)\b(time|zeit|t|temps|tiempo|tempo)\b|时间|時間|prüfzeit|timestamp", name):
        return [f"{1e3 * x if 'ms' in name else x:.3f}" for x in t]
    if "ms" in re.split(r"[_(]", name):
        return [f"{1e3 * x:.0f}" for x in t]
    if "encoder" in name:
        return [str(round(1000 * x)) for x in t]
    return [f"{v:.4f}" for v in 3.0 + number + 2.0 * t + 0.05 * rng.standard_normal(ROWS)]


def written(folder: Path, names: list[str], separator: str = "\t") -> Path:
    columns = [cells(name, number) for number, name in enumerate(names)]
    rows = [separator.join(names), *map(separator.join, zip(*columns, strict=True))]
    path = folder / "run.txt"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def proposed(path: Path) -> tuple[str, dict[str, set[str]], set[str]]:
    """The text; the channels of the lines of each column; the columns that are asked about."""
    text = guessed([csv_text.read(path)])
    channels: dict[str, set[str]] = {}
    asked = {match["name"].strip("'") for match in ASKED.finditer(text)}
    for match in LINE.finditer(text):
        name = match["name"].strip("'")
        if not match["off"] or name in asked:
            channels.setdefault(name, set()).add(match["channel"])
    return text, channels, asked | set(re.findall(r"^  '?([^'\n]*?)'?: \{.*# \?", text, re.M))


def test_there_are_forty() -> None:
    assert len(headers.ALL) >= 40


@pytest.mark.parametrize("header", headers.ALL)
def test_the_names_of_public_logs_propose_their_channels(tmp_path: Path, header: str) -> None:
    expected = headers.ALL[header]
    _, channels, asked = proposed(written(tmp_path, list(expected)))
    for name, channel in expected.items():
        found = channels.get(name, set())
        if channel.endswith("?"):
            assert name in asked or not found, (name, found)
        elif not channel:
            assert found <= {"wheel_speed", "carriage_speed"} or name in asked, (name, found)
        else:
            assert channel in found, (name, found)


UNITS_AND_NAMES = {
    "Time [s]": "time",
    "wheel_rpm": "wheel_speed",
    "Rim speed (mm/s)": "rim_speed",
    "theta_wheel_deg": "wheel_angle",
    "carriage_pos_mm": "carriage_position",
    "CartSpeed_mm/s": "carriage_speed",
    "Drawbar Pull [N]": "drawbar_pull",
    "Fz_N": "load",
    "sinkage(mm)": "sinkage",
    "motor current [mA]": "current",
    "wheel_torque_Nm": "torque",
    "humidity": None,
    "cart_mm_s": "carriage_speed, unit: mm/s",
    "omega_rad_per_s": "wheel_speed, unit: rad/s",
}


@pytest.mark.parametrize("header", UNITS_AND_NAMES)
def test_names_and_units_in_one_word(tmp_path: Path, header: str) -> None:
    rows = "".join(f"{1 + 0.1 * at:.1f},7\n" for at in range(20))
    (tmp_path / "x.csv").write_text(f"{header},other\n{rows}")
    text = guessed([csv_text.read(tmp_path / "x.csv")])
    line = next(line for line in text.splitlines() if header in line)
    expected = UNITS_AND_NAMES[header]
    assert f"channel: {expected}" in line if expected else line.strip().startswith("#")


# --- what is proposed can be imported ---


def answers(text: str) -> Iterator[str]:
    """The text as it stands, and with each line of each question in its place."""
    lines = text.splitlines()
    for at, line in enumerate(lines):
        choice = LINE.match(line)
        if choice and choice["off"]:
            yield "\n".join([*lines[:at], "  " + line[4:], *lines[at + 1 :]])
    yield text


@pytest.mark.parametrize("header", ["German", "French", "Chinese", "Japanese"])
def test_every_answer_is_a_map_that_imports(tmp_path: Path, header: str) -> None:
    path = written(tmp_path, list(headers.LANGUAGES[header]))
    text, _, _ = proposed(path)
    for number, answer in enumerate(answers(text)):
        (tmp_path / "map.yaml").write_text(f"{answer}\nwheel: {{radius: 72 mm, width: 71 mm}}\n")
        out = tmp_path / str(number)
        assert main(["csv", str(path), "--map", f"{tmp_path}/map.yaml", "-o", str(out)]) == 0


def test_imposed_speeds_and_a_column_of_runs_import(tmp_path: Path) -> None:
    rows = [
        f"{x / 50:.2f},10,60,{3 + x % 5 / 10},{40 + x // 100 * 30},{x // 100}" for x in range(200)
    ]
    header = "time_s,wheel speed [rpm],carriage_v_mm/s,wheel torque (Nm),weights [N],trial"
    (tmp_path / "run.csv").write_text("\n".join([header, *rows]))
    text = guessed([csv_text.read(tmp_path / "run.csv")])
    (tmp_path / "map.yaml").write_text(f"{text}\nwheel: {{radius: 72 mm, width: 71 mm}}\n")
    named = [str(tmp_path / "run.csv"), "--map", str(tmp_path / "map.yaml")]
    assert main(["csv", *named, "-o", str(tmp_path / "out")]) == 0
    assert {path.stem for path in (tmp_path / "out").glob("*.mcap")} == {"0", "1"}


def test_an_imposed_speed_without_digits_gets_a_noise(tmp_path: Path) -> None:
    """A file of binary numbers does not tell how well a speed is known that never changes."""
    from scipy.io import savemat

    t = np.arange(0.0, 4.0, 0.02)
    torque = 3.0 + 0.1 * np.random.default_rng(1).standard_normal(t.size)
    same = {"wheel_rpm": np.full(t.size, 12.3), "cart_mm_s": np.full(t.size, 61.7)}
    savemat(tmp_path / "run.mat", {"time": t, "wheel_torque": torque, **same})
    text = guessed(read(tmp_path / "run.mat"))
    (tmp_path / "map.yaml").write_text(f"{text}\nwheel: {{radius: 72 mm, width: 71 mm}}\n")
    named = [str(tmp_path / "run.mat"), "--map", str(tmp_path / "map.yaml")]
    assert main(["csv", *named, "-o", str(tmp_path / "out")]) == 0


# --- what is asked, and what is seen without a name ---


def guess_of(folder: Path, columns: dict[str, list[float] | list[str]]) -> str:
    shown = [[x if isinstance(x, str) else f"{x:g}" for x in c] for c in columns.values()]
    rows = [",".join(columns), *map(",".join, zip(*shown, strict=True))]
    (folder / "run.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return guessed([csv_text.read(folder / "run.csv")])


NOISE = [3.0 + 0.1 * (x * 7 % 5) for x in range(50)]


def test_days_of_a_spreadsheet_are_dates(tmp_path: Path) -> None:
    days = 46_352.5  # a noon
    columns = {"time": [f"{days + at / 86_400 / 50:.10f}" for at in range(ROWS)]}
    columns |= {name: cells(name, at) for at, name in enumerate(["wheel rpm", "cart mm/s"])}
    columns |= {"axle torque Nm": cells("torque", 3)}
    path = tmp_path / "run.csv"
    rows = [",".join(columns), *map(",".join, zip(*columns.values(), strict=True))]
    path.write_text("\n".join(rows), encoding="utf-8")

    text = guessed([csv_text.read(path)])
    (tmp_path / "map.yaml").write_text(f"{text}\nwheel: {{radius: 72 mm, width: 71 mm}}\n")
    out = tmp_path / "out"
    assert main(["series", str(path), "--map", f"{tmp_path}/map.yaml", "-o", str(out)]) == 0
    stamps = gritd.read(out / "run.mcap")["raw/wheel_encoder"]["stamp"]
    noon = np.datetime64("2026-11-26T12:00", "ns").astype(np.int64)
    assert abs(int(stamps[0]) - noon) < 50_000 and abs(np.median(np.diff(stamps)) - 2e7) < 1e5


def test_days_of_matlab_are_not_taken_for_seconds_and_are_told(tmp_path: Path) -> None:
    days = [f"{739_580.5 + at / 86_400 / 50:.11f}" for at in range(ROWS)]
    columns = {"t": days, "wheel rpm": NOISE + NOISE[:10], "cart mm/s": NOISE + NOISE[:10]}
    text = guess_of(tmp_path, columns)
    assert "channel: time" not in text and "# ? rate:" in text

    channels = "wheel rpm: {channel: wheel_speed, unit: rpm}\n  t: {channel: time, unit: d}"
    (tmp_path / "map.yaml").write_text(f"columns:\n  {channels}\n")
    command = ["series", f"{tmp_path}/run.csv", "--map", f"{tmp_path}/map.yaml", "-o", "out"]
    with pytest.raises(CommandError, match=r"datenum.*719529"):
        main(command)


def test_a_topic_that_every_bag_has_is_in_each(tmp_path: Path) -> None:
    """Files of several tables: a column is looked for in all of a file's."""
    still = {"a.t": np.arange(50) / 50, "a.room": np.full(50, 3.0), "b.t": np.arange(30) / 10.0}
    for name in ("one", "two"):
        np.savez(tmp_path / f"{name}.npz", **still)
    tables = [table for name in ("one", "two") for table in read(tmp_path / f"{name}.npz")]
    assert "not in" not in guessed(tables)


def test_a_text_of_a_folder_that_is_no_table_is_left_out_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "bench"
    folder.mkdir()
    path = written(folder, ["time_s", "wheel rpm", "cart mm/s", "axle torque [Nm]"])
    (folder / "LIESMICH.txt").write_text("Rad: Durchmesser 144 mm, Breite 71 mm, Last 45 N.\n")
    assert main(["series", str(folder), "--guess"]) == 0
    text = capsys.readouterr().out
    assert "LIESMICH.txt is no table" in text and "{channel: wheel_speed, unit: rpm}" in text

    (tmp_path / "map.yaml").write_text(f"{text}\nwheel: {{radius: 72 mm, width: 71 mm}}\n")
    out = tmp_path / "out"
    command = ["series", str(folder), "--map", str(tmp_path / "map.yaml"), "-o", str(out)]
    assert main(command) == 0 and (out / f"{path.stem}.mcap").exists()
    assert "LIESMICH.txt is no table" in capsys.readouterr().out
