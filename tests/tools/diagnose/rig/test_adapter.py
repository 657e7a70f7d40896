"""Which campaigns can be compared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.tools.cli.command import CommandError
from gritd.tools.diagnose.rig.adapter import _check_drives
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.weights import MEASURED_NOTE
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

FILES = cast(Any, [SimpleNamespace(path=Path("one.mcap"))])


def _without(signals: Signals, *names: str) -> Signals:
    kept = {n: v for n, v in signals.analogue.items() if n not in names}
    return replace(signals, analogue=kept)


@pytest.mark.parametrize("missing", ["current", "drawbar_pull", "sinkage"])
@pytest.mark.parametrize("new", [False, True])
def test_a_channel_that_one_campaign_did_not_measure_is_no_obstacle(
    missing: str, new: bool
) -> None:
    before, after = record(plan(), ()), record(plan(seed=5), ())
    poorer = [_without(s, missing, "axle_torque") for s in (after if new else before)]
    runs = [*before, *poorer] if new else [*poorer, *after]
    rig = wheel_rig(runs, settings(), len(before), "same")
    for campaign in (False, True):
        _check_drives(rig, campaign, FILES)


def test_a_channel_that_was_measured_while_the_wheel_stood_is_one() -> None:
    still = [
        replace(s, wheel_speed=0.0 * s.wheel_speed, carriage_rate=0.0 * s.carriage_rate)
        for s in record(plan(), ())
    ]
    rig = wheel_rig(still, settings())
    assert np.isfinite(rig.runs[0].measured["drawbar_pull"]).all()
    with pytest.raises(CommandError, match=r"^one\.mcap: found no value of .* drives steadily"):
        _check_drives(rig, True, FILES)


def test_a_rig_without_motor_current_has_no_torque() -> None:
    rig = wheel_rig([_without(s, "current") for s in record(plan(), ())], settings())
    assert "torque" not in rig.channels and "axle_torque" in rig.channels


def test_weights_that_only_the_sensor_tells_are_a_note_once() -> None:
    runs = [replace(s, info=replace(s.info, nominal_load=None)) for s in record(plan(), ())]
    rig = wheel_rig(runs, settings())
    assert rig.words.caveats.count(MEASURED_NOTE) == 1 and "load" not in rig.channels


def test_a_measured_load_holds_the_friction_of_its_axis_already() -> None:
    """A configuration that states the friction changes nothing where the load is measured."""
    runs = [replace(s, info=replace(s.info, nominal_load=None)) for s in record(plan(), ())]
    plain = settings()
    friction = ConfiguredEffect("load_axis_friction", {"friction": Uncertain(3.0, 0.5)})
    sticky = wheel_rig(runs, replace(plain, effects=(friction,)))
    rig = wheel_rig(runs, plain)
    u = np.zeros(len(rig.constants))
    assert len(sticky.constants) == len(rig.constants)
    assert "load_axis_friction" not in sticky.effects
    for one, other in zip(sticky.predict(u, ()), rig.predict(u, ()), strict=True):
        assert np.array_equal(one["sinkage"], other["sinkage"])


def test_the_noise_of_a_measured_load_is_noise_of_what_follows_it() -> None:
    runs = record(plan(), ())
    stated, measured = (
        wheel_rig([replace(s, info=replace(s.info, nominal_load=w)) for s, w in each], settings())
        for each in (
            [(s, s.info.nominal_load) for s in runs],
            [(s, None) for s in runs],
        )
    )
    for one, other in zip(stated.motion_sigma, measured.motion_sigma, strict=True):
        assert np.all(other["sinkage"] >= one["sinkage"])
        assert np.mean(other["sinkage"]) > 1.5 * np.mean(one["sinkage"])
