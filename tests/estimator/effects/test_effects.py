"""Every effect of the folder: off is the identity, on is finite and continuous, it shows where it
says it shows.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from gritd.estimator import effects as library
from gritd.estimator.config.effects import configured, quantities
from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.estimator.config.units import unit
from gritd.estimator.effects import EFFECTS, in_order, make
from gritd.estimator.effects.base import EXPERIMENTS, STAGES, Effect, Parameter
from gritd.estimator.model.forward import Response, corrected, simulate_arrays
from gritd.estimator.stages.situation import (
    Balanced,
    ContactLaw,
    Motion,
    Powered,
    Sensed,
    advanced,
    situation_of,
)
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.testbed.fingerprints import SOIL, WHEEL, campaign, ramped, shown, typical
from tests.rig import BALANCED

NAMES = sorted(EFFECTS)
FORWARD = [name for name in NAMES if not EFFECTS[name].filter_only]
DESIGN = set(
    [
        "rear_contact",
        "stress_peak_shift",
        "shear_peak",
        "rate_dependent_shear",
        "sidewall_friction",
        "bulldozing",
        "grousers",
        "wheel_eccentricity",
        "wheel_inertia",
        "slip_sinkage",
        "multipass",
        "soil_patch",
        "drying_cohesion",
        "rate_dependent_sinkage",
        "bed_slope",
        "frame_compliance",
        "load_axis_friction",
        "side_wall_rubbing",
        "coulomb_friction",
        "viscous_friction",
        "stribeck_friction",
        "asymmetric_friction",
        "gear_ripple",
        "motor_heating",
        "torque_constant_error",
        "current_offset",
        "sinkage_datum",
        "sinkage_gain",
        "wheel_radius_error",
        "pulley_slip",
        "force_crosstalk",
        "sensor_latency",
        "stress_linearisation",
        "empirical_law",
        "backlash",
        "bed_inclination",
        "contact_relaxation",
        "hub_runout",
        "load_dependent_friction",
        "rim_friction",
        "running_in",
        "sensor_drift",
        "side_slip",
    ]
)


def run_of_everything() -> Motion:
    """Standstill, both directions, braking, stall, lifted wheel and a heavy load, with ramps
    between.
    """
    rows = np.array(
        [  # load [N], ω [rad/s], v [m/s]
            (40.0, 0.0, 0.0),
            (40.0, 0.3, 0.015),
            (90.0, 0.3, 0.03),
            (90.0, 0.5, 0.0),
            (0.0, 0.4, 0.02),
            (30.0, -0.3, -0.01),
            (60.0, -0.2, -0.02),
            (20.0, 0.02, 0.0005),
        ]
    )
    time = np.arange(0.0, 4.0 * len(rows), 0.04)
    load, speed, travel = (ramped(time, column) for column in rows.T)
    return Motion(
        time,
        np.cumsum(speed) * 0.04,
        speed,
        np.cumsum(travel) * 0.04,
        travel,
        load,
        pass_number=2.0,
        temperature=25.0,
    )


@pytest.fixture(scope="module")
def hard_run() -> Motion:
    return run_of_everything()


def every(response: Response) -> dict[str, Array]:
    """All arrays of a response, readings included."""
    own = {f.name: getattr(response, f.name) for f in fields(response) if f.name != "sensed"}
    return own | {
        f"sensed.{f.name}": getattr(response.sensed, f.name) for f in fields(response.sensed)
    }


def corners(parameters: tuple[Parameter, ...], rng: np.random.Generator) -> list[dict[str, float]]:
    """Both ends and the middle of the box, and draws from inside it."""
    ends = [{p.name: p.low for p in parameters}, {p.name: p.high for p in parameters}]
    return ends + [
        {p.name: float(rng.uniform(p.low, p.high)) for p in parameters} for _ in range(4)
    ]


def test_the_library_is_complete() -> None:
    assert set(NAMES) >= DESIGN


@pytest.mark.parametrize("name", NAMES)
def test_is_described(name: str) -> None:
    effect = EFFECTS[name]
    assert effect.name == name and effect.stage in STAGES
    assert effect.sentence().endswith(".") and "Source:" in effect.formula()
    assert set(effect.confusable_with) <= set(EFFECTS) - {name}
    assert set(effect.confusable_with.values()) <= set(EXPERIMENTS)
    for parameter in effect.parameters():
        unit(parameter.unit)
        assert parameter.low <= parameter.centre <= parameter.high and parameter.sigma > 0.0
        assert parameter.low <= parameter.centre + parameter.sigma <= parameter.high
    assert any(parameter.role == "strength" for parameter in effect.parameters())


@pytest.mark.parametrize("name", NAMES)
def test_off_is_the_identity(name: str, hard_run: Motion) -> None:
    plain = every(simulate_arrays(WHEEL, SOIL, hard_run))
    for shapes in corners(
        tuple(p for p in EFFECTS[name].parameters() if p.role == "shape"), np.random.default_rng(1)
    ):
        off = every(simulate_arrays(WHEEL, SOIL, hard_run, (make(name, shapes),)))
        for channel, values in plain.items():
            assert np.array_equal(off[channel], values), channel


@pytest.mark.parametrize("name", FORWARD)
def test_finite_over_the_whole_box(name: str, hard_run: Motion) -> None:
    for values in corners(EFFECTS[name].parameters(), np.random.default_rng(2)):
        for channel, array in every(
            simulate_arrays(WHEEL, SOIL, hard_run, (make(name, values),))
        ).items():
            assert np.isfinite(array).all(), (channel, values)


@pytest.mark.parametrize("name", FORWARD)
def test_continuous_in_its_parameters(name: str, hard_run: Motion) -> None:
    """A tiny step of a parameter is a tiny step of every channel, from anywhere in the box and from
    the off value.
    """
    parameters = EFFECTS[name].parameters()
    inside = [
        {p.name: 0.8 * p.centre + 0.2 * edge(p) for p in parameters} for edge in (_low, _high)
    ]
    for values in ({p.name: p.centre for p in parameters}, *inside):
        before = every(simulate_arrays(WHEEL, SOIL, hard_run, (make(name, values),)))
        for p in parameters:
            step = 1e-7 * (p.high - p.low)
            moved = {
                **values,
                p.name: values[p.name] + step if values[p.name] + step <= p.high else p.high - step,
            }
            after = every(simulate_arrays(WHEEL, SOIL, hard_run, (make(name, moved),)))
            for channel, array in before.items():
                change = np.abs(after[channel].astype(float) - array.astype(float))
                assert np.max(change) < 1e-3 * (1.0 + np.max(np.abs(array))), (
                    channel,
                    p.name,
                    values,
                )


def _low(p: Parameter) -> float:
    return p.low


def _high(p: Parameter) -> float:
    return p.high


@pytest.mark.parametrize("name", FORWARD)
def test_shows_where_it_says(name: str) -> None:
    found, claim = shown(typical(EFFECTS[name])), EFFECTS[name].fingerprint
    assert found.channel() == claim.channel, found.strength
    assert found.stands_out(claim.channel, claim.covariate), found.share[claim.channel]


@pytest.mark.parametrize("name", FORWARD)
def test_each_strength_does_something(name: str, hard_run: Motion) -> None:
    plain = every(simulate_arrays(WHEEL, SOIL, hard_run))
    for p in (p for p in EFFECTS[name].parameters() if p.role == "strength"):
        on = every(simulate_arrays(WHEEL, SOIL, hard_run, (make(name, {p.name: p.off + p.sigma}),)))
        assert any(not np.array_equal(on[channel], plain[channel]) for channel in plain), p.name


def test_composes_in_any_order_of_listing(hard_run: Motion) -> None:
    rng = np.random.default_rng(7)
    for _ in range(5):
        some = [typical(EFFECTS[name]) for name in rng.choice(NAMES, 6, replace=False)]
        first = every(simulate_arrays(WHEEL, SOIL, hard_run, some))
        other = every(simulate_arrays(WHEEL, SOIL, hard_run, some[::-1]))
        for channel in first:
            assert (
                np.array_equal(first[channel], other[channel]) and np.isfinite(first[channel]).all()
            )


def test_all_together_are_finite(hard_run: Motion) -> None:
    for array in every(
        simulate_arrays(WHEEL, SOIL, hard_run, [typical(e) for e in EFFECTS.values()])
    ).values():
        assert np.isfinite(array).all()


@pytest.mark.parametrize(
    "name", [n for n in NAMES if EFFECTS[n].correct is not Effect.correct and n != "sensor_latency"]
)
def test_correction_undoes_the_sensor(name: str) -> None:
    effect = typical(EFFECTS[name])
    motion = campaign(1)[0]
    true = Sensed(
        *(np.linspace(0.1, 2.0, np.size(motion.time)) * k for k in (0.01, 1.0, 5.0, 40.0, 1.0))
    )
    situation = advanced(
        Balanced, situation_of(motion, WHEEL), **{**BALANCED, "carried": true.load}
    )
    back = corrected(effect.sensors(true, situation), situation, (effect,))
    for f in fields(true):
        np.testing.assert_allclose(getattr(back, f.name), getattr(true, f.name), rtol=1e-12)


def test_latency_is_undone_away_from_the_ends() -> None:
    effect = make("sensor_latency", {"sinkage": 0.3, "current": 0.2, "force": 0.4})
    time = np.arange(500) / 25.0
    true = Sensed(*(np.sin(time / k) for k in (2.0, 3.0, 4.0, 5.0, 6.0, 7.0)))
    moving = replace(situation_of(campaign(1)[0], WHEEL), time=time)
    situation = advanced(Balanced, moving, **BALANCED)
    back = corrected(effect.sensors(true, situation), situation, (effect,))
    for f in fields(true):
        np.testing.assert_allclose(
            getattr(back, f.name)[20:-20], getattr(true, f.name)[20:-20], atol=1e-3
        )


@pytest.mark.parametrize("name", NAMES)
def test_takes_floats_as_the_loop_has_them(name: str) -> None:
    """Every hook that the on-line filter may call gives one number for one instant."""
    effect = typical(EFFECTS[name])
    motion = Motion(1.0, 2.0, 0.3, 0.4, 0.015, 60.0, pass_number=2.0, wheel_acceleration=0.1)
    known = {key: BALANCED[key] for key in ("cohesion", "tan_phi", "shear_modulus", "carried")}
    situation = advanced(
        Powered,
        situation_of(motion, WHEEL),
        **known,
        sinkage=0.02,
        current=1.0,
        memory={name: (0.3, 60.0)},
    )
    for value in (
        effect.torque_loss(situation),
        effect.torque_factor(situation),
        effect.load(60.0, situation),
    ):
        assert np.ndim(value) == 0 and np.isfinite(value)
    soil, sensed = (
        effect.soil(SOIL, situation),
        effect.correct(Sensed(0.02, 1.0, 3.0, 60.0, 2.0), situation),
    )
    assert all(
        np.ndim(getattr(value, f.name)) == 0 for value in (soil, sensed) for f in fields(value)
    )


def test_what_a_later_stage_computes_cannot_be_read() -> None:
    class TooEarly(Effect):
        stage = "contact"

        def contact(self, law: ContactLaw, situation: Any) -> ContactLaw:
            return replace(law, strength=1.0 + situation.torque)

    with pytest.raises(AttributeError, match=r"OnSoil.*torque"):
        simulate_arrays(WHEEL, SOIL, campaign(1)[0], (TooEarly(),))


def test_configuration_errors_are_one_line() -> None:
    for listed, said in (
        (ConfiguredEffect("gremlins", {}), "effects: no effect 'gremlins'"),
        (
            ConfiguredEffect("coulomb_friction", {"los": Uncertain(1.0)}),
            "effects.coulomb_friction: no parameter 'los'",
        ),
        (
            ConfiguredEffect("rear_contact", {"ratio": Uncertain(7.0)}),
            "effects.rear_contact.ratio: 7 is outside 0 … 1",
        ),
    ):
        with pytest.raises(ValueError) as error:
            configured([listed])
        assert str(error.value).startswith(said) and "\n" not in str(error.value)


def test_order_of_action_is_by_stage() -> None:
    acting = in_order(
        [make(n, {}) for n in ("sinkage_datum", "coulomb_friction", "rear_contact", "slip_sinkage")]
    )
    assert [e.name for e in acting] == [
        "slip_sinkage",
        "rear_contact",
        "coulomb_friction",
        "sinkage_datum",
    ]


def test_units_are_what_the_configuration_asks() -> None:
    asked = quantities("coulomb_friction")
    assert asked is not None and set(asked) == {"loss"}
    known = library.EFFECTS["coulomb_friction"].parameters()[0]
    assert (asked["loss"].unit, asked["loss"].low, asked["loss"].high) == (
        "N·m",
        known.low,
        known.high,
    )
    assert quantities("gremlins") is None
