"""Which values of a run say something of the steady physics: driving and settled, at rest, lifted.

Speeds are slopes over three grid intervals, sinkage follows the load within one contact length, and
servo, soil and encoders start and stop at their own paces. A value next to a start, a stop, a
reversal, or the wheel's touching down mixes two states and belongs to neither; it is left out on
both sides alike.
"""

from __future__ import annotations

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools

CREEP = 0.05  # share of the usual rim speed below which the wheel does not drive
# [s] after the wheel starts, before the comparison counts: at least, at most
SETTLING, LONGEST = 0.5, 5.0
# [s] before the wheel stops, from which on it no longer counts: a slope's reach, and a servo's ramp
STOPPING = 0.5
# [rad] usual entry angle: by then the rim has passed one contact length and the wheel has sunk
ANGLE = 0.7
# [s] the wheel must have stood, and go on standing, for its current to be that at rest
RESTING, RISING = 0.4, 0.2


def states(motion: Motion, settings: Settings) -> tuple[Bools, Bools, Bools]:
    """Driving on the soil and settled; at rest for a while; lifted off the soil and settled. Each
    (n,).
    """
    rim = settings.wheel.radius * np.asarray(motion.wheel_speed)
    turning = np.abs(rim)[np.abs(rim) > 1e-3]
    usual = float(np.median(turning)) if turning.size else 1e-3

    load = np.asarray(motion.load)
    carrying, lifted = load >= settings.load.minimum, load < 0.2 * settings.load.minimum
    step = float(np.median(np.diff(np.asarray(motion.time))))

    passing = float(np.clip(ANGLE / max(usual / settings.wheel.radius, 1e-6), SETTLING, LONGEST))
    way = np.where(np.abs(rim) > CREEP * usual, np.sign(rim), 0.0)
    apart = round(passing / step), round(STOPPING / step)

    rest = at_rest(rim, np.asarray(motion.carriage_speed))
    driving, spinning = (_inside(np.where(state, way, 0.0), *apart) for state in (carrying, lifted))
    resting = _inside((rest & carrying).astype(float), round(RESTING / step), round(RISING / step))
    return driving, resting, spinning


def at_rest(rim_speed: Array, carriage_speed: Array) -> Bools:
    """Where both speeds (n,) [m/s] are 0 but for the encoders' noise: a standing wheel's slip means
    nothing.
    """
    turning = np.abs(rim_speed)[np.abs(rim_speed) > 1e-3]
    least = 0.01 * float(np.median(turning)) if turning.size else 1e-4
    rest: Bools = (np.abs(rim_speed) < least) & (np.abs(carriage_speed) < least)
    return rest


def _inside(state: Array, after: int, before: int) -> Bools:
    """Where a state other than 0 has lasted for `after` intervals and goes on for `before` more.

    It may have begun before the recording and go on beyond it: the ends of a run are no change of
        state.
    """
    n, at = state.size, np.arange(state.size)
    changed = np.flatnonzero(np.diff(state)) + 1  # first intervals of a new state
    bounds = np.concatenate(([-after - 1], changed, [n + before]))
    place = np.searchsorted(changed, at, side="right")
    inside: Bools = (
        (state != 0.0) & (at - bounds[place] >= after) & (bounds[place + 1] - at > before)
    )
    return inside
