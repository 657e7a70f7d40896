"""The filter on a rig that the equations miss by a learnt δ: it corrects by δ's mean, and does not
take for known what δ leaves open.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.config.settings import Uncertain
from gritd.estimator.filter.learnt_soil import learnt_soil
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.status import Flag
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online import checkpoint
from gritd.estimator.online.bed import fingerprint
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.topics import TICK_TOPIC
from gritd.tools.testbed.plant import schedule
from gritd.tools.testbed.schedule import motion_of
from gritd.tools.testbed.simulation import simulate_run, soil_of
from tests import forms
from tests.estimator.online.rig import SETTINGS

TRUE = {"cohesion": 750.0, "tan_phi": 0.62, "shear_modulus": 0.0225}
SOIL = soil_of(SETTINGS, TRUE)
MOTION = motion_of(schedule(45.0), SETTINGS.wheel.radius, 50.0)
DRIVEN = forms.driven(MOTION, SETTINGS.wheel.radius, 24)
KNOWN = forms.form(1, where=DRIVEN)
KEPT = ("torque", "drawbar_pull", "sinkage")


def certain(form):
    """The same mean, with nothing left open inside the domain."""
    none = {
        name: replace(
            getattr(form, name),
            spread=tuple((0.0,) * len(form.points) for _ in range(form.directions)),
            rest=0.0,
        )
        for name in KEPT
    }
    return replace(form, **none)


def drawn(form, rng):
    """A δ from what is left open of it: the mean moved along every direction, alike in all."""
    amount = rng.standard_normal(form.directions)
    moved = {}
    for name in KEPT:
        channel = getattr(form, name)
        mean = np.array(channel.mean) + amount @ np.array(channel.spread)
        moved[name] = replace(channel, mean=tuple(mean.tolist()))
    return replace(form, **moved)


def readings_of(form, seed=1):
    """Of a rig that has this δ."""
    return simulate_run(replace(SETTINGS, discrepancy=form), SOIL, MOTION, (), seed).readings


def ticks(settings, readings, engine=None, restored=None):
    """Bytes of all ticks as recorded, and the last of them by name; restored: the tick at which the
    state is written and read back.
    """
    pipeline = Pipeline(settings, engine)
    state, t, batch, reported, tick = (
        pipeline.start(),
        readings[0].received + 100_000_000,
        [],
        [],
        (),
    )
    for reading in readings:
        while reading.received > t:
            state, tick = pipeline.step(state, batch, t)
            reported.append(TICK_TOPIC.codec.encode(tick))
            batch, t = [], t + 100_000_000
            if len(reported) == restored:
                state = checkpoint.decode(checkpoint.encode(state), pipeline.settings)
        batch.append(reading)
    return reported, dict(zip(TICK_NAMES, tick, strict=True))


def off(last):
    """Errors of c and tan φ over their σ."""
    pairs = [("cohesion", 750.0), ("tan_phi", 0.62)]
    return np.array([(last[name] - true) / last[f"{name}_sigma"] for name, true in pairs])


def test_the_mean_of_delta_brings_c_and_tan_phi_back():
    """And without it the filter is off, or says that it does not believe itself."""
    readings = readings_of(KNOWN)
    known = ticks(replace(SETTINGS, discrepancy=certain(KNOWN)), readings)[1]
    blind = ticks(SETTINGS, readings)[1]
    assert np.all(np.abs(off(known)) < 2.0) and not known["resets"]
    assert known["cohesion_sigma"] < 0.75 * SETTINGS.soil.cohesion.sigma
    assert int(blind["flags"]) & Flag.PRIOR or np.abs(off(blind)).max() > 3.0


@pytest.mark.long
def test_what_delta_leaves_open_is_not_averaged_away():
    """δ drawn anew for every rig from what is left open: σ is true of the errors."""
    wide = forms.form(1, size=0.15, where=DRIVEN)
    form = replace(wide, **{n: replace(getattr(wide, n), rest=0.0) for n in KEPT})
    rng, errors = np.random.default_rng(5), []
    for seed in range(8):
        readings = readings_of(drawn(form, rng), seed)
        errors.append(off(ticks(replace(SETTINGS, discrepancy=form), readings)[1]))
    assert np.mean(np.abs(errors) <= 2.0) >= 0.9
    assert np.sqrt(np.mean(np.square(errors))) < 1.3


def test_a_state_read_back_goes_on_to_the_same_bits():
    settings, readings = replace(SETTINGS, discrepancy=KNOWN), readings_of(KNOWN)
    assert ticks(settings, readings)[0] == ticks(settings, readings, restored=130)[0]


def test_both_engines_say_the_same():
    settings, readings = replace(SETTINGS, discrepancy=KNOWN), readings_of(KNOWN)
    plain, filterpy = (ticks(settings, readings, engine)[1] for engine in ("plain", "filterpy"))
    for name in ("cohesion", "cohesion_sigma", "tan_phi", "tan_phi_sigma"):
        assert plain[name] == pytest.approx(filterpy[name], rel=1e-6)


def known_with(correlation=-0.4, among=(-0.3, 0.0, 0.0)):
    soil = SETTINGS.soil
    values = soil.cohesion.value, soil.tan_phi.value, soil.shear_modulus.value
    learnt = forms.soil(values, correlation=correlation, among=among)
    return replace(SETTINGS, discrepancy=replace(KNOWN, soil=learnt))


def test_the_filter_begins_with_the_correlation_of_soil_and_delta():
    prior = Tracker(known_with(), "plain").prior
    sigma = np.sqrt(np.diag(prior.P))
    assert prior.P[0][1] == pytest.approx(-0.3 * sigma[0] * sigma[1])
    columns = Tracker(known_with(), "plain").measurement.learnt_columns
    P = np.array(prior.P)
    assert P[0, columns] == pytest.approx((-0.4 * sigma[0], 0.0, 0.0))
    P[:3, :3] = P[:3, columns] = 0.0
    assert not P[:3].any()


def test_another_soil_is_independent_of_delta():
    settings = known_with()
    other = replace(settings.soil, cohesion=Uncertain(950.0, 200.0))
    assert learnt_soil(settings) is not None
    assert learnt_soil(replace(settings, soil=other)) is None
    P = np.array(Tracker(replace(settings, soil=other), "plain").prior.P)
    assert not P[:3, 3:].any()


def test_a_soil_that_delta_was_learnt_with_is_learnt_less_of():
    """What the campaign showed is the sum of both; a filter that took them for independent would
    learn c from it a second time.
    """
    readings = readings_of(KNOWN)
    joint = ticks(known_with(-0.9, (0.0, 0.0, 0.0)), readings)[1]
    independent = ticks(replace(SETTINGS, discrepancy=KNOWN), readings)[1]
    assert joint["cohesion_sigma"] != independent["cohesion_sigma"]


def test_a_bed_is_another_with_another_delta():
    bare = fingerprint(SETTINGS)
    assert bare != fingerprint(replace(SETTINGS, discrepancy=KNOWN))
    assert fingerprint(replace(SETTINGS, discrepancy=None)) == bare
