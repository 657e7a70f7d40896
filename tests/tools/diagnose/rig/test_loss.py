"""Where motor and axle torque are both measured, what is lost between them is read off: the soil
has no part in it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.tools.diagnose.fit.discrepancy import _columns
from gritd.tools.diagnose.method import diagnose, fit_base
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.recorded import measured_of
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import HOLDING_NOTE, LOSS_NOTE, wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import group, plan, settings

pytestmark = pytest.mark.long

LOSS = 0.8  # [N·m]


def _rig(*acting: str) -> Rig:
    effects = tuple(make(name, {"loss": LOSS}) for name in acting)
    return wheel_rig(record(plan(), effects), settings())


def test_torque_is_what_is_lost() -> None:
    rig = _rig("coulomb_friction")
    assert {"torque", "axle_torque"} <= set(rig.channels)
    assert LOSS_NOTE in rig.words.caveats
    run = rig.runs[0]
    driving = run.used["torque"] & (run.covariates["speed"] > 0.0)
    assert float(np.median(run.measured["torque"][driving])) == pytest.approx(LOSS, rel=0.3)


def test_a_ripple_of_either_torque_is_one_of_what_is_lost() -> None:
    """Where the loss is not read off, a ripple of the axle's sensor is none of the motor's."""
    rig, apart = _rig(), wheel_rig(record(plan(), ()), settings(), read_off=False)
    assert rig.recorded("torque") == ("torque", "axle_torque")
    assert {channel: apart.recorded(channel) for channel in apart.channels} == {
        channel: (channel,) for channel in apart.channels
    }


def test_an_idle_motor_is_compared_without_the_axles_sensor() -> None:
    """At rest the axle's torque is nil: its noise tells nothing of what the motor loses."""
    signals = record(plan(), ())
    rig, constant = wheel_rig(signals, settings()), settings().drive.torque_constant.value
    for run, one in zip(rig.runs, signals, strict=True):
        resting = run.covariates["speed"] == 0.0
        idle = run.used["torque"] & resting
        assert idle.any()
        assert np.array_equal((run.idle > 0.0) & run.used["torque"], idle)
        motor = measured_of(one, "torque", constant)
        np.testing.assert_array_equal(run.measured["torque"][idle], motor[idle])
        assert np.array_equal(run.used["axle_torque"] & resting, idle)

    noise = fit_base(rig).problem.noise
    stack = noise.stack
    own = stack.of("torque")
    assert noise.loose[own & stack.idle].max() < 0.8 * np.median(noise.loose[own & ~stack.idle])


def test_an_axle_that_holds_torque_at_rest_is_not_idle() -> None:
    def held(one: Signals) -> Signals:
        axle = one.analogue["axle_torque"]
        return replace(one, analogue={**one.analogue, "axle_torque": axle + 1.0})

    rig = wheel_rig([held(one) for one in record(plan(), ())], settings())
    assert rig.loss_of_drive
    assert not Stack(rig).idle.any()


def test_a_torque_that_a_servo_holds_at_rest_is_no_offset() -> None:
    """A wheel on lugs: the current at rest differs from run to run by more than its noise."""
    signals = record(plan(), ())
    second = signals[1]
    standing = np.abs(second.wheel_speed) < 1e-3
    current = second.analogue["current"] + np.where(standing, 0.2, 0.0)
    signals[1] = replace(second, analogue={**second.analogue, "current": current})

    rig = wheel_rig(signals, settings())
    assert HOLDING_NOTE in rig.words.caveats
    assert not any(r.used["torque"][r.covariates["speed"] == 0.0].any() for r in rig.runs)
    assert HOLDING_NOTE not in wheel_rig(record(plan(), ()), settings()).words.caveats


def test_soil_does_not_change_the_loss() -> None:
    rig = _rig()
    u = np.zeros(len(rig.constants))
    names = [constant.name for constant in rig.constants]
    before = rig.predict(u, ())
    u[names.index("c")] = u[names.index("tan_phi")] = 2.0
    after = rig.predict(u, ())
    for was, now in zip(before, after, strict=True):
        np.testing.assert_allclose(now["torque"], was["torque"], atol=1e-9)
        assert np.abs(now["axle_torque"] - was["axle_torque"]).max() > 0.05


def test_the_drives_discrepancy_is_no_friction() -> None:
    stack = Stack(_rig())
    drive = next(source for source in stack.rig.forms if source.drive)
    assert drive.channels == ("torque",)
    columns = _columns(stack, drive)
    weight = stack.joined([dict.fromkeys(stack.rig.channels, w) for w in drive.weight])
    own = stack.of("torque")
    for friction in (weight[own], np.sign(weight[own])):
        np.testing.assert_allclose(columns[own].T @ friction, 0.0, atol=1e-6)


def test_without_axle_torque_the_motors_is_compared() -> None:
    signals = [
        replace(s, analogue={n: v for n, v in s.analogue.items() if n != "axle_torque"})
        for s in record(plan(), ())
    ]
    rig = wheel_rig(signals, settings())
    assert LOSS_NOTE not in rig.words.caveats
    assert not any(source.drive for source in rig.forms)


@pytest.mark.parametrize("noise", [1e-9, 1e-3])
def test_sensors_that_hardly_hiss_show_nothing_where_nothing_is_amiss(noise: float) -> None:
    """A drive that loses nothing is read off as nought: its noise has the scale of the torques, and
    not that of their difference.
    """
    rig = wheel_rig(record(plan(noise=noise), ()), settings())
    assert rig.loss_of_drive
    assert diagnose(rig, quick=True).verdict == "consistent"


def test_a_motor_without_axle_torque_beside_it_is_compared_with_the_model() -> None:
    """Friction of later runs, whose torque behind the drive was not measured, is found."""
    friction = (make("coulomb_friction", {"loss": LOSS}),)
    first = record(plan(), ())
    later = [_without_axle(s) for s in record(plan(seed=5), friction)]

    rig = wheel_rig([*first, *later], settings(), len(first), "same")
    assert not rig.loss_of_drive
    assert all(run.used["torque"].any() for run in rig.runs)

    found = diagnose(rig, quick=True)
    assert found.verdict == "explained"
    assert "coulomb_friction" in group(found)


def _without_axle(signals: Signals) -> Signals:
    kept = {n: v for n, v in signals.analogue.items() if n != "axle_torque"}
    return replace(signals, name=f"later-{signals.name}", analogue=kept)


def test_play_shows_in_the_few_values_after_a_reversal() -> None:
    """Soil and motion have not settled there, but the loss between two torques needs no soil."""
    found = diagnose(
        wheel_rig(record(plan(reverse=True), (make("backlash", {"gap": 0.05}),)), settings())
    )
    assert [h.effect for h in found.hypotheses if h.accepted] == ["backlash"], found.summary


def test_an_inertia_shows_where_the_wheel_starts() -> None:
    """Soil has not settled then, but the loss between two torques needs none."""
    inertia = (make("wheel_inertia", {"inertia": 0.6}),)
    found = diagnose(wheel_rig(record(plan(speeds=(0.03, 0.03, 0.03)), inertia), settings()))
    assert [h.effect for h in found.hypotheses if h.accepted] == ["wheel_inertia"], found.summary
