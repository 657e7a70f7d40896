"""Ding's points, imported and read back."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from math import cos
from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.terramechanics.soil import PressureSinkage
from gritd.estimator.terramechanics.soils import SOILS as KNOWN
from gritd.tools.commands import estimate
from gritd.tools.commands.import_rig import main
from gritd.tools.diagnose.method import diagnose, fit_base
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.signals import read_all
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import begin
from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.rigs.table import load_scatter, repeat_scatter
from tests.linear_plant import entry_angle
from tests.real_recordings import REAL, Physical, needs
from tests.rig import SETTINGS


@needs("ding")
def test_every_point_of_the_table_is_a_segment(tmp_path: Path) -> None:
    assert main(["table", str(REAL / "ding"), "-o", str(tmp_path)]) == 0
    trial = Physical(tmp_path / "ding2011_smooth.mcap")
    assert trial.recording.run.steady_states  # nobody may look for ripples in its scatter
    torque = trial.value("motor_shunt") * trial.settings.drive.torque_constant.value
    found = []

    for start in 1.0 + np.arange(6) * 7.0:  # the encoders speak a second earlier
        inside = (trial.time("motor_shunt") >= start) & (trial.time("motor_shunt") < start + 6.0)
        rim = trial.settings.wheel.radius * trial.speed("wheel_encoder", start, start + 6.0)
        slip = 1.0 - trial.speed("carriage_encoder", start, start + 6.0) / rim
        found.append((slip, trial.force("fx")[inside].mean(), torque[inside].mean()))
        assert trial.force("fz")[inside].mean() == pytest.approx(80.0)

    with (REAL / "ding" / "ding2011_smooth.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    columns = ("slip", "meas_drawbar_pull_n", "meas_torque_nm")
    np.testing.assert_allclose(
        found, [[float(row[name]) for name in columns] for row in rows], atol=1e-3
    )


@needs("ding")
def test_the_soils_strength_is_as_tabulated_where_asked_for(tmp_path: Path) -> None:
    arguments = ["table", str(REAL / "ding"), "-o", str(tmp_path), "--soil-strength", "table"]
    assert main(arguments) == 0
    soil = Physical(tmp_path / "ding2011_smooth.mcap").settings.soil
    assert soil.cohesion.value == pytest.approx(250.0)
    assert soil.tan_phi.value == pytest.approx(np.tan(np.radians(31.9)))
    assert soil.pressure_sinkage.second == pytest.approx(2407.4e3)


# --- made-up tables ---

HEADER = (
    "source,wheel_radius_m,wheel_width_m,soil_simulant,soil_shear_modulus_k_m,"
    "vertical_load_n,slip,meas_drawbar_pull_n,meas_sinkage_m"
)
SOILS = (
    "simulant,n,k_c_kN_per_m_n_plus_1,k_phi_kN_per_m_n_plus_2,cohesion_kPa,friction_angle_deg\n"
    "sand,1.1,0.9,1500,0.5,30\nclay,0.7,10,800,5,20\n"
)


def rows_of(radius: float, soil: str, torque: str = "") -> list[str]:
    return [
        f"me,{radius},0.1,{soil},0.02,{40 + at / 100:.2f},{slip},{10 * slip},0.01{torque}"
        for at, slip in enumerate((0.1, 0.2, 0.4))
    ]


def test_a_strength_left_to_be_found_may_be_that_of_any_soil(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("\n".join([HEADER, *rows_of(0.1, "clay")]))
    (tmp_path / "soils.csv").write_text(SOILS)
    assert main(["table", str(tmp_path), "-o", str(tmp_path / "out")]) == 0
    soil = Physical(next((tmp_path / "out").glob("*.mcap"))).settings.soil

    for known in KNOWN.values():
        tan_phi = np.tan(np.radians(known.friction_angle))
        assert abs(known.cohesion - soil.cohesion.value) < 2.0 * soil.cohesion.sigma, known.name
        assert abs(tan_phi - soil.tan_phi.value) < 2.0 * soil.tan_phi.sigma, known.name
    assert soil.cohesion.value != pytest.approx(5e3)  # nor is it the tabulated one


def test_several_wheels_and_soils_without_torque(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [*rows_of(0.1, "sand"), *rows_of(0.15, "sand"), *rows_of(0.1, "clay")]
    (tmp_path / "many.csv").write_text("\n".join([HEADER, *rows]))
    (tmp_path / "soils.csv").write_text(SOILS)
    assert main(["table", str(tmp_path), "-o", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.count("no torque") == 3

    known = {}
    for path in sorted((tmp_path / "out").glob("*.mcap")):
        trial = Physical(path)
        soil = trial.settings.soil
        known[path.stem] = (trial.settings.wheel.radius, soil.exponent.value)
        assert not trial.recording.counts["/raw/motor_shunt"]
    assert known == {"many-1": (0.1, 1.1), "many-2": (0.15, 1.1), "many-3": (0.1, 0.7)}


def test_a_wheel_with_other_lugs_is_another_wheel_and_may_have_no_torque(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As tables of several laboratories have it: one of the wheels was driven without torque."""
    lugs = ((0.0, 0, "2.0"), (0.01, 16, "3.0"), (0.02, 14, ""), (0.03, 14, " "))
    rows = [
        f"{row},{height},{number},{torque}"
        for height, number, torque in lugs
        for row in rows_of(0.1, "sand")
    ]
    header = f"{HEADER},grouser_height_m,grouser_count,meas_torque_nm"
    (tmp_path / "many.csv").write_text("\n".join([header, *rows]))
    (tmp_path / "soils.csv").write_text(SOILS)
    assert main(["table", str(tmp_path), "-o", str(tmp_path / "out")]) == 0
    assert "grouser_count 14, no torque" in capsys.readouterr().out
    trials = [Physical(tmp_path / "out" / f"many-{number}.mcap") for number in (1, 2, 3, 4)]
    torques = [t.recording.counts["/raw/motor_shunt"] for t in trials]
    assert torques[0] and torques[1] and not any(torques[2:])
    assert trials[1].value("motor_shunt").mean() == pytest.approx(3.0)


