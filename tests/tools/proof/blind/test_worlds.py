"""Worlds: what each has of its own, and that it leaves the rest as it is."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gritd.tools.proof.blind.plant import worlds
from gritd.tools.proof.blind.plant.baseline import LeakingSensor, Relaxation, WornGear
from gritd.tools.proof.blind.plant.concealed import LISTED, UNLISTED
from gritd.tools.proof.blind.plant.effect import PlantEffect
from gritd.tools.proof.blind.plant.respond import World, drive, respond, responses
from gritd.tools.proof.blind.plant.scene import Felt
from gritd.tools.proof.blind.plant.worlds import FOREIGN, HELD, WORLDS, Size
from tests.tools.proof.blind.scene import FACTS, GROUND, RIG, run

pytestmark = pytest.mark.long

READ = ("sinkage", "current", "pull", "load", "torque", "carriage", "side")
EFFECTS = LISTED | UNLISTED


def world(name: str, seed: int = 1) -> World:
    bed, own = worlds.drawn(name, np.random.default_rng(seed), Size(65.0, RIG.radius))
    return World(RIG, GROUND, bed=bed, baseline=own)


def test_what_worlds_hold_are_names_of_effects() -> None:
    assert set(HELD) == set(WORLDS)
    assert all(set(names) <= set(LISTED) for names in HELD.values())
    assert all(HELD[name] for name in FOREIGN)


@pytest.mark.parametrize("name", FOREIGN)
@pytest.mark.parametrize("seed", range(3))
def test_a_foreign_world_differs_from_the_papers_and_stays_finite(name: str, seed: int) -> None:
    plain = drive(World(RIG, GROUND), run())
    felt = drive(world(name, seed), run())
    assert all(np.isfinite(getattr(felt, channel)).all() for channel in READ)
    change = [
        np.std(getattr(felt, channel) - getattr(plain, channel)) / np.std(getattr(plain, channel))
        for channel in ("sinkage", "torque", "pull", "current")
    ]
    assert max(change) > 0.05


@pytest.mark.parametrize("name", WORLDS)
def test_more_load_sinks_deeper_and_asks_for_more_torque(name: str) -> None:
    light, heavy = (
        drive(world(name), replace(run(), weight=np.full(run().time.size, weight)))
        for weight in (50.0, 80.0)
    )
    driven = (run().time > 4.5) & (run().time < 12.5)
    for channel in ("sinkage", "torque", "current"):
        assert np.all(getattr(heavy, channel)[driven] > getattr(light, channel)[driven])


@pytest.mark.parametrize("name", WORLDS)
def test_more_slip_asks_for_more_torque_and_pulls_harder(name: str) -> None:
    """Slip 10 % until 5.5 s, then 40 % until 9.5 s, at one speed of the rim; means over a tooth."""
    felt, time = drive(world(name), run()), run().time
    low, high = (time > 4.5) & (time < 5.5), (time > 8.0) & (time < 9.5)
    for channel in ("torque", "pull", "current"):
        values = getattr(felt, channel)
        assert values[high].mean() > values[low].mean()


@pytest.mark.parametrize(
    "effect", [Relaxation(0.0), WornGear(0.0, 0.0, 0.0), LeakingSensor(0.0)], ids=lambda h: str(h)
)
def test_a_baseline_effect_is_off_at_zero(effect: PlantEffect) -> None:
    plain = drive(World(RIG, GROUND), run())
    off = respond(World(RIG, GROUND, baseline=(effect,)), plain.scene.motion)
    for channel in READ:
        np.testing.assert_allclose(
            getattr(off, channel), getattr(plain, channel), rtol=1e-9, atol=1e-9
        )


@cache
def undisturbed(name: str) -> Felt:
    own = world(name)
    return respond(own, drive(own, run(5.0)).scene.motion)


@pytest.mark.parametrize("name", ["several", "strips"])
@pytest.mark.parametrize("effect", EFFECTS)
def test_effects_act_in_foreign_worlds_and_are_off_at_zero(name: str, effect: str) -> None:
    if not worlds.concealable(name, (effect,)):
        pytest.skip(f"{effect} is what the world {name} has of its own")
    own, plain = world(name), undisturbed(name)
    for form in EFFECTS[effect]:
        drawn = form.drawn(np.random.default_rng(5), FACTS)
        off, on = responses(
            [
                (own.with_effects(one), plain.scene.motion)
                for one in (replace(drawn, strength=0.0), drawn)
            ]
        )
        for channel in READ:
            np.testing.assert_allclose(
                getattr(off, channel),
                getattr(plain, channel),
                rtol=1e-5,
                atol=1e-6 if channel == "sinkage" else 1e-3,
                err_msg=f"{form.__name__}: {channel}",
            )
        changed = [np.abs(getattr(on, channel) - getattr(plain, channel)) for channel in READ]
        assert all(np.isfinite(change).all() for change in changed), form.__name__
        assert max(change.max() for change in changed) > 1e-4, form.__name__


def test_the_relaxation_follows_over_its_length_of_travel() -> None:
    """63 % of a step of torque after the length of the contact, 0.02 m at 30°."""
    time = np.arange(0.0, 30.0, 0.02)
    slip = np.where(time < 15.0, 0.1, 0.4)
    ones = np.ones(time.size)
    orders = replace(
        run(), time=time, omega=0.3 * ones, speed=0.3 * RIG.radius * (1.0 - slip),
        weight=65.0 * ones, passes=1,
    )  # fmt: skip
    felt = drive(World(RIG, GROUND, baseline=(Relaxation(0.02),)), orders)
    since = felt.scene.motion.travel - np.interp(15.0, time, felt.scene.motion.travel)
    before, after = felt.torque[time < 14.9][-1], felt.torque[-1]
    risen = (felt.torque - before) / (after - before)
    length = 0.04 * float(np.sin(felt.scene.theta_1[-1]))
    assert np.interp(length, since, risen) == pytest.approx(0.63, abs=0.04)
