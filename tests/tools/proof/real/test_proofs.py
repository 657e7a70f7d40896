"""The proofs on real recordings say today what docs/real-recordings.md says of them; misses are
not asserted, nor hidden.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.recording.salvage import read
from gritd.tools.commands.import_rig import main
from gritd.tools.diagnose.rig.drive import drive_rig
from gritd.tools.diagnose.rig.signals import drive_series
from gritd.tools.proof.real import chrono, cmu, ding, emps, mgst, steered
from gritd.tools.proof.real.bench import CommandBench
from gritd.tools.proof.real.proof import Check, Finding, Proof
from tests.real_recordings import REAL, needs
from tests.tools.diagnose.rig.drives import fitted


def proved(proof: Proof, folder: Path) -> tuple[Finding, dict[str, Check]]:
    """What a proof found, and the judge's questions by how they begin."""
    finding = proof.run(CommandBench(REAL, folder))
    assert finding.diagnoses and all(s.text.startswith("verdict: ") for s in finding.diagnoses)
    assert finding.table.rows and finding.panels
    return finding, {a.question.split(",")[0].split("?")[0]: a for a in finding.checks}


@needs("emps")
def test_the_adapter_of_a_drive_recovers_the_published_parameters(tmp_path: Path) -> None:
    assert main(["emps", str(REAL / "emps" / "DATA_EMPS.mat"), "-o", str(tmp_path)]) == 0
    settings = config.load(tmp_path / "emps.yaml").settings
    found = fitted(
        drive_rig([drive_series(read(tmp_path / "data-emps.mcap"), settings)], ["EMPS"], settings)
    )
    for name, (value, _) in zip(
        ("inertia", "damping", "loss"), emps.PUBLISHED.values(), strict=True
    ):
        assert found[name] == pytest.approx(value, rel=0.03), name


@needs("emps")
@pytest.mark.slow
def test_emps_names_the_friction_and_recovers_the_published_parameters(tmp_path: Path) -> None:
    _, checks = proved(emps.FRICTION, tmp_path)
    for question in (
        "Which friction does it name first",
        "M",
        "Fv",
        "Fc",
        "Does it say that something remains",
    ):
        assert checks[question].met, f"{question}: {checks[question].answer}"
    assert checks["Is the force of the unseen log predicted better"].met


@needs("ding")
@pytest.mark.slow
def test_ding_finds_that_sinkage_grows_with_slip(tmp_path: Path) -> None:
    finding, checks = proved(ding.STRENGTH, tmp_path)
    assert checks["Does it find that sinkage grows with slip"].met
    _, _, fitted, found = map(float, finding.table.rows[-1][-1].split(" / "))
    assert found < 0.3 * fitted, "error of the sinkage with the effect, and without"


@needs("cmu")
@pytest.mark.slow
def test_cmu_predicts_the_pull_of_unseen_states_of_the_other_wheel(tmp_path: Path) -> None:
    finding, checks = proved(cmu.GROUSERS, tmp_path)
    smooth = finding.diagnoses[0]
    assert "slip_sinkage" in smooth.group, "the smooth wheel sinks deeper with slip"
    assert checks["Does it name grousers"].met
    assert checks["Is nothing said of the frame's yielding that the rigid stop denies"].met
    assert checks["Is the sinkage [mm] of unseen states predicted better"].met
    assert checks["Is the drawbar pull [N] of unseen states predicted better"].met


@needs("cmu")
@pytest.mark.slow
def test_cmu_names_a_wheel_that_is_turned_from_its_travel(tmp_path: Path) -> None:
    _, checks = proved(steered.STEERED, tmp_path)
    for angle in steered.ANGLES:
        assert checks[f"Which effect does it name first at {angle}°"].met


@needs("mgst")
@pytest.mark.slow
def test_mgst_places_the_misfit_of_a_concealed_drivetrain_in_the_torque(tmp_path: Path) -> None:
    _, checks = proved(mgst.DRIVETRAIN, tmp_path)
    assert checks["Is torque among the channels that differ"].met


@needs("mgst")
@pytest.mark.slow
def test_mgst_places_the_misfit_of_a_concealed_wall_in_the_drawbar_pull(tmp_path: Path) -> None:
    _, checks = proved(mgst.SIDE_WALL, tmp_path)
    assert checks["Is drawbar_pull among the channels that differ"].met


@needs("chrono")
@pytest.mark.slow
def test_chrono_counts_the_lugs_and_names_the_patch(tmp_path: Path) -> None:
    _, checks = proved(chrono.TERRAIN, tmp_path)
    for question in (
        "Lugs: what does it name first",
        "How many lugs",
        "Is the cohesion within two sigma",
        "Is the tan φ within two sigma",
        "A patch: what does it name",
    ):
        assert checks[question].met, f"{question}: {checks[question].answer}"
