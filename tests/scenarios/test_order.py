"""Readings that come twice, late, out of order, or without a time of their own."""

from __future__ import annotations

import random

import numpy as np
import pytest

from gritd.drivers.build import build_decoder
from gritd.drivers.wire import SerialWire
from gritd.estimator.messages.status import Flag
from gritd.estimator.messages.tick import TICK_NAMES
from tests.scenarios.rig import driven
from tests.scenarios.simulated import DRIVERS, PIPELINE, SETTINGS, START, TICK, shifted, ticks_of

# ---- order ---------------------------------------------------------------------------------------


def test_duplicate_late_and_reordered_stamps(seed, figure):
    """Delays of up to 40 ms, one reading in ten twice: inside the horizon the same bits as the
    sorted run, in every tick after the first 0.2 s and every field but those that tell when
    readings came.
    """
    rng = random.Random(seed)
    clean = shifted(driven(8.0, seed))
    delayed = [r._replace(received=r.stamp + rng.randrange(40_000_000)) for r in clean]
    twice = [
        r._replace(received=r.received + rng.randrange(5_000_000))
        for r in delayed
        if rng.random() < 0.1
    ]
    permuted = sorted([*delayed, *twice], key=lambda r: r.received)
    straight = sorted((r._replace(received=r.stamp) for r in clean), key=lambda r: r.stamp)
    same, other = ticks_of(straight), ticks_of(permuted)
    length = min(len(same["stamp"]), len(other["stamp"]))
    compared = [
        name
        for name in TICK_NAMES
        if name not in ("consumed", "duplicates", "stale", "status", "flags")
    ]
    different = sum(
        not np.array_equal(same[name][50:length], other[name][50:length], equal_nan=True)
        for name in compared
    )
    row = "duplicate, late or reordered stamps"
    figure(
        row,
        PIPELINE,
        "fields that differ from the sorted run, but for those of arrival",
        different,
        "",
        0,
    )
    counted = abs(int(other["duplicates"][-1]) - len(twice)) / len(twice)
    figure(row, PIPELINE, "duplicates not counted", counted * 100, "%", 1)


# ---- readings without a time of their own --------------------------------------------------------

TWO = "two readings in one read of the bus"
RECEIPT = "readings stamped on receipt, 16 to 116 ms late"


def test_two_readings_in_one_read(figure):
    """Devices without a clock: two frames of a channel come in one piece, and both are kept."""
    device = SETTINGS.devices["encoders"]
    decoder, wire = build_decoder(SETTINGS, device), SerialWire(device)
    readings = []
    for n in range(2000):
        pair = [wire.encode("wheel_encoder", [40 * (2 * n + k)], None) for k in range(2)]
        readings += decoder.decode(START + (2 * n + 1) * TICK, b"".join(pair))
    ticks = ticks_of(readings)
    dropped = 4000 - len(readings) + ticks["duplicates"][-1] + ticks["late"][-1]
    figure(TWO, DRIVERS, "readings dropped, of 4000", dropped, limit=0)


@pytest.mark.parametrize("seconds", [60, pytest.param(600, marks=pytest.mark.slow)])
def test_readings_stamped_when_they_come(seconds, figure):
    """A bus that hands on readings late, and not evenly: the soil did not change."""
    rng, readings = np.random.default_rng(1), []
    for reading in shifted(driven(seconds + 4.0, 1, skip=4.0)):
        late = round(rng.uniform(16e6, 116e6))
        readings.append(
            reading._replace(stamp=reading.stamp + late, received=reading.received + late)
        )
    readings.sort(key=lambda reading: reading.received)
    flags = ticks_of(readings)["flags"].astype(int) & int(Flag.CHANGED)
    begun = int(np.sum(np.diff(flags > 0, prepend=False) & (flags > 0)))
    level = f"{PIPELINE}, {seconds} s"
    figure(RECEIPT, level, "changes of the soil that were none", begun, limit=0)
