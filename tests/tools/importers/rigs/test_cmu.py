"""The CMU importer against the tables and the findings of the data's authors."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.commands.import_rig import main
from tests.real_recordings import REAL, Physical, needs

pytestmark = needs("cmu")


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tables, two logs and the penetration tests: not all 55 logs, for the time they take."""
    output = tmp_path_factory.mktemp("cmu")
    folder = REAL / "cmu"
    logs = ["gr810_vx_10__12-7-20__10_20_0_1.txt.gz", "gr810_vx_10__11-10-20__10_10_0_5.txt.gz"]
    tables = [
        "smooth_all_trials_steady_state.csv",
        "grouser_first_trial_steady_state.csv",
        "beta0_trials_index.csv",
    ]
    paths = [str(folder / name) for name in [*logs, *tables, "penetration"]]
    assert main(["cmu", *paths, "-o", str(output)]) == 0
    return output


def steady(trial: Physical) -> dict[str, float]:
    """Means of a steady state, SI."""
    begin, end = 1.0, 7.0  # the encoders speak a second earlier
    forces = (trial.time("wrench") >= begin) & (trial.time("wrench") < end)
    inside = (trial.time("sinkage_pot") >= begin) & (trial.time("sinkage_pot") < end)
    tenths = trial.force("fx")[forces].reshape(60, 10).mean(axis=1)
    return {
        "rim": trial.settings.wheel.radius * trial.speed("wheel_encoder", begin, end),
        "speed": trial.speed("carriage_encoder", begin, end),
        "sinkage": float(trial.value("sinkage_pot")[inside].mean()),
        "pull": float(trial.force("fx")[forces].mean()),
        "pull_scatter": float(tenths.std()),
        "load": float(trial.force("fz")[forces].mean()),
    }


def rows(name: str) -> list[dict[str, float]]:
    with (REAL / "cmu" / name).open() as stream:
        table = [
            {key: float(text) for key, text in row.items() if text}
            for row in csv.DictReader(stream)
        ]
    return [row for row in table if row["beta"] == 0]


def test_every_straight_row_of_the_tables_is_one_steady_state(imported: Path) -> None:
    names = {
        "smooth": "smooth_all_trials_steady_state.csv",
        "grouser": "grouser_first_trial_steady_state.csv",
    }
    for wheel, name in names.items():
        given = sorted(
            (r["avg_Vry"], -r["avg_Fy"], r["std_Fy"], -r["avg_Fz"], -r["avg_Z"]) for r in rows(name)
        )
        found = []
        for path in sorted((imported / f"{wheel}-table").glob("*.mcap")):
            s = steady(Physical(path))
            found.append(
                (s["rim"] * 1e3, s["pull"], s["pull_scatter"], s["load"], s["sinkage"] * 1e3)
            )
        np.testing.assert_allclose(sorted(found), given, rtol=1e-6, atol=2e-4)


def test_every_trial_is_a_run_that_states_its_own_load(imported: Path) -> None:
    names = [path.stem for path in sorted((imported / "smooth-table").glob("smooth-0[02]0-*"))]
    assert names == [f"smooth-{speed}-{repeat}" for speed in ("000", "020") for repeat in (1, 2, 3)]
    trial = Physical(imported / "smooth-table" / "smooth-040-2.mcap")
    assert trial.recording.run.nominal_load == 21.59
    assert steady(trial)["load"] == pytest.approx(21.59, abs=0.01)


def test_a_mean_is_as_uncertain_as_repeats_differ(imported: Path) -> None:
    trial = Physical(imported / "smooth-table" / "smooth-020-1.mcap")
    tenths = trial.value("sinkage_pot").reshape(60, 10).mean(axis=1)
    assert tenths.std() / np.sqrt(60) == pytest.approx(0.7e-3)


