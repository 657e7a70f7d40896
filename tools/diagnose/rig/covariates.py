"""What the values of a wheel's run may vary along."""

from __future__ import annotations

import numpy as np

from gritd.estimator.stages.history import rate_of
from gritd.estimator.stages.situation import Motion, situation_of
from gritd.estimator.terramechanics.soil import Array, Wheel
from gritd.tools.diagnose.rig.recorded import filled
from gritd.tools.diagnose.rig.signals import Signals

COURSE = ("wheel_angle", "position", "time", "acceleration", "heat")


def covariates(
    signals: Signals, motion: Motion, wheel: Wheel, tabled: bool = False
) -> dict[str, Array]:
    """Of one run (n,) each, SI; `rolled` is the angle [rad] that the wheel has turned, either way.

    tabled: a table of steady states has no course of time, place and wheel angle: these are 0, so
        that the order of scatter that an importer drew is never taken for a trend or a ripple.
    """
    situation, angle = situation_of(motion, wheel), np.asarray(motion.wheel_angle)
    current = filled(signals.analogue.get("current", np.zeros(signals.time.size)))
    step = float(np.median(np.diff(signals.time)))
    ones = np.ones(signals.time.size)

    known = {
        "slip": np.asarray(situation.slip),
        "speed": np.asarray(wheel.radius * np.abs(motion.wheel_speed)),
        "load": np.asarray(motion.load) * ones,
        "wheel_angle": angle,
        "rolled": np.cumsum(np.abs(np.diff(angle, prepend=angle[0]))),
        "position": np.asarray(situation.position),
        "time": np.asarray(motion.time),
        "acceleration": rate_of(motion.time, motion.wheel_speed),
        "heat": np.cumsum(current**2) * step,
        "direction": np.asarray(situation.direction),
        "pass": motion.pass_number * ones,
        "constant": ones,
    }
    return known | ({name: 0.0 * ones for name in COURSE} if tabled else {})
