"""The daemon says which channels are silent or stand still, and since when; a filter that gets
nothing for a second is unfed.
"""

from __future__ import annotations

from gritd.estimator.daemon.feed import Feed
from gritd.estimator.daemon.notice import Notice
from gritd.estimator.messages.status import CHANNEL_BITS, Status
from gritd.estimator.messages.tick import TICK_NAMES

NS = 1_000_000_000
USED = {name: CHANNEL_BITS[name] for name in ("wheel_encoder", "carriage_encoder", "sinkage_pot")}


def followed(*stretches):
    """Looks, ten a second, over stretches of (seconds, status, stale, stuck): the feed, and what
    was said when.
    """
    feed, said, number = Feed(), [], 0
    for seconds, status, stale, stuck in stretches:
        for _ in range(round(10 * seconds)):
            tick = [0.0] * len(TICK_NAMES)
            values = {"stamp": number * NS // 10, "status": status, "stale": stale, "stuck": stuck}
            for name, value in values.items():
                tick[TICK_NAMES.index(name)] = value
            said += [(number / 10, notice) for notice in feed.look(tuple(tick), USED)]
            number += 1
    return feed, said


TRACKING = (5.0, Status.TRACKING, 0, 0)


def test_silence_is_said_at_once_and_its_end_with_how_long_it_was():
    feed, said = followed(TRACKING, (10.0, Status.STALE, 3, 0), TRACKING)
    assert said == [
        (5.0, Notice("channels wheel_encoder, carriage_encoder: nothing usable arrives")),
        (15.0, Notice("channels wheel_encoder, carriage_encoder: well again, after 10.0 s", True)),
    ]
    assert not feed.unfed


def test_a_filter_that_gets_nothing_for_a_second_is_unfed():
    assert not followed(TRACKING, (0.9, Status.STALE, 1, 0))[0].unfed
    assert followed(TRACKING, (1.5, Status.STALE, 1, 0))[0].unfed == "STALE wheel_encoder"
    assert followed(TRACKING, (1.5, Status.STUCK, 0, 4))[0].unfed == "STUCK sinkage_pot"
    assert not followed((5.0, Status.STANDSTILL, 0, 0))[0].unfed


def test_a_sensor_that_the_filter_does_not_need_is_said_and_leaves_it_fed():
    feed, said = followed(TRACKING, (3.0, Status.TRACKING, 4, 0))
    assert not feed.unfed and said[0][1].text.startswith("channel sinkage_pot")


def test_at_the_start_a_channel_may_take_a_second():
    assert followed((0.9, Status.STARTING, 7, 0), TRACKING)[1] == []
    feed, said = followed((3.0, Status.STARTING, 2, 0))
    assert feed.unfed == "STARTING carriage_encoder" and len(said) == 1
