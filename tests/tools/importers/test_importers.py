"""Importers without anybody's data: the folder of rigs, the clocks, and files that are not what
they should be.
"""

from __future__ import annotations

import gzip
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from gritd.estimator.config import configuration as config
from gritd.estimator.recording import salvage
from gritd.tools.cli.command import CommandError
from gritd.tools.commands.import_rig import main
from gritd.tools.importers.recording import counts
from gritd.tools.importers.registry import importers
from gritd.tools.importers.rigs import mgst

RIG = "20210208-165209-trio-s20-p925.rig.csv"
SENSOR = "1-g_20-165209.processed.csv"


def mgst_files(folder: Path, seconds: float = 6.0, lag: float = 0.4) -> Path:
    """Both logs of a made-up trial: constant speeds, a torque that fluctuates in both logs."""
    seen = np.random.default_rng(3).standard_normal(100)

    def noise(t: float) -> float:
        return float(np.interp(t, np.linspace(-1.0, seconds + 1.0, 100), seen))

    rig, sensor = np.arange(0.0, seconds, 0.01), np.arange(0.0, seconds - lag, 0.0036)
    rows = [f"16:52:{18 + t:09.6f},{800 + 200 * noise(t):.0f},34.4,-27.5,7000" for t in rig]
    (folder / RIG).write_text(
        "timestamp,maxon_current,maxon_velmes,akd_velmes,sinkage\n" + "\n".join(rows)
    )
    rows = [f"0 days 00:00:{t:09.6f},10,160,{3.5 + noise(t + lag)},5" for t in sensor]
    (folder / SENSOR).write_text("Timestamp,dp,fn,torque,dp_raw\n" + "\n".join(rows))
    return folder


def complaint(*arguments: object, code: int = 3) -> str:
    with pytest.raises(CommandError) as caught:
        main([*map(str, arguments)])
    assert caught.value.code == code
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_every_module_of_the_folder_is_a_rig() -> None:
    found = importers()
    assert set(found) >= {"mgst", "cmu", "emps", "table"}
    for name, rig in found.items():
        assert re.fullmatch("[a-z]+", name)
        assert 20 < len(rig.SUMMARY) < 100


def test_unknown_rig_is_a_usage_error() -> None:
    with pytest.raises(SystemExit) as caught:
        main(["nowhere", "x", "-o", "y"])
    assert caught.value.code == 2


@given(speed=st.floats(0.001, 0.1), quanta=st.integers(1, 50))
@settings(max_examples=50)
def test_counts_travel_as_far_as_the_speed_says(speed: float, quanta: int) -> None:
    t = np.linspace(0.0, 2.0, 201)
    per_count = speed * 0.01 / quanta
    travelled = counts(t, np.full(t.shape, speed), per_count)
    np.testing.assert_array_equal(np.diff(travelled), quanta)


@pytest.mark.parametrize("lag", [0.25, 0.4, 0.73])
def test_the_lag_between_the_two_clocks_is_found(tmp_path: Path, lag: float) -> None:
    folder = mgst_files(tmp_path, seconds=12.0, lag=lag)
    trial = mgst.read_trial(folder / RIG, folder / SENSOR, mgst.RIG_FILE.fullmatch(RIG))  # type: ignore[arg-type]
    found, correlation = mgst.find_lag(trial)
    assert found == pytest.approx(lag, abs=0.02)
    assert correlation > 0.9
    reversed_current = replace(trial, rig=replace(trial.rig, current=-trial.rig.current))
    assert mgst.find_lag(reversed_current)[1] < 0.9


