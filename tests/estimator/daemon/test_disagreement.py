"""The daemon says that model and measurement disagree, in which channel and since when; without
cause it does not.
"""

from __future__ import annotations

from gritd.estimator.daemon.disagreement import Watch
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.status import Flag
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from tests.estimator.filter.rig import RIG, TRUTH
from tests.linear_plant import THREE_LOADS, readings

SHUNT = RIG.channels["motor_shunt"].calibration.scale.value
BEGINS, ENDS = 80, 200  # ticks, ten a second


def watched(
    loss: float,
    changed: tuple[float, float, float] = TRUTH,
    begins: int = BEGINS,
    ends: int = ENDS,
) -> tuple[Watch, list[tuple[int, str]], list[int]]:
    """A run whose motor consumes more torque between two ticks, and whose soil changes at the first
    of them; the lines said, with their tick, and all flags.
    """
    pipeline, watch = Pipeline(RIG, "plain"), Watch()
    state, said, flags = pipeline.start(), [], []
    more = loss / RIG.drive.torque_constant.value / SHUNT
    both = (readings(RIG, soil, THREE_LOADS, seed=3) for soil in (TRUTH, changed))
    for number, (before, after) in enumerate(zip(*both, strict=True)):
        t, batch = before if number < begins else after
        if begins <= number < ends:
            batch = [_more(reading, more) for reading in batch]
        state, tick = pipeline.step(state, batch, t)
        flags.append(int(tick[TICK_NAMES.index("flags")]))
        said += [(number, notice.text) for notice in watch.look(tick)]
    return watch, said, flags


def _more(reading: Reading, volts: float) -> Reading:
    if reading.channel != "motor_shunt" or isinstance(reading.value, tuple):
        return reading
    return reading._replace(value=reading.value + volts)


def test_a_motor_that_suddenly_drags_is_said_with_channel_and_time() -> None:
    _, said, flags = watched(1.0)
    assert any(flag & Flag.MISMATCH for flag in flags)
    number, line = next(each for each in said if each[1].startswith("model"))
    assert BEGINS < number <= BEGINS + 60  # within 6 s
    assert (
        line.startswith("model and measurement disagree since ")
        and " UTC: torque " in line
        and " σ off" in line
    )
    assert any(line.startswith("the filter's estimate is not believed") for _, line in said)


def test_a_change_of_the_soil_is_said_once() -> None:
    watch, said, flags = watched(0.0, (740.0, 0.66, 0.025), 300, 10**6)
    assert any(flag & Flag.CHANGED for flag in flags[300:])
    assert not any(flag & (Flag.CHANGED | Flag.PRIOR) for flag in flags[:300])
    number, line = said[0]
    assert line.startswith("the soil changed") and 300 < number <= 330
    assert len(said) == 1 and watch.present is None


def test_an_honest_run_is_never_said_to_disagree() -> None:
    watch, said, flags = watched(0.0)
    assert not said and watch.present is None and not any(flag & Flag.MISMATCH for flag in flags)
