"""A plate in the place of the wheel, pressed into the soil by the testbed itself."""

from __future__ import annotations

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.offline.windows import group_means
from gritd.estimator.recording.salvage import Recording
from gritd.tools.calibrate.procedures import soil
from gritd.tools.calibrate.procedures.datum import FORCE, POT
from gritd.tools.calibrate.sources import series, start_of
from gritd.tools.cli.command import DAMAGED, CommandError

BLOCK = 0.1  # [s] over which force and depth are averaged


def read(recorded: Recording, settings: Settings, radius: float, contact: float) -> soil.Press:
    """One press: the force/torque sensor's load over the potentiometer's depth, which counts from
    where the load last was below `contact` [N]; radius of the plate [m]. Raises CommandError.
    """
    assert settings.wrench is not None
    time, volts, _ = series(recorded, POT)
    at, force, _ = series(recorded, FORCE)
    at = at + start_of(recorded, FORCE) - start_of(recorded, POT)
    known = settings.wrench.load
    load = np.interp(time, at, force) * known.scale.value + known.offset.value
    depth = volts * settings.channels["sinkage_pot"].calibration.scale.value

    block = ((time - time[0]) / BLOCK).astype(int)
    weight, height = (group_means(block, values, block.max() + 1)[0] for values in (load, depth))
    filled = np.isfinite(weight)
    weight, height = weight[filled], height[filled]

    if not (weight < contact).any():
        raise CommandError(f"{recorded.path}: {soil.NO_PRESS.format(contact)}", DAMAGED)
    return soil.of_press(recorded.path.name, radius, weight, height, contact)
