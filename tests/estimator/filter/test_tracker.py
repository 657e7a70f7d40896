"""The filter finds c and tan φ, and its σ means what it says."""

from __future__ import annotations

from dataclasses import replace
from math import exp, log

import numpy as np
import pytest

from gritd.estimator.config.settings import Uncertain
from gritd.estimator.messages.status import UPDATED, Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from tests.estimator.filter.rig import RIG, SLOW, TRUTH, run
from tests.linear_plant import ONE_LOAD, THREE_LOADS, readings
from tests.rig import calibration


def error(track, truth):
    """Error of [c/kPa, tan φ, ln k], and its covariance."""
    x = np.array(track.estimate.x[:3])
    return x - (truth[0] / 1e3, truth[1], log(truth[2])), np.array(track.estimate.soil_P)


def drawn(settings, seed):
    """A soil from the prior."""
    rng, soil = np.random.default_rng(seed), settings.soil
    c = max(soil.cohesion.value + soil.cohesion.sigma * rng.normal(), 50.0)
    tan_phi = soil.tan_phi.value + soil.tan_phi.sigma * rng.normal()
    ln_k = (
        log(soil.shear_modulus.value)
        + soil.shear_modulus.sigma / soil.shear_modulus.value * rng.normal()
    )
    return c, tan_phi, exp(ln_k)


def with_peak_drawn(settings, seed):
    """A rig whose stress peaks where the stated σ of c₁ and c₂ allow."""
    rng, peak = np.random.default_rng(seed), settings.peak
    c1 = settings.wheel.c1 + peak.c1_sigma * float(rng.normal())
    c2 = settings.wheel.c2 + peak.c2_sigma * float(rng.normal())
    return replace(settings, wheel=replace(settings.wheel, c1=c1, c2=c2))


def normalised(settings, schedule, runs):
    """Normalised estimation error squared of (c, tan φ), one a run, each with its own soil, stress
    peak and noise.
    """
    squares = []
    for seed in range(runs):
        truth, plant = drawn(settings, 1000 + seed), with_peak_drawn(settings, 2000 + seed)
        e, P = error(run(settings, truth, schedule, seed, plant=plant)[0], truth)
        squares.append(e[:2] @ np.linalg.solve(P[:2, :2], e[:2]))
    return np.array(squares)


def test_three_loads_find_c_within_5_and_tan_phi_within_2_percent():
    track, ticks = run(RIG, TRUTH, THREE_LOADS)
    e, P = error(track, TRUTH)
    assert abs(e[0] * 1e3) < 0.05 * TRUTH[0] and abs(e[1]) < 0.02 * TRUTH[1]
    assert abs(e[0]) < 2 * P[0, 0] ** 0.5 and abs(e[1]) < 2 * P[1, 1] ** 0.5
    assert not ticks[-1]["flags"] & Flag.NOT_SEPARABLE and ticks[-1]["flags"] & Flag.K_ESTIMATED


@pytest.mark.parametrize("factor", [0.85, 1.15])
def test_a_prior_of_k_15_percent_off_leaves_both_inside_2_sigma(factor):
    soil = replace(RIG.soil, shear_modulus=Uncertain(0.025 * factor, 0.00375))
    e, P = error(run(replace(RIG, soil=soil), TRUTH, THREE_LOADS)[0], TRUTH)
    assert abs(e[0]) < 2 * P[0, 0] ** 0.5 and abs(e[1]) < 2 * P[1, 1] ** 0.5


@pytest.mark.parametrize("slip", [0.2, 0.3, 0.45])
def test_one_slip_leaves_c_tan_phi_and_k_inside_2_sigma(slip):
    """Two measurements do not tell three unknowns: what k gains is what the priors give."""
    e, P = error(run(RIG, TRUTH, [(10.0, 70.0, slip)])[0], TRUTH)
    assert np.all(np.abs(e) < 2 * np.sqrt(np.diag(P)))


@pytest.mark.parametrize("share", [0.1, 0.03])
def test_sensors_louder_than_stated_leave_the_soil_inside_2_sigma(share):
    """The noise of a sensor is what a bench's configuration knows least well."""
    channels = {name: replace(c, noise=share * c.noise) for name, c in RIG.channels.items()}
    assert RIG.wrench is not None
    wrench = replace(RIG.wrench, force_noise=share * RIG.wrench.force_noise)
    stated = replace(RIG, channels=channels, wrench=wrench)
    track, ticks = run(stated, TRUTH, THREE_LOADS, seed=5)
    off, covariance = error(track, TRUTH)
    assert ticks[-1]["resets"] == 0 and not int(ticks[-1]["flags"]) & Flag.PRIOR
    assert all(abs(off) < 2.0 * np.sqrt(np.diag(covariance)))


def test_one_load_is_said_not_to_separate():
    _, ticks = run(RIG, TRUTH, [(20.0, 70.0, 0.3)])
    assert ticks[-1]["status"] == Status.TRACKING
    assert ticks[-1]["flags"] & Flag.NOT_SEPARABLE and ticks[-1]["separability"] > 0.5


