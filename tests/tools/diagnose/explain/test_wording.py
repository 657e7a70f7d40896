"""What a misfit is reported to be, in words."""

from __future__ import annotations

import numpy as np
import pytest

from gritd.tools.diagnose.explain.wording import along_covariate, described, sentence
from gritd.tools.diagnose.fit.shape import Shape
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan
from tests.tools.diagnose.rig import drives

BY_RUN = Shape("torque", ("run",), "smooth")


@pytest.fixture(scope="module")
def stack() -> Stack:
    drawn = plan(standstill=False)
    return Stack(wheel_rig(record(drawn, []), drawn.settings))


def test_a_misfit_that_is_one_in_every_run_is_told_once(stack: Stack) -> None:
    shown = sentence(stack, np.full(stack.size, 0.5), BY_RUN, "run", 0.99)
    assert shown.startswith("Torque, in all runs 0.50 N·m more than the model")


def test_one_that_differs_from_run_to_run_is_told_of_each(stack: Stack) -> None:
    shown = sentence(stack, 0.1 * (1.0 + stack.run), BY_RUN, "run", 0.99)
    assert "from run to run" in shown
    assert "0.10 N·m more" in shown and "0.30 N·m more" in shown


def test_a_misfit_beside_a_reference_is_that_of_the_new_campaign() -> None:
    """Half of the values are the reference's, which has none of it."""
    before, after = (plan(standstill=False, seed=seed) for seed in (1, 2))
    signals = [*record(before, []), *record(after, [])]
    both = Stack(wheel_rig(signals, after.settings, len(signals) // 2, "same"))
    everywhere = Shape("torque", ("constant",), "smooth")
    shown = sentence(both, np.where(both.new, 0.8, 0.0), everywhere, "constant", 0.99)
    assert shown.startswith("Torque, everywhere 0.80 N·m more than the model")


def test_a_drive_without_soil_has_no_bed_and_no_ground() -> None:
    """Neither in what is said of a place on its turn nor in what is proposed of it."""
    drive = Stack(drives.rig(drives.log()))
    step = Shape("torque", ("position",), "step", at=0.0)
    told = [described(step, drive.rig.units)]
    told.append(sentence(drive, drive.covariate("position"), step, "position", 0.99))
    told.append(along_covariate(drive, drive.covariate("position"), "torque", "position"))

    menu = drive.rig.words.menu
    of_rivals = [
        key
        for one in drive.rig.effects.values()
        for other, key in one.confusable_with.items()
        if other in drive.rig.effects
    ]
    shown = [*drive.rig.runs[0].covariates, "run"]
    along = [menu.along[name] for name in shown if name in menu.along]
    told += [menu.said[key] for key in (*along, menu.otherwise, *of_rivals)]
    said = " ".join(told).split()
    assert not {"bed", "ground", "soil", "rut", "wheel", "slip"} & set(said)
