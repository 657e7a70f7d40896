"""A single value that stands off its neighbours is a sensor's fault, unless that is foretold."""

from __future__ import annotations

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Colour
from gritd.tools.diagnose.noise.estimate import spikes
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

AT, HIGH, SIGMA = 40, 1.0, 0.01


def _spikes(residual: Array, *columns: Array) -> Array:
    stack = _stack()
    colours = [Colour(SIGMA, 1.0, 0.0) for _ in stack.rig.channels]
    return spikes(stack, residual, colours, np.column_stack([0.0 * residual, *columns]))


def _stack() -> Stack:
    return Stack(wheel_rig(record(plan(), ()), settings()))


def _standing_off(*places: int) -> Array:
    values = SIGMA * np.random.default_rng(1).standard_normal(_stack().size)
    values[list(places)] = HIGH
    return values


def test_a_value_that_nothing_foretells_is_a_spike() -> None:
    smooth = np.linspace(0.0, 1.0, _stack().size)
    found = _spikes(_standing_off(AT), smooth)
    assert np.flatnonzero(found).tolist() == [AT]
    assert abs(found[AT] - HIGH) < 5.0 * SIGMA


def test_a_value_that_an_effect_foretells_is_none() -> None:
    sudden = np.zeros(_stack().size)
    sudden[[AT, AT + 100]] = 0.2
    assert not _spikes(_standing_off(AT, AT + 100), sudden).any()


def test_what_an_effect_foretells_elsewhere_excuses_nothing() -> None:
    sudden = np.zeros(_stack().size)
    sudden[AT + 100] = 0.2
    assert np.flatnonzero(_spikes(_standing_off(AT), sudden)).tolist() == [AT]