@pytest.mark.parametrize("torque", [True, False])
def test_the_filter_finds_the_soil_of_a_table(tmp_path: Path, torque: bool) -> None:
    """Steady states of a wheel that obeys the equations, with the torque or the pull alone."""
    cohesion, tan_phi, k = 900.0, 0.65, 0.02
    rig = replace(
        SETTINGS,
        wheel=replace(SETTINGS.wheel, radius=0.1, width=0.1),
        soil=replace(SETTINGS.soil, pressure_sinkage=PressureSinkage("bekker", 1.1, 900.0, 1500e3)),
    )
    rows = []
    for load in (40.0, 70.0, 100.0):
        for slip in (0.1, 0.2, 0.3, 0.45, 0.6):
            theta_1, forces = entry_angle(rig, (cohesion, tan_phi, k), load, slip)
            told = (load, slip, forces.drawbar_pull, 0.1 * (1.0 - cos(theta_1)), forces.torque)
            rows.append("me,0.1,0.1,sand,0.02," + ",".join(f"{value:.5f}" for value in told))
    if not torque:
        rows = [row.rpartition(",")[0] for row in rows]
    header = f"{HEADER},meas_torque_nm" if torque else HEADER
    (tmp_path / "one.csv").write_text("\n".join([header, *rows]))
    (tmp_path / "soils.csv").write_text(SOILS)
    assert main(["table", str(tmp_path), "-o", str(tmp_path / "out")]) == 0

    told = tmp_path / "soil.json"
    assert estimate.main([str(tmp_path / "out" / "one.mcap"), "--json", str(told)]) == 0
    found = json.loads(told.read_text())
    assert found["believed"]
    for name, true in (("c", cohesion), ("tan_phi", tan_phi), ("k", k)):
        known = found["together"][name]
        assert known["value"] == pytest.approx(true, abs=2.0 * known["sigma"]), name
    assert found["together"]["tan_phi"]["sigma"] < 0.7 * 0.15  # less than before the run


