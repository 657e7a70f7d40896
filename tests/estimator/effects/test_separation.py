"""The experiment an effect's file names does tell it from the effect it looks like."""

from __future__ import annotations

import pytest

from gritd.estimator.effects import EFFECTS
from tests.estimator.effects.separation import SIMULATED, left_over, separation

EXPERIMENTS = {
    name: [
        (rival, experiment)
        for rival, experiment in effect.confusable_with.items()
        if experiment in SIMULATED and not EFFECTS[rival].filter_only
    ]
    for name, effect in EFFECTS.items()
    if not effect.filter_only
}


@pytest.mark.parametrize("effect", [name for name, found in EXPERIMENTS.items() if found])
@pytest.mark.long
def test_experiment_tells_apart(effect: str) -> None:
    for rival, experiment in EXPERIMENTS[effect]:
        without, with_it = separation(effect, rival, experiment)
        assert with_it > 2.0 and with_it > without + 1.0, (rival, experiment)


@pytest.mark.parametrize(
    "twins", [("bed_slope", "force_crosstalk"), ("wheel_radius_error", "grousers")]
)
def test_twins_stay_twins(twins: tuple[str, str]) -> None:
    """Pairs that driving alone cannot separate, whatever is driven: their files send the engineer
    to level and tape.
    """
    everything = (
        "load_step",
        "slip_step",
        "speed_step",
        "second_pass",
        "standstill",
        "shifted_start",
    )
    assert left_over(*twins, everything) < 3.0


def test_an_effect_cannot_be_told_from_itself() -> None:
    assert left_over("bulldozing", "bulldozing", ("load_step", "slip_step")) < 0.5