def test_the_grousered_wheel_pulls_more_and_sinks_deeper_at_high_slip(imported: Path) -> None:
    smooth = steady(Physical(imported / "smooth-table" / "smooth-100-1.mcap"))
    grouser = steady(Physical(imported / "grouser-table" / "grouser-100-1.mcap"))
    assert smooth["speed"] / smooth["rim"] == pytest.approx(0.1, abs=0.01)
    assert grouser["pull"] > smooth["pull"] + 2.0
    assert grouser["sinkage"] > smooth["sinkage"] + 10e-3


def test_one_rim_speed_alone(tmp_path: Path) -> None:
    table = str(REAL / "cmu" / "grouser_first_trial_steady_state.csv")
    assert main(["cmu", table, "-o", str(tmp_path), "--rim-speed", "20", "--rim-speed", "100"]) == 0
    assert sorted(p.stem for p in tmp_path.rglob("*.mcap")) == ["grouser-020-1", "grouser-100-1"]
    with pytest.raises(CommandError, match="found no row of rim speed 7 mm/s"):
        main(["cmu", table, "-o", str(tmp_path), "--rim-speed", "7"])


def test_a_wheel_that_is_turned_from_its_travel(tmp_path: Path) -> None:
    """Slip is that of the travel; the side force is its own channel."""
    table = str(REAL / "cmu" / "smooth_all_trials_steady_state.csv")
    chosen = ["cmu", table, "-o", str(tmp_path), "--rim-speed", "10"]
    assert main([*chosen, "--steering", "30"]) == 0
    first = tmp_path / "smooth-30deg-table" / "smooth-30deg-010-1.mcap"
    assert Physical(first).force("fy").mean() == pytest.approx(9.9, abs=1.0)
    with pytest.raises(CommandError, match="beta 20; found 0, 15, 30, 45, 60, 75, 90"):
        main([*chosen, "--steering", "20"])


def test_a_log_ends_where_its_table_row_says(imported: Path) -> None:
    log = Physical(imported / "smooth-logs" / "gr810_vx_10__12-7-20__10_20_0_1.mcap")
    time, z = log.time("sinkage_pot"), log.value("sinkage_pot")
    assert z[0] == pytest.approx(-31.5e-3)
    assert z[time > time[-1] - 5].mean() == pytest.approx(22.54e-3, abs=0.1e-3)
    assert log.settings.wheel.radius * log.speed("wheel_encoder", 70, 80) == pytest.approx(
        20e-3, rel=0.01
    )
    assert log.speed("carriage_encoder", 70, 80) == pytest.approx(10e-3, rel=0.01)
    assert log.recording.run.nominal_load == pytest.approx(24.55, abs=0.01)
    assert len(log.time("wrench")) == len(log.time("motor_shunt")) == 0


def test_a_log_that_matches_no_row_has_no_load(imported: Path) -> None:
    log = Physical(imported / "smooth-logs" / "gr810_vx_10__11-10-20__10_10_0_5.mcap")
    assert log.recording.run.nominal_load is None


def test_penetration_tests_by_body(imported: Path) -> None:
    with (imported / "penetration.csv").open() as stream:
        points = [
            (row["body"], float(row["depth_mm"]), float(row["force_N"]))
            for row in csv.DictReader(stream)
        ]

    plate = np.array([(depth, force) for body, depth, force in points if body == "plate 60 mm"])
    pressure = plate[:, 1] / (np.pi * 0.03**2)
    near = np.abs(plate[:, 0] - 10.0) < 0.5

    assert pressure[near].mean() == pytest.approx(9.3e3, rel=0.1), (
        "what config/rig_cmu.yaml says of this sand"
    )

    stop = np.array(
        [(depth, force) for body, depth, force in points if body == "rigid stop" and force > 20.0]
    )
    assert np.polyfit(stop[:, 1], stop[:, 0], 1)[0] == pytest.approx(0.0125, abs=0.002), (
        "the frame yields, mm/N"
    )
    assert {body for body, _, _ in points} >= {
        "plate 80 mm",
        "plate 100 mm",
        "smooth wheel",
        "grouser wheel",
    }
