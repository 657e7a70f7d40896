"""What is said of ripples and vibrations."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

from gritd.estimator.effects import make
from gritd.tools.diagnose.explain.result import plain
from gritd.tools.diagnose.explain.ripples import left_over, ripples_of
from gritd.tools.diagnose.orders.campaigns import Lines
from gritd.tools.diagnose.orders.lines import SpectralLine
from gritd.tools.diagnose.orders.wave import Amplitude
from gritd.tools.diagnose.rig.constants import UNITS


def _line(channel: str, axis: str, at: float, harmonic: float = 0.0) -> SpectralLine:
    size = (Amplitude(0.3, 0.4, 0.01), None)
    return SpectralLine(channel, axis, at, 0.01, size, 1e-9, (1.0, 2.0), 0.2, 20.0, harmonic)


def _rig(
    new: tuple[SpectralLine, ...], reference: tuple[SpectralLine, ...] = (), **more: Any
) -> Any:
    return SimpleNamespace(lines=Lines(new, reference), units=UNITS, **more)


def test_a_ripple_without_a_name_is_told_with_its_channels() -> None:
    rig = _rig((_line("torque", "angle", 15.0), _line("sinkage", "angle", 15.05)))
    (sentence,) = left_over(rig, ())
    assert "15.00 times a turn, 1.0 to 2.0 Hz (torque ± 0.50 N·m, sinkage ± 500 mm)" in sentence


def test_an_accepted_effect_has_its_ripple() -> None:
    rig = _rig((_line("torque", "angle", 40.0), _line("torque", "angle", 80.0, 40.0)))
    assert list(left_over(rig, (make("gear_ripple", {"ripple_cos": 0.1, "order": 40.01}),))) == []
    assert (
        len(list(left_over(rig, (make("gear_ripple", {"ripple_cos": 0.1, "order": 60.0}),)))) == 1
    )


def test_vibrations_and_what_the_reference_has_are_kept_apart() -> None:
    rig = _rig((_line("load", "time", 7.3), _line("torque", "angle", 9.0)),
               (_line("torque", "angle", 9.0),))  # fmt: skip
    assert [s for s in left_over(rig, ()) if "7.30 Hz (load ± 0.50 N)" not in s] == []
    shown = {r.along: r for r in ripples_of(rig)}
    assert shown["1/turn"].reference and not shown["Hz"].reference
    assert json.loads(json.dumps(plain(vars(shown["Hz"]))))["harmonic_of"] is None


def test_many_places_are_not_all_told() -> None:
    rig = _rig(tuple(_line("torque", "angle", 10.0 * k) for k in range(1, 10)))
    (sentence,) = left_over(rig, ())
    assert sentence.endswith("and 5 more.")