@pytest.mark.long
def test_one_load_keeps_the_truth_inside_the_joint_ellipse():
    squares = normalised(RIG, ONE_LOAD[:5], 20)
    assert np.mean(squares < 5.99) >= 0.85


@pytest.mark.long
def test_40_runs_are_consistent():
    """Mean normalised estimation error squared of (c, tan φ) over 40 runs: not above the 95 % band
    of χ²(80)/40, and not far below. This plant has none of the error of form that the filter
    allows for.
    """
    squares = normalised(RIG, THREE_LOADS, 40)
    print(f"NEES {squares.mean():.2f} of 2, inside the 95 % ellipse {np.mean(squares < 5.99):.1%}")
    assert 1.0 < squares.mean() < 2.67


def test_both_engines_agree_to_1e_9_over_a_long_run():
    soft = replace(
        RIG,
        channels={
            **SLOW,
            "sinkage_pot": replace(
                SLOW["sinkage_pot"], calibration=calibration(0.01, -0.002, offset_sigma=2e-4)
            ),
        },
    )
    plain, ticks = run(soft, TRUTH, THREE_LOADS, engine="plain")
    filterpy, others = run(soft, TRUTH, THREE_LOADS, engine="filterpy")
    np.testing.assert_allclose(plain.estimate.x, filterpy.estimate.x, rtol=1e-9)
    np.testing.assert_allclose(plain.estimate.P, filterpy.estimate.P, rtol=1e-7, atol=1e-16)
    for name in ("cohesion", "tan_phi", "shear_modulus", "torque_s"):
        np.testing.assert_allclose([t[name] for t in ticks], [t[name] for t in others], rtol=1e-9)


def test_a_sinkage_datum_of_unknown_offset_leaves_the_truth_inside_the_ellipse():
    """The potentiometer reads 0.5 mm too deep; its calibration says ± 0.5 mm."""
    pot = replace(SLOW["sinkage_pot"], calibration=calibration(0.01, -0.002, offset_sigma=5e-4))
    stated = replace(RIG, channels={**SLOW, "sinkage_pot": pot})
    wrong = replace(
        stated,
        channels={
            **SLOW,
            "sinkage_pot": replace(pot, calibration=calibration(0.01, -0.0015, offset_sigma=5e-4)),
        },
    )
    pipeline = Pipeline(wrong, "plain")
    state = pipeline.start()
    for t, batch in readings(stated, TRUTH, THREE_LOADS, seed=1):
        state, _ = pipeline.step(state, batch, t)
    e, P = error(state.track, TRUTH)
    assert e[:2] @ np.linalg.solve(P[:2, :2], e[:2]) < 5.99


@pytest.mark.parametrize(
    "schedule, status",
    [
        ([(2.0, 70.0, 0.3), (2.0, 70.0, 1.0)], Status.STALL),
        ([(2.0, 70.0, 0.3), (2.0, 2.0, 0.3)], Status.IN_AIR),
    ],
)
def test_a_window_that_teaches_nothing_freezes_the_estimate(schedule, status):
    _track, ticks = run(RIG, TRUTH, schedule)
    assert ticks[-1]["status"] == status
    frozen = [t for t in ticks if t["status"] == status]
    assert len({(t["cohesion"], t["tan_phi"], t["cohesion_sigma"]) for t in frozen}) == 1


def test_every_field_of_the_record_is_filled_in_order():
    _, ticks = run(RIG, TRUTH, THREE_LOADS[:2])
    assert list(ticks[-1]) == list(TICK_NAMES)
    missing = [name for name, value in ticks[-1].items() if value != value]
    assert missing == ["temperature"]


def test_an_update_leaves_its_account():
    _, ticks = run(RIG, TRUTH, THREE_LOADS[:2])
    tick = ticks[-1]
    assert tick["torque_accepted"] and tick["drawbar_pull_accepted"]
    assert tick["torque_s"] > tick["torque_r"] > 0.0
    assert tick["torque_test_ratio"] == pytest.approx(
        tick["torque_innovation"] ** 2 / (25.0 * tick["torque_s"])
    )


def test_an_outlier_is_gated_and_said_to_be():
    pipeline = Pipeline(RIG, "plain")
    state, gated = pipeline.start(), []
    for t, batch in readings(RIG, TRUTH, [(10.0, 70.0, 0.3)], seed=2):
        if t % 5_000_000_000 == 0:
            batch = [
                r._replace(value=r.value + 0.5) if r.channel == "motor_shunt" else r for r in batch
            ]
        before = state.track.estimate
        state, tick = pipeline.step(state, batch, t)
        fields = dict(zip(TICK_NAMES, tick, strict=True))
        if fields["flags"] & Flag.GATED and not fields["torque_accepted"]:
            gated.append(abs(state.track.estimate.x[1] - before.x[1]))
    assert gated and max(gated) < 0.01


