"""Which values of a run say something of the steady physics: driving and settled, at rest, lifted.

Speeds are slopes over three grid intervals, sinkage follows the load within one contact length, and
servo, soil and encoders start and stop at their own paces. A value next to a start, a stop, a
reversal, or the wheel's touching down mixes two states and belongs to neither; it is left out on
both sides alike.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from gritd.estimator.config.settings import Settings
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SLIGHT, SPEED


def states(motion: Motion, settings: Settings) -> tuple[Bools, Bools, Bools]:
    """Driving on the soil and settled; at rest for a while; lifted off the soil and settled. Each
    (n,).
    """
    rim = settings.wheel.radius * np.asarray(motion.wheel_speed)
    usual, way = _usual(rim), _way(rim)

    load, least = np.asarray(motion.load), settings.load.minimum
    carrying, lifted = load >= least, load < TUNING.rig.lifted * least
    step = float(np.median(np.diff(np.asarray(motion.time))))

    passing = TUNING.rig.contact_angle / max(usual / settings.wheel.radius, SLIGHT)
    passing = min(max(passing, TUNING.rig.settling), TUNING.rig.longest_settling)
    settling = round(TUNING.rig.settling / step)

    rest = at_rest(rim, np.asarray(motion.carriage_speed))
    driving, spinning = (
        _inside(np.where(state, way, 0.0), round(passing / step), settling)
        for state in (carrying, lifted)
    )
    resting = _inside((rest & carrying).astype(float), settling, settling)
    return driving, resting, spinning


def turning(motion: Motion, settings: Settings) -> Bools:
    """Where the wheel turns one way throughout an interval and two on either side, settled or not
    (n,): a speed next to a start is a slope that holds some rest.
    """
    return _inside(_way(settings.wheel.radius * np.asarray(motion.wheel_speed)), 2, 2)


def turned_back(motion: Motion, settings: Settings) -> Bools:
    """Where the wheel turns the other way than before, settled or not (n,): play of the drive shows
    there alone.
    """
    way = _way(settings.wheel.radius * np.asarray(motion.wheel_speed))
    begins = np.flatnonzero((way != 0.0) & (np.diff(way, prepend=0.0) != 0.0))
    if not begins.size:
        return np.zeros(way.size, bool)

    back = np.diff(way[begins], prepend=way[begins[0]]) != 0.0
    last = np.searchsorted(begins, np.arange(way.size), side="right") - 1
    turned: Bools = _inside(way, 1, 1) & back[last]
    return turned


def at_rest(rim_speed: Array, carriage_speed: Array) -> Bools:
    """Where both speeds (n,) [m/s] are 0 but for the encoders' noise: a standing wheel's slip means
    nothing.
    """
    turning = np.abs(rim_speed)[np.abs(rim_speed) > TUNING.rig.turning_speed]
    least = TUNING.rig.rest_speed * float(np.median(turning)) if turning.size else SPEED
    rest: Bools = (np.abs(rim_speed) < least) & (np.abs(carriage_speed) < least)
    return rest


def _usual(rim: Array) -> float:
    """Rim speed while the wheel turns [m/s], from that of a run (n,)."""
    moved = np.abs(rim)[np.abs(rim) > TUNING.rig.turning_speed]
    return float(np.median(moved)) if moved.size else TUNING.rig.turning_speed


def _way(rim: Array) -> Array:
    """1 forward, −1 backward, 0 where the wheel hardly turns (n,); rim speed (n,) [m/s]."""
    return np.where(np.abs(rim) > TUNING.rig.creep * _usual(rim), np.sign(rim), 0.0)


def _inside(state: Array, after: int, before: int) -> Bools:
    """Where a state other than 0 has lasted for `after` intervals and goes on for `before` more.

    It may have begun before the recording and go on beyond it: the ends of a run are no change of
        state.
    """
    window = after + before + 1
    about = {"size": window, "origin": after - window // 2, "mode": "nearest"}
    lasts = minimum_filter1d(state, **about) == maximum_filter1d(state, **about)
    return np.asarray((state != 0.0) & lasts)
