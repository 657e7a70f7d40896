"""A wheel that is skewed to its travel, on the independent plant, whose force sensor has an fy."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.config.settings import Calibration, Settings, Uncertain
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.signals import read_all
from gritd.tools.main import main
from gritd.tools.proof.blind import strata
from gritd.tools.proof.blind.cases import BlindCase, drawn
from gritd.tools.proof.blind.handover import CONFIGURATION, driven, write
from gritd.tools.proof.blind.plant.concealed.rim import SkewedWheel


@pytest.fixture(scope="module")
def skewed(tmp_path_factory: pytest.TempPathFactory) -> tuple[BlindCase, list[Path], Settings]:
    """What is true, the recordings, and the configuration, which knows of no side force. Of the
    plant's two forms that whose side force follows from β: in a circle of friction its size tells
    nothing of β.
    """
    assignment = strata.Assignment(
        "usual", effects=("side_slip",), level=strata.USUAL, without=(("wrench", True),)
    )
    cases = (drawn(seed, seed, assignment) for seed in count(18))
    case = next(case for case in cases if isinstance(case.effects[0], SkewedWheel))
    folder = tmp_path_factory.mktemp("skewed") / "given"
    recordings = write(case, driven(case), folder)
    return case, recordings, load(folder / CONFIGURATION).settings


def shown(settings: Settings, scale: float) -> Settings:
    """With a calibration of fy."""
    assert settings.wrench is not None
    known = Calibration(Uncertain(scale, 0.002), Uncertain(0.0, settings.wrench.force_noise))
    return replace(settings, wrench=replace(settings.wrench, side_force=known))


def test_soil_and_wheel_have_no_left_and_right(
    skewed: tuple[BlindCase, list[Path], Settings],
) -> None:
    _, files, settings = skewed
    recordings = read_all(files)
    left, right = (rig_of(recordings, shown(settings, s))[0].runs for s in (1.0, -1.0))
    for one, other in zip(left, right, strict=True):
        used = one.used["side_force"]
        np.testing.assert_array_equal(used, other.used["side_force"])
        ours, theirs = (run.measured["side_force"][used] for run in (one, other))
        np.testing.assert_allclose(ours, theirs)


def test_a_side_force_without_calibration_is_recorded_only(
    skewed: tuple[BlindCase, list[Path], Settings],
) -> None:
    _, files, settings = skewed
    assert "side_force" not in rig_of(read_all(files), settings)[0].channels


def test_what_only_a_side_force_tells_is_not_sought_without_one(
    skewed: tuple[BlindCase, list[Path], Settings],
) -> None:
    """A wheel that may yield and dig sideways as it likes passes for many others."""
    _, files, settings = skewed
    recordings = read_all(files)
    rigs = [rig_of(recordings, own)[0] for own in (settings, shown(settings, 1.0))]
    without, having = ({p.name for p in rig.effects["side_slip"].parameters()} for rig in rigs)
    assert having - without == {"across", "digging", "pushing"} and "angle" in without


def test_check_config_shows_the_axis_and_refuses_a_scale_of_nil(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = packaged().read_text(encoding="utf-8")
    shutil.copy(packaged("testbed.dbc"), tmp_path)
    for scale, code in (("0", 2), ("0.5", 0)):
        path = tmp_path / "bench.yaml"
        stated = f"  wrench:\n    side_force: {{scale: {scale}}}\n"
        path.write_text(re.sub(r"  wrench:.*\n", stated, whole, count=1), encoding="utf-8")
        assert main(["check-config", str(path)]) == code
        said = capsys.readouterr()
        assert "side_force" in (said.out if code == 0 else said.err)


@pytest.mark.long
def test_a_skewed_wheel_is_named_by_its_side_force(
    skewed: tuple[BlindCase, list[Path], Settings],
) -> None:
    case, files, settings = skewed
    found = diagnose(rig_of(read_all(files), shown(settings, 1.0))[0])
    first = found.hypotheses[0]
    assert (found.verdict, first.effect) == ("explained", "side_slip")
    angle = first.parameters["angle"]
    assert abs(angle.value - abs(case.effects[0].strength)) < 2.0 * angle.sigma