def test_a_torque_that_one_row_lacks_is_told_by_its_row(tmp_path: Path) -> None:
    rows = [*rows_of(0.1, "clay", ",2.0"), *rows_of(0.1, "sand", ",2.0")]
    rows[4] = rows[4].removesuffix("2.0")
    (tmp_path / "many.csv").write_text("\n".join([f"{HEADER},meas_torque_nm", *rows]))
    (tmp_path / "soils.csv").write_text(SOILS)
    with pytest.raises(RigFileError, match="row 6: meas_torque_nm"):
        main(["table", str(tmp_path), "-o", str(tmp_path / "out")])


def test_loads_that_were_meant_to_be_one_do_not_differ_by_more_than_their_scatter(
    tmp_path: Path,
) -> None:
    """40.00, 40.01 and 40.02 N are one load: no signal is to be read from their differences."""
    (tmp_path / "one.csv").write_text(
        "\n".join([f"{HEADER},meas_torque_nm", *rows_of(0.1, "sand", ",2.0")])
    )
    (tmp_path / "soils.csv").write_text(SOILS)
    main(["table", str(tmp_path), "-o", str(tmp_path / "out")])
    load = Physical(tmp_path / "out" / "one.mcap").force("fz").reshape(3, -1)
    uncertain = load.std(axis=1) / load.shape[1] ** 0.5
    assert uncertain == pytest.approx(0.01, rel=0.05)
    assert np.ptp(load.mean(axis=1)) <= 2.01 * uncertain[0]


def test_the_scatter_of_loads(tmp_path: Path) -> None:
    assert load_scatter(["80.0", "80.0"]) == pytest.approx(0.1 / 12**0.5)
    assert load_scatter(["40.1", "39.9", "80.2", "79.8"]) == pytest.approx(0.2236, rel=0.01)
    assert load_scatter(["40", "80", "120"]) == pytest.approx(1 / 12**0.5)