def test_a_prior_that_is_far_too_sure_is_noticed():
    soil = replace(RIG.soil, cohesion=Uncertain(300.0, 5.0), tan_phi=Uncertain(0.35, 0.001))
    _, ticks = run(replace(RIG, soil=soil), TRUTH, THREE_LOADS[:3])
    driven = [k for k, tick in enumerate(ticks) if tick["status"] in UPDATED]
    first = next(k for k, tick in enumerate(ticks) if tick["flags"] & Flag.MISMATCH)
    assert first <= driven[0] + 25  # 2 s


def altered(settings, schedule, change, seed=2):
    """The ticks of a run whose readings between 5 and 8 s are changed."""
    pipeline = Pipeline(settings, "plain")
    state, ticks = pipeline.start(), []
    for number, (t, batch) in enumerate(readings(settings, TRUTH, schedule, seed=seed)):
        batch = [change(r) for r in batch] if 50 <= number < 80 else batch
        state, tick = pipeline.step(state, [r for r in batch if r is not None], t)
        ticks.append(dict(zip(TICK_NAMES, tick, strict=True)))
    return ticks


def test_a_spike_is_no_reason_to_forget_the_soil():
    pipeline = Pipeline(RIG, "plain")
    state, sigmas = pipeline.start(), []
    for number, (t, batch) in enumerate(readings(RIG, TRUTH, THREE_LOADS, seed=2)):
        if number == 420:
            batch = [
                r._replace(value=r.value + 0.5) if r.channel == "motor_shunt" else r for r in batch
            ]
        state, tick = pipeline.step(state, batch, t)
        sigmas.append(dict(zip(TICK_NAMES, tick, strict=True))["cohesion_sigma"])
    assert state.track.resets == 0 and sigmas[425] < 1.1 * sigmas[415]


@pytest.mark.parametrize("sigmas", [-3.0, 3.0])
def test_a_calibration_as_wrong_as_it_may_be_does_not_reset_the_filter(sigmas):
    """Its innovations keep one sign for the whole run: they are not twenty independent ones."""
    shunt = SLOW["motor_shunt"]
    offset = Uncertain(shunt.calibration.offset.value, 0.05)
    stated = replace(shunt, calibration=replace(shunt.calibration, offset=offset))
    wrong = replace(
        stated,
        calibration=replace(stated.calibration, offset=Uncertain(offset.value + sigmas * 0.05)),
    )
    pipeline = Pipeline(replace(RIG, channels={**SLOW, "motor_shunt": stated}), "plain")
    state = pipeline.start()
    for t, batch in readings(
        replace(RIG, channels={**SLOW, "motor_shunt": wrong}), TRUTH, THREE_LOADS, seed=3
    ):
        state, _ = pipeline.step(state, batch, t)
    assert state.track.resets == 0


NAN = float("nan")
LOST = {
    "a silent encoder": ("wheel_encoder", None),
    "a potentiometer out of range": ("sinkage_pot", 1e3),
    "a saturated wrench": ("wrench", (0.0, 0.0, 1e9, 0.0, 0.0, 0.0)),
    "a wrench of NaN": ("wrench", (NAN,) * 6),
}


@pytest.mark.parametrize("name", LOST)
def test_a_channel_that_says_nothing_usable_is_stale_until_it_does(name):
    channel, value = LOST[name]

    def change(reading):
        if reading.channel != channel:
            return reading
        return None if value is None else reading._replace(value=value)

    ticks = altered(RIG, [(12.0, 100.0, 0.3)], change)
    lost = ticks[56:80]
    assert {tick["status"] for tick in lost} == {Status.STALE}
    assert len({tick["cohesion"] for tick in lost}) == 1
    assert ticks[-1]["status"] == Status.TRACKING and ticks[-1]["resets"] == 0
    assert not any(tick["flags"] & Flag.GATED for tick in ticks[80:])


@pytest.mark.parametrize("depth, used", [(0.99, True), (1.01, False)])
def test_a_wheel_deeper_than_its_axle_has_no_entry_angle(depth, used):
    pot = replace(SLOW["sinkage_pot"], high=10.0)
    settings = replace(RIG, channels={**SLOW, "sinkage_pot": pot})
    volts = (depth * RIG.wheel.radius + 0.002) / 0.01

    def sunk(reading):
        if reading.channel != "sinkage_pot":
            return reading
        # with a little of its noise: what does not move is stuck
        return reading._replace(value=volts + reading.value % 1e-3)

    deep = altered(settings, [(12.0, 100.0, 0.3)], sunk)[60:80]
    expected = {*UPDATED, Status.UNSTEADY} if used else {Status.UNCERTAIN}
    assert {tick["status"] for tick in deep} <= expected


def test_a_wrench_without_torque_is_stale_where_the_torque_is_its():
    settings = replace(RIG, drive=replace(RIG.drive, torque_source="wrench"))

    def mute(reading):
        return (
            reading._replace(value=(*reading.value[:4], NAN, 0.0))
            if reading.channel == "wrench"
            else reading
        )

    ticks = altered(settings, [(12.0, 100.0, 0.3)], mute)
    assert {tick["status"] for tick in ticks[56:80]} == {Status.STALE}
    assert np.isfinite(ticks[-1]["consistency"])
