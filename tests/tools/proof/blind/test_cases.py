"""Drawing cases, what they hand over, and how visible what they conceal is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from gritd.estimator.config import configuration as config
from gritd.estimator.effects.library import EFFECTS
from gritd.estimator.recording.salvage import read
from gritd.tools.proof.blind import cases, detect, handover, knowledge, strata
from gritd.tools.proof.blind.detect import Detector
from gritd.tools.proof.blind.groups import CONFOUNDED, GROUPS, alike
from gritd.tools.proof.blind.plant.concealed import ABSORBED, LISTED, UNLISTED
from gritd.tools.proof.blind.plant.concealed.friction import BristleFriction
from gritd.tools.proof.blind.plant.concealed.zeros import BentOffset
from gritd.tools.proof.blind.plant.worlds import HELD, PAPER, WORLDS
from gritd.tools.proof.blind.strata import Assignment

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def null() -> cases.BlindCase:
    """A case with nothing concealed, force sensor on."""
    return cases.drawn(
        1, 7, Assignment("none", without=(("wrench", True), ("runs", 2), ("standstill", True)))
    )


def test_a_batch_holds_every_stratum_in_its_share() -> None:
    drawn = strata.assignments(300, np.random.default_rng(1))
    counts = {name: sum(a.stratum == name for a in drawn) for name in strata.STRATA}
    assert len(drawn) == 300 and all(counts.values())
    assert sum(not a.effects for a in drawn) >= 100  # nothing new
    singles = [a for a in drawn if a.stratum == "single"]
    assert {a.effects[0] for a in singles} == set(LISTED)
    assert {a.level for a in singles} == set(strata.LEVELS)
    assert {a.effects[0] for a in drawn if a.stratum == "absorbed"} == set(ABSORBED)
    assert {a.effects[0] for a in drawn if a.stratum == "unlisted"} == set(UNLISTED)
    assert {a.level for a in drawn if a.stratum == "awkward"} == {a.level for a in strata.AWKWARD}
    for a in drawn:
        assert a.stratum != "two" or a.effects[1] not in alike(a.effects[0])
        assert a.world == PAPER or a.stratum in ("foreign", "pair", "table")


def test_pairs_are_in_every_world_and_a_third_has_nothing_new() -> None:
    pairs = strata.assignments(108, np.random.default_rng(2), ("pair",))
    for world in WORLDS:
        inside = [a for a in pairs if a.world == world]
        assert len(inside) == 18
        assert sum(not a.effects for a in inside) == 6
        assert any(name in UNLISTED for a in inside for name in a.effects)
    assert all(a.pair and a.bed in strata.BEDS for a in pairs)
    assert len({name for a in pairs for name in a.effects}) > 30


def test_what_a_world_has_of_its_own_is_not_new_in_it() -> None:
    for a in strata.assignments(300, np.random.default_rng(3), ("foreign", "pair", "table")):
        assert not set(a.effects) & set(HELD[a.world])
        assert "multipass" not in a.effects or a.world != "strips"


def test_worlds_can_be_chosen() -> None:
    drawn = strata.assignments(40, np.random.default_rng(4), worlds=("strips", PAPER))
    assert {a.world for a in drawn if a.stratum == "foreign"} == {"strips"}
    assert {a.world for a in drawn if a.stratum == "pair"} == {"strips", PAPER}


def test_every_effect_of_the_library_is_asked_for_in_two_forms() -> None:
    assert set(LISTED) == set(EFFECTS) - {"stress_linearisation", "empirical_law"}
    assert all(len(forms) >= 2 for forms in LISTED.values())


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


def test_what_is_as_strong_as_on_a_testbed_is_so_however_well_it_shows() -> None:
    drawn = strata.assignments(41, np.random.default_rng(6), ("usual",))
    assert {a.effects for a in drawn} == {(name,) for name in LISTED}
    for seed in range(4):
        case = cases.drawn(1, seed, Assignment("usual", ("coulomb_friction",), strata.USUAL))
        (effect,) = case.effects
        most = 0.6 * Detector(case.trial).facts().torque
        assert 0.2 * most <= effect.strength <= 0.6 * most
        assert case.single == (pytest.approx(Detector(case.trial).detectability([effect])),)


def test_what_is_off_is_invisible(null: cases.BlindCase) -> None:
    detector = Detector(null.trial)
    facts = detector.facts()
    for form in [form for forms in (LISTED | UNLISTED).values() for form in forms]:
        off = replace(form.drawn(np.random.default_rng(1), facts), strength=0.0)
        assert detector.detectability([off]) < 0.05, form.__name__


def test_an_offset_within_its_calibration_is_invisible(null: cases.BlindCase) -> None:
    """What the stated calibration error explains is not evidence."""
    detector, sigma = Detector(null.trial), null.trial.known.instruments["motor_shunt"].offset.sigma
    assert detector.detectability([BentOffset(sigma)]) < 1.0
    assert detector.detectability([BentOffset(300 * sigma)]) > 20.0


def test_standstill_tells_friction_from_offset() -> None:
    rng, left = np.random.default_rng(0), {}
    for standstill in (False, True):
        design = (
            ("standstill", standstill),
            ("lifted", False),
            ("reversal", False),
            ("runs", 3),
            ("loads", 3),
        )
        trial = cases.drawn(1, 3, Assignment("none", without=design)).trial
        detector = Detector(trial)
        effect, found = detect.strengthened(
            detector, BristleFriction(2.0 * detector.facts().torque), 60.0
        )
        left[standstill] = (
            detector.beside(detector.change([effect]), detector.rivals("current_offset", rng))
            / found
        )

    assert left[False] < 0.1 < left[True]


def handed_over(case: cases.BlindCase, folder: Path) -> list[Path]:
    return handover.write(case, handover.driven(case), folder)


def test_what_is_handed_over_reads_as_a_testbeds_own(null: cases.BlindCase, tmp_path: Path) -> None:
    files = handed_over(null, tmp_path / "given")
    loaded = config.load(tmp_path / "given" / handover.CONFIGURATION)
    true, reported = null.trial.world.ground, loaded.settings.soil

    assert reported.cohesion.value != true.cohesion
    assert abs(reported.cohesion.value - float(true.cohesion)) < 3.0 * reported.cohesion.sigma

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
    without = (("wrench", True), ("runs", 2))
    case = cases.drawn(
        1, 9, Assignment("pair", ("bed_slope",), "strong", without, "relaxation", "prepared")
    )
    files = handed_over(case, tmp_path / "given")
    text = (tmp_path / "given" / handover.CONFIGURATION).read_text(encoding="utf-8")
    for info in (read(file).run for file in files):
        for word in ("bed_slope", "relaxation", "prepared", "strong", "weak", case.family):
            assert word not in text and word not in str(info)
    assert set(yaml.safe_load(text)["effects"]) == {"stress_linearisation"}


def test_a_pair_is_two_campaigns_of_one_rig(tmp_path: Path) -> None:
    """The reference knows nothing of what is new, and calibration errors are the same."""
    without = (("wrench", True), ("runs", 2), ("lifted", False))
    assignment = Assignment("pair", ("current_offset",), "strong", without, bed="prepared")
    case = cases.drawn(1, 9, assignment)
    before, after = handover.driven(case)
    assert (before.folder, after.folder) == (handover.REFERENCE, handover.NEW)
    assert not before.trial.world.effects and after.trial.world.effects
    assert before.trial.chain is after.trial.chain and before.trial.known is after.trial.known
    assert before.begins[-1] < after.begins[0] and before.trial.runs != after.trial.runs
    one, other = before.trial.world.ground, after.trial.world.ground
    assert one != other
    assert float(other.tan_phi) == pytest.approx(float(one.tan_phi), rel=0.03)

    files = handover.write(case, [before, after], tmp_path / "given")
    places = [str(file.relative_to(tmp_path / "given")) for file in files]
    assert places == [f"{f}/run-{n}.mcap" for f in ("reference", "new") for n in (1, 2)]
    assert len({read(file).run.name for file in files}) == 4


def test_tables_hold_the_steady_states_of_a_pair_and_nothing_of_the_course(tmp_path: Path) -> None:
    (assignment,) = {
        a
        for a in strata.assignments(7, np.random.default_rng(1), ("table",), (PAPER,))
        if a.effects == strata.LUGS and a.level == "strong"
    }
    case = cases.drawn(1, 9, assignment)
    assert cases.detect.LIMIT * strata.LEVELS["strong"] == pytest.approx(case.single[0], rel=0.1)

    before, after = handover.driven(case)
    files = handover.write(case, [before, after], tmp_path / "given")
    assert [file.parent.name for file in files] == [handover.REFERENCE, handover.NEW]
    for file, campaign in zip(files, (before, after), strict=True):
        table = (tmp_path / "given" / "tables" / f"{campaign.folder}.csv").read_text().splitlines()
        assert len(table) == 1 + sum(len(run.stretches) for run in campaign.trial.runs)
        assert read(file).run.steady_states
    text = (tmp_path / "given" / handover.CONFIGURATION).read_text(encoding="utf-8")
    assert "grousers" not in text


def test_on_the_same_bed_the_soil_is_the_same() -> None:
    case = cases.drawn(1, 9, Assignment("pair", without=(("runs", 2),), bed="same"))
    assert case.reference is not None
    assert case.reference.world.ground is case.trial.world.ground


def test_a_load_that_is_weighed_is_not_stated(tmp_path: Path) -> None:
    (assignment,) = (a for a in strata.AWKWARD if a.level == "load measured")
    case = cases.drawn(1, 9, assignment)
    infos = [read(file).run for file in handed_over(case, tmp_path / "given")]
    assert all(info.nominal_load is None for info in infos)


def test_a_load_that_changes_within_a_run_is_weighed_too(tmp_path: Path) -> None:
    (assignment,) = (a for a in strata.AWKWARD if a.level == "loads in a run")
    case = cases.drawn(1, 9, assignment)
    assert all(len({s.weight for s in run.stretches}) > 1 for run in case.trial.runs)
    infos = [read(file).run for file in handed_over(case, tmp_path / "given")]
    assert all(info.nominal_load is None for info in infos)


def test_slow_noise_is_as_large_and_correlated(null: cases.BlindCase) -> None:
    (before,) = (c for c in null.trial.chain.converters if c.channel == "sinkage_pot")
    (after,) = (
        c for c in knowledge.slowed(null.trial.chain).converters if c.channel == "sinkage_pot"
    )
    drawn = after.noise.drawn(np.random.default_rng(1), 250_000, 4e-3)
    assert np.std(drawn) == pytest.approx(
        np.hypot(before.noise.white, before.noise.colour), rel=0.1
    )
    means = drawn.reshape(-1, 25).mean(axis=1)
    assert np.corrcoef(means[1:], means[:-1])[0, 1] == pytest.approx(0.95, abs=0.02)


def test_the_truth_is_the_recording_without_its_noise(
    null: cases.BlindCase, tmp_path: Path
) -> None:
    (alone,) = handover.driven(null)
    recording = read(handover.write(null, [alone], tmp_path / "given")[0])
    said = config.load(tmp_path / "given" / handover.CONFIGURATION).settings.channels["sinkage_pot"]
    truth, rows = handover.truth(alone, 0), recording.arrays("/raw/sinkage_pot")
    at = (rows["stamp"].astype(np.int64) - alone.begins[0]) * 1e-9 - said.latency
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
