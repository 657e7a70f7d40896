"""The packaged testbed at 250 Hz on the linear plant, in a soil that changes: what every tick of a
daemon would consume.
"""

from __future__ import annotations

from itertools import groupby

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from tests.linear_plant import readings

SETTINGS = load(packaged()).settings
TRUTH = (720.0, 0.62, 0.025)
SCHEDULE = [(4.0, 50.0, 0.2), (4.0, 90.0, 0.4), (4.0, 60.0, 0.1), (4.0, 80.0, 0.5)]
JUMP, MORE_VOLTS = (
    14.0,
    0.05,
)  # [s] from which on the shunt reads so much more: a change of the soil


def consumed(schedule=SCHEDULE):
    """(stamp, readings) of every tick."""
    plant = list(readings(SETTINGS, TRUTH, schedule, seed=4, rate=250))
    began = min(reading.stamp for _, batch in plant for reading in batch)
    each = (_more(reading, began) for _, batch in plant for reading in batch)
    return [(stamp, list(group)) for stamp, group in groupby(each, key=lambda r: r.stamp)]


def _more(reading, began):
    late = reading.channel == "motor_shunt" and reading.stamp > began + JUMP * 1e9
    return reading._replace(value=reading.value + MORE_VOLTS) if late else reading