def test_repeats_of_a_condition_tell_how_uncertain_a_value_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Pulls of 10, 13 and 16 N at one load and slip: 3 N; without repeats what a figure leaves."""
    rows = [f"me,0.1,0.1,sand,0.02,40,0.2,{pull},0.01" for pull in (10, 13, 16)]
    columns = zip(*(row.split(",") for row in rows), strict=True)
    table = {name: list(values) for name, values in zip(HEADER.split(","), columns, strict=True)}
    assert repeat_scatter(table, "meas_drawbar_pull_n") == pytest.approx(3.0)
    (tmp_path / "one.csv").write_text("\n".join([HEADER, *rows]))
    (tmp_path / "soils.csv").write_text(SOILS)
    assert main(["table", str(tmp_path), "-o", str(tmp_path / "out")]) == 0
    assert "drawbar-pull 3 N, sinkage 0.00025 m, load" in capsys.readouterr().out
    pull = Physical(tmp_path / "out" / "one.mcap").force("fx").reshape(3, 60, 10)
    assert pull.mean(axis=2).std(axis=1) / 60**0.5 == pytest.approx(3.0)


def test_a_state_reads_the_same_under_any_name_and_in_any_row(tmp_path: Path) -> None:
    rows = rows_of(0.1, "sand")
    found = []
    for name, ordered in (("one", rows), ("other", rows[::-1])):
        folder = tmp_path / name
        folder.mkdir()
        (folder / f"{name}.csv").write_text("\n".join([HEADER, *ordered]))
        (folder / "soils.csv").write_text(SOILS)
        main(["table", str(folder), "-o", str(folder / "out")])
        found.append(Physical(folder / "out" / f"{name}.mcap").force("fx").reshape(3, -1))
    np.testing.assert_allclose(found[0], found[1][::-1])


def test_a_diagnosis_sees_every_state_with_its_mean(tmp_path: Path) -> None:
    """The first and the last too."""
    (tmp_path / "one.csv").write_text("\n".join([HEADER, *rows_of(0.1, "sand")]))
    (tmp_path / "soils.csv").write_text(SOILS)
    main(["table", str(tmp_path), "-o", str(tmp_path / "out")])
    settings = config.load(tmp_path / "out" / "one.yaml").settings
    runs = rig_of(read_all([tmp_path / "out" / "one.mcap"]), settings)[0].runs
    seen = [
        (r.covariates["slip"], r.measured["drawbar_pull"], r.used["drawbar_pull"]) for r in runs
    ]
    means = [(slip[used].mean(), pull[used].mean()) for slip, pull, used in seen]
    np.testing.assert_allclose(means, [(0.1, 1.0), (0.2, 2.0), (0.4, 4.0)], atol=0.01)


def test_no_result_depends_on_the_order_of_rows(tmp_path: Path) -> None:
    """A wheel beside another, both as tables."""
    before, new = (
        rows_of(0.1, "sand"),
        [row.replace("0.01", "0.012") for row in rows_of(0.1, "sand")],
    )
    found = []
    for way, order in enumerate((slice(None), slice(None, None, -1))):
        folder = tmp_path / str(way)
        folder.mkdir()
        for name, rows in (("before", before), ("new", new)):
            (folder / f"{name}.csv").write_text("\n".join([HEADER, *rows[order]]))
        (folder / "soils.csv").write_text(SOILS)
        main(["table", str(folder), "-o", str(folder / "out")])
        new_one, known = (read_all([folder / "out" / f"{n}.mcap"]) for n in ("new", "before"))
        settings = config.load(folder / "out" / "before.yaml").settings
        first = begin(prepare_screening(fit_base(rig_of(new_one, settings, known)[0]))).first
        found.append((first.ratio, *first.evidence.values()))
    np.testing.assert_allclose(found[0], found[1], atol=0.1)


@pytest.mark.long
def test_a_wheel_that_pulls_and_takes_twice_as_much_is_seen(tmp_path: Path) -> None:
    """Of a bed that was prepared anew no soil explains it. It is told by slip, not row by row."""
    constant = "me,0.068,0.064,soil,0.021,12.2"
    before = "0.152,-1.3,0.0096,0.15 0.264,-0.5,0.01,0.18 0.376,0.1,0.0094,0.25 0.6,1.2,0.01,0.33"
    new = "0.152,1.7,0.0095,0.38 0.264,3.5,0.0096,0.52 0.376,5.1,0.0088,0.64 0.6,7.5,0.009,0.84"
    for name, rows in (("before", before), ("new", new)):
        lines = [f"{HEADER},meas_torque_nm", *(f"{constant},{row}" for row in rows.split())]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines))
    soil = "soil,1.1,0,1400,0.25,32"
    (tmp_path / "soils.csv").write_text("\n".join([SOILS.partition("\n")[0], soil]))
    stated = "--torque-sigma 0.01 --drawbar-pull-sigma 0.05 --sinkage-sigma 0.0003"
    arguments = f"--soil-strength table {stated}".split()
    main(["table", str(tmp_path), "-o", str(tmp_path / "out"), *arguments])

    recordings = (read_all([tmp_path / "out" / f"{n}.mcap"]) for n in ("new", "before"))
    settings = config.load(tmp_path / "out" / "before.yaml").settings
    fresh, known = recordings
    found = diagnose(rig_of(fresh, settings, known)[0])
    assert found.verdict in ("explained", "unlisted") and found.location
    assert "run" not in {place.covariate for place in found.location}


def test_the_channels_of_a_state_do_not_scatter_together(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("\n".join([HEADER, *rows_of(0.1, "sand")]))
    (tmp_path / "soils.csv").write_text(SOILS)
    main(["table", str(tmp_path), "-o", str(tmp_path / "out")])
    trial = Physical(tmp_path / "out" / "one.mcap")
    read = (trial.force("fx"), trial.force("fz"), trial.value("sinkage_pot"))
    off = [f.reshape(3, -1) - f.reshape(3, -1).mean(axis=1, keepdims=True) for f in read]
    together = np.corrcoef([each.ravel() for each in off])
    assert np.abs(together[np.triu_indices(3, 1)]).max() < 0.3