def test_imports_a_made_up_trial(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mgst", str(mgst_files(tmp_path)), "-o", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(tmp_path / "out" / "mgst-20-165209.mcap")


@pytest.mark.parametrize(
    ("name", "damage", "expected"),
    [
        (
            RIG,
            lambda text: text.replace("akd_velmes", "speed"),
            "found no column akd_velmes; expected the columns",
        ),
        (
            RIG,
            lambda text: text.replace("7000", "seven", 1),
            "row 2: sinkage: found 'seven'; expected a finite number",
        ),
        (
            RIG,
            lambda text: text.replace("7000", "nan", 1),
            "row 2: sinkage: found 'nan'; expected a finite number",
        ),
        (RIG, lambda text: text.replace("16:52", "noon", 1), "row 2: found 'noon"),
        (RIG, lambda text: text[: text.index("\n")], "found no rows; expected data"),
        (RIG, lambda text: text[: text.rindex(",")], "found no sinkage; expected 5 fields"),
        (
            SENSOR,
            lambda text: text.replace("00:00:00.0", "00:00:09.0", 1),
            "row 3: Timestamp does not rise",
        ),
        (
            SENSOR,
            lambda text: "\n".join(text.splitlines()[:300]),
            "expected 4.5 s or more, or --lag",
        ),
    ],
)
def test_one_line_says_what_is_wrong_with_a_file(
    tmp_path: Path, name: str, damage, expected: str
) -> None:  # type: ignore[no-untyped-def]
    file = mgst_files(tmp_path) / name
    file.write_text(damage(file.read_text()))
    said = complaint("mgst", tmp_path, "-o", tmp_path / "out")
    assert expected in said
    assert file.name in said or "--lag" in said


@pytest.mark.parametrize("lag", ["0", "-1", "nan", "soon"])
def test_a_lag_is_a_number_above_zero(
    tmp_path: Path, lag: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["mgst", str(tmp_path), "-o", str(tmp_path), f"--lag={lag}"])
    assert caught.value.code == 2
    assert f"found {lag!r}; expected a number above 0" in capsys.readouterr().err


def test_a_lag_beyond_the_logs_is_refused(tmp_path: Path) -> None:
    said = complaint("mgst", mgst_files(tmp_path), "-o", tmp_path / "out", "--lag", "60")
    assert "60 s" in said and "6.0 s" in said


def test_a_missing_or_broken_file_is_named(tmp_path: Path) -> None:
    said = complaint("mgst", tmp_path / "none", "-o", tmp_path, code=2)
    assert said.startswith(f"{tmp_path / 'none'}: found nothing there")

    for rig in ("mgst", "cmu", "emps", "table"):
        said = complaint(rig, tmp_path, "-o", tmp_path / "out")
        assert said.startswith(f"{tmp_path}") and not re.search(
            r"[\\?|*]", said.removeprefix(f"{tmp_path}")
        )

    assert "found no rig log" in complaint("mgst", tmp_path, "-o", tmp_path / "out")

    mgst_files(tmp_path)
    packed = gzip.compress((tmp_path / RIG).read_bytes())
    (tmp_path / RIG).unlink()
    (tmp_path / f"{RIG}.gz").write_bytes(packed[:-100])

    assert f"{RIG}.gz: cannot be read" in complaint("mgst", tmp_path, "-o", tmp_path / "out")

    (tmp_path / f"{RIG}.gz").write_bytes(packed)
    (tmp_path / SENSOR).unlink()
    assert f"found no sensor log; expected {SENSOR}" in complaint(
        "mgst", tmp_path, "-o", tmp_path / "out"
    )


TABLE = """source,wheel_radius_m,wheel_width_m,soil_simulant,soil_shear_modulus_k_m,\
vertical_load_n,slip,meas_drawbar_pull_n,meas_sinkage_m,meas_torque_nm
made up,0.1,0.05,sand,0.01,50,0.2,5,0.01,1.5
made up,0.1,0.05,sand,0.01,60,-0.3,-8,0.012,-0.5
""".replace("\\\n", "")
SOILS = """simulant,n,k_c_kN_per_m_n_plus_1,k_phi_kN_per_m_n_plus_2,cohesion_kPa,friction_angle_deg
sand,1.0,1.0,1000,0.5,30
"""


def table_files(folder: Path, table: str = TABLE, soils: str = SOILS) -> Path:
    (folder / "made_up.csv").write_text(table)
    (folder / "soils.csv").write_text(soils)
    return folder


def test_a_table_drives_and_brakes(tmp_path: Path) -> None:
    assert (
        main(["table", str(table_files(tmp_path)), "-o", str(tmp_path / "out"), "--speed", "0.02"])
        == 0
    )
    rows = salvage.read(tmp_path / "out" / "made_up.mcap")
    settings_ = config.load(tmp_path / "out" / "made_up.yaml").settings
    scale = settings_.channels["wheel_encoder"].calibration.scale.value
    wheel = rows.arrays("/raw/wheel_encoder")["count"] * scale * settings_.wheel.radius
    carriage = rows.arrays("/raw/carriage_encoder")["count"] * 1e-6

    assert len(wheel) == 1202  # the first and the last while it stands
    assert wheel[0] == 0.0 and wheel[-1] == wheel[-2]

    for segment, speeds in ((slice(1, 601), (0.02, 0.016)), (slice(601, 1201), (0.014, 0.02))):
        travelled = (np.ptp(wheel[segment]), np.ptp(carriage[segment]))
        assert travelled == pytest.approx(tuple(speed * 5.99 for speed in speeds), abs=3e-6)


@pytest.mark.parametrize(
    ("table", "soils", "expected"),
    [
        (
            TABLE.replace("60,-0.3", "60,-1.3"),
            SOILS,
            "row 3: found slip -1.3, load 60; expected -1 … 1, above 0 N",
        ),
        (TABLE, SOILS.replace("sand", "clay"), "soil_simulant: found 'sand' in no table of soils"),
        (SOILS, SOILS, "found no table; expected a CSV file with source"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(
    tmp_path: Path, table: str, soils: str, expected: str
) -> None:
    assert expected in complaint(
        "table", table_files(tmp_path, table, soils), "-o", tmp_path / "out"
    )


@pytest.mark.parametrize(
    ("limit", "table", "expected"),
    [
        (
            "text=200 B",
            TABLE,
            "found more than 200 bytes of text; GRITD_LIMITS='text=800 B' raises",
        ),
        ("values=15", TABLE, "found more than 15 values; GRITD_LIMITS='values=60' raises"),
        ("conditions=1", TABLE, "found 2 steady states; at most 1 are taken"),
        ("", TABLE + "x" * 2_000_000, "found a line of more than 1048576 bytes"),
        ("", TABLE + '"' + "x" * 200_000, "found no CSV: field larger than field limit (131072)"),
    ],
)
def test_a_file_larger_than_the_limits_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, table: str, expected: str
) -> None:
    """Plain or packed."""
    monkeypatch.setenv("GRITD_LIMITS", limit)
    files = table_files(tmp_path, table)
    said = complaint("table", files, "-o", tmp_path / "out")
    assert expected in said and "made_up.csv" in said

    (files / "made_up.csv").unlink()
    (files / "made_up.csv.gz").write_bytes(gzip.compress(table.encode()))
    assert expected in complaint("table", files, "-o", tmp_path / "out")


@pytest.mark.long
def test_a_matlab_file_of_too_many_numbers_is_not_unpacked(tmp_path: Path) -> None:
    log = {"t": np.arange(5_000_000.0), "qm": 0.0, "gtau": 35.0, "vir": 0.0}
    savemat(tmp_path / "DATA_EMPS.mat", log, do_compression=True)
    said = complaint("emps", tmp_path, "-o", tmp_path / "out")
    assert "t: found 5000000 of kind double; expected no more than 4000000 numbers" in said

    savemat(tmp_path / "DATA_EMPS.mat", {**log, "t": {"inside": np.zeros(9)}})
    assert "t: found 1 of kind struct" in complaint("emps", tmp_path, "-o", tmp_path / "out")


def test_a_log_without_numbers_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "gr810_vx_10__11-26-20__10_20_0_1.txt"
    for text, expected in (
        ("1,2,3,4,5,6\n", "row 1: found 6 fields; expected 7"),
        ("1,2,3,4,5,6,7\n1,2,x,4,5,7,8\n", "row 2: found 'x'; expected a finite number"),
        ("1,2,3,4,5,6,7\n1,2,inf,4,5,7,8\n", "row 2: found a number that is not finite"),
        ("1,2,3,4,5,6,7\n1,2,1e300,4,5,7,8\n", "row 2: found a number that is not finite"),
        ("", "found no rows; expected 7 numbers"),
        ("1,2,3,4,5,6,7\n", "found 1 rows; expected a log of two or more"),
        ("1,2,3,4,5,6,7\n1,2,3,4,5,6,8\n", "row 2: the clock does not rise"),
    ):
        log.write_text(text)
        said = complaint("cmu", log, "-o", tmp_path / "out")
        assert said.startswith(str(log)) and expected in said


@pytest.mark.parametrize("taken", ["out", "out/mgst-20-165209.mcap"])
def test_an_output_that_cannot_be_made_is_usage(tmp_path: Path, taken: str) -> None:
    if taken == "out":
        (tmp_path / "out").write_bytes(b"mine")
    else:
        (tmp_path / taken).mkdir(parents=True)
    said = complaint("mgst", mgst_files(tmp_path), "-o", tmp_path / "out", code=2)
    assert said.startswith(f"{tmp_path / 'out'}")


# --- the wheel of the flights ---


def quantised(folder: Path, step: float) -> Path:
    """The made-up trial with a rim speed in steps, as the motor's own quantum makes them."""
    mgst_files(folder)
    rows = (folder / RIG).read_text().splitlines()
    lines = []
    for number, row in enumerate(rows[1:]):
        cells = row.split(",")
        cells[2] = f"{step * (9 + number % 3):.4f}"
        lines.append(",".join(cells))
    (folder / RIG).write_text("\n".join([rows[0], *lines]))
    return folder


@pytest.mark.parametrize(("step", "radius"), [(1.96665, 0.075), (3.9333, 0.15)])
def test_the_radius_is_that_of_the_wheel_whatever_the_file_is_called(
    tmp_path: Path, step: float, radius: float
) -> None:
    """A file of the flights renamed to 1-g_…: its motor's quantum is twice as many mm/s."""
    quantised(tmp_path, step)
    assert main(["mgst", str(tmp_path), "-o", str(tmp_path / "out")]) == 0
    settings = config.load(tmp_path / "out" / "mgst.yaml").settings
    assert settings.wheel.radius == radius
    ground = radius == 0.075
    assert ("Earth gravity" in settings.testbed) == ground

    rows = salvage.read(tmp_path / "out" / "mgst-20-165209.mcap").arrays("/raw/wheel_encoder")
    seconds = (rows["stamp"][-1] - rows["stamp"][0]) * 1e-9
    turned = (rows["count"][-1] - rows["count"][0]) * 0.26222e-3
    assert turned / seconds * radius == pytest.approx(10 * step * 1e-3, rel=2e-3)


def test_a_wheel_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    quantised(tmp_path, 2.6)
    assert "found steps of 2.6 mm/s" in complaint("mgst", tmp_path, "-o", tmp_path / "out")


# --- the published MATLAB file ---


def test_the_trials_of_a_matlab_file_are_those_of_the_table(tmp_path: Path) -> None:
    fields = ("avg_Fx", "std_Fx", "avg_Fy", "std_Fy", "avg_Fz", "std_Fz", "avg_Vx", "avg_Vry")
    fields += ("avg_Z", "std_Z", "Vry", "beta")
    rng = np.random.default_rng(1)
    trials = rng.uniform(1.0, 2.0, (6, len(fields)))
    trials[:, 4] = -20.0  # load
    trials[:, 6:8], trials[:, 8] = (10.0, 20.0), -35.0
    trials[:, 10], trials[:, 11] = 20.0, (0.0, 0.0, 15.0, 0.0, 30.0, 0.0)

    lines = [",".join(fields), *(",".join(map(repr, row)) for row in trials.tolist())]
    for folder in ("csv", "mat"):
        (tmp_path / folder).mkdir()
    (tmp_path / "csv" / "smooth_all_trials_steady_state.csv").write_text("\n".join(lines))
    structures = np.array(
        [tuple(row) for row in trials.tolist()], dtype=[(name, float) for name in fields]
    )
    savemat(tmp_path / "mat" / "all_smooth_data.mat", {"all_results": structures})

    written = {}
    for folder in ("csv", "mat"):
        assert main(["cmu", str(tmp_path / folder), "-o", str(tmp_path / folder / "out")]) == 0
        files = sorted((tmp_path / folder / "out").rglob("*.mcap"))
        written[folder] = {
            f.name: salvage.read(f).arrays("/raw/wrench")["fx"].tolist() for f in files
        }
    assert len(written["mat"]) == 4 and written["mat"] == written["csv"]
