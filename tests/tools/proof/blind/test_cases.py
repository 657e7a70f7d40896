"""Drawing cases, what they hand over, and how visible what they conceal is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from gritd.estimator.config import configuration as config
from gritd.estimator.recording.salvage import read
from gritd.tools.proof.blind import cases, detect, handover, strata
from gritd.tools.proof.blind.detect import Detector
from gritd.tools.proof.blind.groups import CONFOUNDED, GROUPS, alike
from gritd.tools.proof.blind.plant.concealed import ABSORBED, LISTED, UNLISTED
from gritd.tools.proof.blind.plant.concealed.friction import BristleFriction
from gritd.tools.proof.blind.plant.concealed.zeros import BentOffset
from gritd.tools.proof.blind.strata import Assignment


@pytest.fixture(scope="module")
def null() -> cases.Case:
    """A case with nothing concealed, force sensor on."""
    return cases.drawn(
        1, 7, Assignment("none", without=(("wrench", True), ("runs", 2), ("standstill", True)))
    )


def test_a_batch_holds_every_stratum_in_its_share() -> None:
    drawn = strata.assignments(300, np.random.default_rng(1))
    counts = {name: sum(a.stratum == name for a in drawn) for name in strata.STRATA}
    assert len(drawn) == 300 and counts["none"] >= 90
    singles = [a for a in drawn if a.stratum == "single"]
    assert {a.effects[0] for a in singles} == set(LISTED)
    assert {a.level for a in singles} == set(strata.LEVELS)
    assert {a.effects[0] for a in drawn if a.stratum == "absorbed"} == set(ABSORBED)
    assert {a.effects[0] for a in drawn if a.stratum == "unlisted"} == set(UNLISTED)
    for a in drawn:
        assert a.stratum != "two" or a.effects[1] not in alike(a.effects[0])


def test_the_groups_name_effects_that_exist() -> None:
    for group in GROUPS:
        assert group <= set(LISTED)
    for first, second, _ in CONFOUNDED:
        assert second in alike(first) or (first, second) == ("pulley_slip", "wheel_radius_error")


def test_a_case_is_its_seed_and_no_other_is() -> None:
    assignment = Assignment("unlisted", ("cable_drag",), "medium", (("wrench", True), ("runs", 1)))
    first, again, other = (cases.drawn(1, seed, assignment) for seed in (5, 5, 6))
    assert first.answers() == again.answers()
    assert first.answers() != other.answers()


def test_strength_follows_detectability() -> None:
    case = cases.drawn(1, 5, Assignment("two", ("coulomb_friction",), "strong", (("runs", 2),)))
    wanted = detect.LIMIT * strata.LEVELS["strong"]
    assert case.detectability == pytest.approx(wanted, rel=0.1)
    detector = Detector(case.trial)
    half = replace(case.effects[0], strength=0.5 * case.effects[0].strength)
    assert detector.detectability([half]) == pytest.approx(0.5 * case.detectability, rel=0.05)


def test_what_is_off_is_invisible(null: cases.Case) -> None:
    detector = Detector(null.trial)
    facts = detector.facts()
    for form in [form for forms in (LISTED | UNLISTED).values() for form in forms]:
        off = replace(form.drawn(np.random.default_rng(1), facts), strength=0.0)
        assert detector.detectability([off]) < 0.05, form.__name__


def test_an_offset_within_its_calibration_is_invisible(null: cases.Case) -> None:
    """What the stated calibration error explains is not evidence."""
    detector, sigma = Detector(null.trial), null.trial.known.instruments["motor_shunt"].offset.sigma
    assert detector.detectability([BentOffset(sigma)]) < 1.0
    assert detector.detectability([BentOffset(300 * sigma)]) > 20.0


def test_standstill_tells_friction_from_offset() -> None:
    rng, left = np.random.default_rng(0), {}
    for standstill in (False, True):
        habits = (
            ("standstill", standstill),
            ("lifted", False),
            ("reversal", False),
            ("runs", 3),
            ("loads", 3),
        )
        trial = cases.drawn(1, 3, Assignment("none", without=habits)).trial
        detector = Detector(trial)
        effect, found = detect.strengthened(
            detector, BristleFriction(2.0 * detector.facts().torque), 60.0
        )
        left[standstill] = (
            detector.beside(detector.change([effect]), detector.rivals("current_offset", rng))
            / found
        )

    assert left[False] < 0.1 < left[True]


def test_what_is_handed_over_reads_as_a_testbeds_own(null: cases.Case, tmp_path: Path) -> None:
    files = handover.write(null, tmp_path / "given")
    loaded = config.load(tmp_path / "given" / handover.CONFIGURATION)
    true, told = null.trial.world.ground, loaded.settings.soil

    assert told.cohesion.value != true.cohesion
    assert abs(told.cohesion.value - float(true.cohesion)) < 3.0 * told.cohesion.sigma

    at_rest = read(files[0]).arrays("/raw/motor_shunt")["volts"][:200].mean()
    shunt = loaded.settings.channels["motor_shunt"].calibration
    assert (
        abs(at_rest * shunt.scale.value + shunt.offset.value) < 3.0 * shunt.offset.sigma
    )  # zeroed at rest

    recording = read(files[0])
    assert recording.complete and not recording.damage

    for topic in ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt", "wrench"):
        rows = recording.arrays(f"/raw/{topic}")
        seconds = np.ptp(rows["stamp"]) * 1e-9
        assert 0.97 * 250 < rows.size / seconds < 1.005 * 250
        assert np.all(np.diff(rows["stamp"].astype(np.int64)) > -2_000_000)


def test_what_is_handed_over_does_not_tell(tmp_path: Path) -> None:
    case = cases.drawn(
        1, 9, Assignment("single", ("bed_slope",), "strong", (("wrench", True), ("runs", 1)))
    )
    handover.write(case, tmp_path / "given")
    text = (tmp_path / "given" / handover.CONFIGURATION).read_text(encoding="utf-8")
    info = read(tmp_path / "given" / "run-1.mcap").run
    for word in ("bed_slope", "single", "strong", "weak", case.family):
        assert word not in text and word not in str(info)
    assert set(yaml.safe_load(text)["effects"]) == {"stress_linearisation"}


def test_the_truth_is_the_recording_without_its_noise(null: cases.Case, tmp_path: Path) -> None:
    recording = read(handover.write(null, tmp_path / "given")[0])
    said = config.load(tmp_path / "given" / handover.CONFIGURATION).settings.channels["sinkage_pot"]
    truth, rows = handover.truth(null, 0), recording.arrays("/raw/sinkage_pot")
    at = (rows["stamp"].astype(np.int64) - handover.begins(null, 0)) * 1e-9 - said.latency
    read_off = rows["volts"] * said.calibration.scale.value + said.calibration.offset.value
    residual = read_off - np.interp(at, truth["time"], truth["sinkage"])
    noise = null.trial.known.instruments["sinkage_pot"].noise * said.calibration.scale.value
    assert np.std(residual[100:-100]) < 1.5 * noise
    assert abs(np.mean(residual[100:-100])) < 0.5 * noise


def test_stated_noise_is_wrong_by_two_in_some_cases_but_more_often_in_nulls() -> None:
    rng = np.random.default_rng(1)
    wrong = {
        nothing: [cases.noise_factor(nothing, rng) for _ in range(400)] for nothing in (True, False)
    }
    assert set(wrong[True]) == set(wrong[False]) == {0.5, 1.0, 2.0}
    assert 0.4 < np.mean([factor != 1.0 for factor in wrong[True]]) < 0.6
    assert 0.2 < np.mean([factor != 1.0 for factor in wrong[False]]) < 0.4
