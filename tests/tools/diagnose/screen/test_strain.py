"""A constant that the fit moves far from what is known of it is no agreement."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gritd.tools.diagnose.explain.result import Diagnosis, Discrepancy
from tests.tools.diagnose.campaigns import diagnosed, plan, soil

pytestmark = pytest.mark.long


def _of_modulus(factor: float) -> Diagnosis:
    """Recordings on soil whose sinkage modulus is another: 5 % is known of it."""
    drawn = plan(seconds=12.0)
    return diagnosed(replace(drawn, soil=replace(soil(), modulus=factor * soil().modulus)))


def test_a_strained_constant_is_no_agreement() -> None:
    found = _of_modulus(1.6)
    assert found.verdict not in ("consistent", "insufficient")
    assert found.test.name == "K beyond what is known of it"
    assert any(note.startswith("Strained: sinkage modulus K") for note in found.caveats)


def test_a_constant_within_what_is_known_of_it_is() -> None:
    found = _of_modulus(1.04)
    assert found.verdict == "consistent"
    assert found.share == 0.0
    assert all(d.size > 0.0 and d.learnt_from == "recordings" for d in _formed(found))


def _formed(found: Diagnosis) -> list[Discrepancy]:
    """Of the channels that have a discrepancy of form: averaged over its sizes, it is never 0."""
    return [found.discrepancy[channel] for channel in ("axle_torque", "drawbar_pull", "sinkage")]
