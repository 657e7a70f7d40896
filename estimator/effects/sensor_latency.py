"""A channel that lags the others."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.history import delayed, run_by_run
from gritd.estimator.stages.situation import Sensed, Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class SensorLatency(Effect):
    """One channel lags the others, so it shows what the encoders saw some time ago.

    y_read(t) = y(t − d), each channel its own d; d < 0 leads

    Source: transport delay. It has no inverse at one instant: on line it is undone by the channel's
    configured latency, which shifts its stamps; `correct` undoes it for whole runs.
    """

    sinkage: float = strength("delay of the potentiometer", "s", typical=0.1, low=-0.5, high=1.0)
    current: float = strength("delay of the current", "s", typical=0.1, low=-0.5, high=1.0)
    force: float = strength(
        "delay of the force/torque sensor", "s", typical=0.1, low=-0.5, high=1.0
    )

    stage = "sensor"
    fingerprint = Fingerprint(
        "load", "rate", "pulses in proportion to how fast the channel itself changes"
    )
    confusable_with = told_apart(wheel_inertia="load_step", load_axis_friction="load_step")

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return self._shifted(sensed, situation, 1.0)

    def correct(self, sensed: Sensed, situation: Situation) -> Sensed:
        return self._shifted(sensed, situation, -1.0)

    def _shifted(self, sensed: Sensed, situation: Situation, sign: float) -> Sensed:
        delays = {"sinkage": self.sinkage, "current": self.current}
        return replace(
            sensed,
            **{
                channel.name: _lagging(
                    getattr(sensed, channel.name),
                    situation,
                    sign * delays.get(channel.name, self.force),
                )
                for channel in fields(sensed)
            },
        )


def _lagging(value: Scalar, situation: Situation, delay: float) -> Scalar:
    if delay == 0.0 or np.ndim(value) == 0:
        return value
    return run_by_run(lambda t, v: delayed(t, v, delay), situation.run, situation.time, value)
