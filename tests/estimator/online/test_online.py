"""An effect at work that is configured does not move c and tan φ: the filter accounts for it."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from gritd.estimator.config.settings import ConfiguredEffect, PeakPrior, Uncertain
from gritd.estimator.effects import EFFECTS
from gritd.estimator.messages.status import Flag
from gritd.tools.testbed.fingerprints import typical
from gritd.tools.testbed.plant import schedule
from gritd.tools.testbed.schedule import motion_of
from gritd.tools.testbed.simulation import simulate_run, soil_of
from tests.estimator.online.rig import SETTINGS, last_tick
from tests.rig import TRIANGLES

pytestmark = pytest.mark.long

SOIL = soil_of(SETTINGS, {"cohesion": 750.0, "tan_phi": 0.62, "shear_modulus": 0.0225})
MOTION = motion_of(schedule(45.0), SETTINGS.wheel.radius, 50.0)
ACTING = sorted(
    name for name, effect in EFFECTS.items() if not effect.filter_only and name != "empirical_law"
)


def configure(effect, sigma=0.0):
    """Every parameter at its value; sigma is relative and goes to the strengths."""
    strengths = {p.name for p in type(effect).parameters() if p.role == "strength"}
    values = {f.name: float(getattr(effect, f.name)) for f in fields(effect)}
    return ConfiguredEffect(
        effect.name,
        {
            key: Uncertain(v, sigma * abs(v) if key in strengths else 0.0)
            for key, v in values.items()
        },
    )


@pytest.fixture(scope="module")
def undisturbed():
    return last_tick(SETTINGS, simulate_run(SETTINGS, SOIL, MOTION, (), 1).readings)


@pytest.mark.parametrize("name", ACTING)
def test_a_configured_effect_leaves_c_and_tan_phi_where_they_are(name, undisturbed):
    """Drivetrain and sensor effects are undone: within one σ of the run without the effect. The
    others within two.
    """
    effect = typical(EFFECTS[name])
    readings = simulate_run(SETTINGS, SOIL, MOTION, (effect,), 1).readings
    known = last_tick(replace(SETTINGS, effects=(*SETTINGS.effects, configure(effect))), readings)
    for quantity in ("cohesion", "tan_phi"):
        sigma = max(each[f"{quantity}_sigma"] for each in (known, undisturbed))
        away = abs(known[quantity] - undisturbed[quantity]) / sigma
        assert away < (1.0 if effect.stage in ("drivetrain", "sensor") else 2.0), quantity
    assert not int(known["flags"]) & Flag.PRIOR
    # a contact that relaxes begins with a transient that nobody knows the history of
    assert not known["resets"] or name == "contact_relaxation"


@pytest.mark.parametrize("name", ["coulomb_friction", "force_crosstalk", "rear_contact"])
def test_an_effect_that_is_not_configured_is_noticed(name, undisturbed):
    """Otherwise the test above would prove nothing."""
    readings = simulate_run(SETTINGS, SOIL, MOTION, (typical(EFFECTS[name]),), 1).readings
    blind = last_tick(SETTINGS, readings)
    assert int(blind["flags"]) & Flag.PRIOR
    assert blind["cohesion"] == SETTINGS.soil.cohesion.value


def test_an_uncertain_loss_widens_the_estimate_and_covers_the_error(undisturbed):
    """Friction known to 30 %, and 30 % wrong: c errs, inside its σ."""
    effect = typical(EFFECTS["coulomb_friction"])
    readings = simulate_run(SETTINGS, SOIL, MOTION, (effect,), 1).readings
    wrong = configure(replace(effect, loss=0.7 * effect.loss), sigma=0.3 / 0.7)
    known = last_tick(replace(SETTINGS, effects=(*SETTINGS.effects, wrong)), readings)
    assert known["cohesion_sigma"] > undisturbed["cohesion_sigma"]
    for quantity, truth in (("cohesion", 750.0), ("tan_phi", 0.62)):
        assert abs(known[quantity] - truth) < 2.5 * known[f"{quantity}_sigma"], quantity


@pytest.mark.parametrize("exponent", [0.9, 1.25])
def test_an_exponent_that_is_a_sigma_off_leaves_c_and_tan_phi_right(exponent):
    soil = replace(SETTINGS.soil, exponent=Uncertain(exponent, 0.2))
    readings = simulate_run(SETTINGS, SOIL, MOTION, (), 1).readings
    loose = last_tick(replace(SETTINGS, soil=soil), readings)
    for quantity, truth in (("cohesion", 750.0), ("tan_phi", 0.62)):
        assert abs(loose[quantity] - truth) < 2.5 * loose[f"{quantity}_sigma"], quantity


@pytest.mark.parametrize("c1, c2", [(0.43, 0.15), (0.55, -0.05)])
def test_a_stress_peak_that_is_not_where_it_is_thought_leaves_c_and_tan_phi_right(c1, c2):
    """The plant's peak is at θ₁/2."""
    readings = simulate_run(SETTINGS, SOIL, MOTION, (), 1).readings
    wheel = replace(SETTINGS.wheel, c1=c1, c2=c2)
    open_form = replace(SETTINGS, wheel=wheel, peak=PeakPrior(0.07, 0.12))
    loose = last_tick(open_form, readings)
    assert not int(loose["flags"]) & Flag.PRIOR
    for quantity, truth in (("cohesion", 750.0), ("tan_phi", 0.62)):
        assert abs(loose[quantity] - truth) < 2.5 * loose[f"{quantity}_sigma"], quantity


def test_the_true_stresses_belong_to_every_configuration_that_does_not_switch_them_off(
    undisturbed,
):
    readings = simulate_run(SETTINGS, SOIL, MOTION, (), 1).readings
    implied = last_tick(replace(SETTINGS, effects=()), readings)
    assert implied["cohesion"] == undisturbed["cohesion"]

    bare = last_tick(replace(SETTINGS, effects=(TRIANGLES,)), readings)
    assert bare["cohesion"] < 0.75 * 750.0 or int(bare["flags"]) & Flag.PRIOR
    assert undisturbed["cohesion"] == pytest.approx(750.0, rel=0.1)
    assert undisturbed["tan_phi"] == pytest.approx(0.62, rel=0.03)


def test_motion_covers_what_separates():
    assert len(np.unique(np.round(np.asarray(MOTION.load)))) >= 3


def test_a_counter_that_does_not_start_at_nought_is_no_place_on_the_bed():
    """A run that begins where one ended before: what acts along the path begins with the run."""
    effect = typical(EFFECTS["running_in"])
    readings = simulate_run(SETTINGS, SOIL, MOTION, (effect,), 1).readings
    settings = replace(SETTINGS, effects=(*SETTINGS.effects, configure(effect)))
    moved = [
        r._replace(value=r.value + 50_000) if r.channel == "carriage_encoder" else r
        for r in readings
    ]
    first, second = last_tick(settings, readings), last_tick(settings, moved)
    assert second["carriage_position"] > first["carriage_position"] + 0.5
    for quantity in ("cohesion", "tan_phi"):
        assert abs(second[quantity] - first[quantity]) < 1e-3 * first[f"{quantity}_sigma"], quantity
