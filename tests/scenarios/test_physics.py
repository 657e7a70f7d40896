"""What the wheel may do that the filter must not learn from; the plant is simulated, the whole
pipeline runs.
"""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.config.settings import Uncertain
from gritd.estimator.messages.status import Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.terramechanics import linear
from gritd.estimator.wheel.geometry import entry_angle
from tests.estimator.filter.rig import RIG, TRUTH, run
from tests.linear_plant import THREE_LOADS, readings

QUICK = True  # all seeds in every run
PLANT = "pipeline, plant simulated"
AIR, ZERO, NEGATIVE = "wheel in the air", "zero slip", "negative slip, reverse driving"
STALL, FLAT, DIVERGENCE = "stall (100 % slip)", "θ₁ → 0, f → 0", "filter divergence"
DRIVING = (3.0, 70.0, 0.3)


def estimate_moved(ticks, status):
    """Ticks of this status, and how much the estimate moves over them, in σ."""
    held = [t for t in ticks if t["status"] == status]
    moved = max(
        abs(t[x] - held[0][x]) / t[f"{x}_sigma"] for t in held for x in ("cohesion", "tan_phi")
    )
    return held, moved


def test_wheel_in_the_air(seed, figure):
    _, ticks = run(RIG, TRUTH, [DRIVING, (3.0, 2.0, 0.3), DRIVING], seed)
    held, moved = estimate_moved(ticks, Status.IN_AIR)
    assert len(held) > 20 and not any(t["torque_accepted"] for t in held)
    figure(AIR, PLANT, "movement of c and tan φ while in the air", moved, "σ", 0)


def test_zero_slip(seed, figure):
    """A hundredth of a radian of slip either way: finite, and no certainty out of nothing."""
    rng = random.Random(seed)
    _, ticks = run(
        RIG,
        TRUTH,
        [(4.0, 70.0, slip) for slip in (0.0, rng.uniform(0, 0.01), -rng.uniform(0, 0.01))],
        seed,
    )
    last, truth = ticks[-1], dict(zip(("cohesion", "tan_phi"), TRUTH, strict=False))
    assert all(
        np.isfinite(t[name])
        for t in ticks
        for name in ("cohesion", "cohesion_sigma", "tan_phi", "tan_phi_sigma")
    )
    error = max(abs(last[name] - value) / last[f"{name}_sigma"] for name, value in truth.items())
    kept = last["separability"]
    figure(ZERO, PLANT, "error of c and tan φ", error, "σ", 3)
    assert kept > 0.5, "certain of both from one load at no slip"


def test_negative_slip(seed, figure):
    """The carriage pushes the wheel, up to where the closed forms have no balance any more:
    braking, no update.
    """
    rng = random.Random(seed)
    accepted = 0
    for slip in (-0.1, -0.2, -0.3, -rng.uniform(0.1, 0.35)):
        _, ticks = run(RIG, TRUTH, [DRIVING, (3.0, 70.0, slip)], seed)
        assert sum(t["status"] == Status.BRAKING for t in ticks) > 20
        # from the first whole window on
        accepted += sum(t["torque_accepted"] for t in ticks[32:])
    figure(NEGATIVE, PLANT, "updates accepted while braking", accepted, "", 0)


@pytest.mark.parametrize("slip", [-0.5, -0.8, -1.0])
def test_dragged(seed, slip, figure):
    """Beyond the closed forms, to a locked wheel: a braked run's encoder in smaller steps."""
    pipeline = Pipeline(RIG, "plain")
    state, ticks, slower = pipeline.start(), [], {}
    for number, (t, batch) in enumerate(
        readings(RIG, TRUTH, [DRIVING, (3.0, 70.0, -0.3)], seed=seed)
    ):
        if number >= 30:
            batch = [slowed(r, (1.0 + slip) * 1.3, slower) for r in batch]
        state, tick = pipeline.step(state, batch, t)
        ticks.append(dict(zip(TICK_NAMES, tick, strict=True)))
    assert ticks[-1]["slip"] == pytest.approx(slip, abs=0.02)
    accepted = sum(t["torque_accepted"] or t["drawbar_pull_accepted"] for t in ticks[32:])
    figure(NEGATIVE, PLANT, f"updates accepted at a slip of {slip:g}", accepted, "", 0)


def slowed(reading, factor, turning):
    if reading.channel != "wheel_encoder":
        return reading
    at = turning.setdefault(reading.channel, reading.value)
    return reading._replace(value=at + round((reading.value - at) * factor))


def test_reverse_driving(seed, figure):
    ticks = reversed_run(seed)
    after = [t for t in ticks if t["status"] == Status.REVERSE]
    assert len(after) > 20
    figure(
        NEGATIVE,
        PLANT,
        "updates accepted in reverse",
        sum(t["torque_accepted"] for t in after),
        "",
        0,
    )


def reversed_run(seed):
    """A drive whose encoders run backwards after three seconds."""
    pipeline = Pipeline(RIG, "plain")
    state, ticks, turning = pipeline.start(), [], {}
    for number, (t, batch) in enumerate(readings(RIG, TRUTH, [DRIVING, DRIVING], seed=seed)):
        if number >= 30:
            batch = [mirrored(r, turning) for r in batch]
        state, tick = pipeline.step(state, batch, t)
        ticks.append(dict(zip(TICK_NAMES, tick, strict=True)))
    return ticks


def mirrored(reading, turning):
    if not reading.channel.endswith("encoder"):
        return reading
    at = turning.setdefault(reading.channel, reading.value)
    return reading._replace(value=2 * at - reading.value)


@pytest.mark.parametrize("kind", ["digging", "blocked"])
def test_stall(seed, kind, figure):
    """v = 0 with the wheel turning, and ω = 0 with current: how long until it is called a stall."""
    ticks, stopped = stalled(seed, kind)
    first = next(t for t in ticks if t["status"] == Status.STALL)
    noticed = (first["stamp"] - stopped) * 1e-9
    held, moved = estimate_moved(ticks, Status.STALL)
    assert len(held) > 10
    figure(STALL, PLANT, f"{kind}: until it is classified", noticed, "s", 0.5)
    figure(STALL, PLANT, "movement of c and tan φ meanwhile", moved, "σ", 0)


def stalled(seed, kind):
    pipeline = Pipeline(RIG, "plain")
    state, ticks, frozen, stopped = pipeline.start(), [], {}, None
    channels = ("carriage_encoder",) if kind == "digging" else ("carriage_encoder", "wheel_encoder")
    for number, (t, batch) in enumerate(readings(RIG, TRUTH, [DRIVING, DRIVING], seed=seed)):
        if number >= 30:
            stopped = stopped or t
            batch = [
                r._replace(value=frozen.setdefault(r.channel, r.value))
                if r.channel in channels
                else r
                for r in batch
            ]
        state, tick = pipeline.step(state, batch, t)
        ticks.append(dict(zip(TICK_NAMES, tick, strict=True)))
    return ticks, stopped


def held(reading, frozen):
    return reading._replace(value=frozen.setdefault(reading.channel, reading.value))


def test_vanishing_entry_angle_and_exponent(figure):
    """θ₁ from 0.1 down to 1e-300 and 0, f → 0 with slip → −1: finite, and continuous down to
    nothing.
    """
    angles = [10.0**-power for power in range(1, 301)] + [0.0]
    jump = 0.0
    for slip in (0.3, 0.0, -0.999999, -1.0 + 1e-15):
        forces = [
            linear.forces(RIG.wheel, *TRUTH, angle, slip, 1000.0 * min(angle, 1.0))
            for angle in angles
        ]
        values = np.array([(f.torque, f.drawbar_pull, f.load) for f in forces])
        assert np.all(np.isfinite(values))
        jump = max(jump, float(np.max(np.abs(values[-2] - values[-1]))))
        assert np.all(np.abs(values[1:]) <= np.abs(values[:-1]) * 1.0000001 + 1e-300)
    angle = [entry_angle(RIG.wheel.radius, z) for z in (*angles, -1e-300, -1.0)]
    assert all(np.isfinite(a.value) and np.isfinite(a.d_sinkage) for a in angle)
    figure(FLAT, "closed forms", "jump of any force from θ₁ = 1e-300 to 0", jump, "N", 1e-250)


def test_filter_divergence(seed, figure):
    """A prior that is sure of itself and wrong by more than 10 σ."""
    rng = random.Random(seed)
    wrong = replace(
        RIG.soil,
        cohesion=Uncertain(rng.uniform(200.0, 350.0), 30.0),
        tan_phi=Uncertain(rng.uniform(0.33, 0.40), 0.02),
    )
    _, ticks = run(replace(RIG, soil=wrong), TRUTH, THREE_LOADS, seed)
    first = next(t for t in ticks if t["flags"] & (Flag.MISMATCH | Flag.RESET))
    began = next(t for t in ticks if t["torque_s"] > 0.0)
    error = abs(ticks[-1]["tan_phi"] - TRUTH[1]) / TRUTH[1]
    figure(
        DIVERGENCE,
        PLANT,
        "noticed after the first update",
        (first["stamp"] - began["stamp"]) * 1e-9,
        "s",
        2.0,
    )
    figure(DIVERGENCE, PLANT, "error of tan φ a minute later", error * 100, "%", 2)
    figure(DIVERGENCE, PLANT, "resets until then", ticks[-1]["resets"], "")


def test_no_false_reset(seed, figure):
    """Ten simulated minutes of steady driving with the stated noise."""
    _, ticks = run(RIG, TRUTH, THREE_LOADS * 10, seed)
    figure(DIVERGENCE, PLANT, "false resets in 10 min", ticks[-1]["resets"], "", 0)
