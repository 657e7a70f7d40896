"""How late each channel is, told at full rate around starts, stops and changes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import Settings
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.terramechanics.soil import Soil
from gritd.tools.diagnose.orders.latency import Event, Latency, changes, events, lag_of, latency_of
from gritd.tools.diagnose.rig.campaign import sensed_as
from gritd.tools.diagnose.rig.candidates import steady_states
from gritd.tools.diagnose.rig.recorded import channels_of, measured_of, motion_of
from gritd.tools.diagnose.rig.signals import Signals, signals
from gritd.tools.diagnose.rig.weights import weights_of
from gritd.tools.diagnose.tuning import TUNING


def latencies_in(
    recordings: Sequence[Recording], known: Sequence[Signals], settings: Settings
) -> tuple[Latency, ...]:
    """Of every channel, beside the soil and the effects of the configuration. known: the signals
    on the grid. Tables of steady states tell nothing, and long runs are not looked at.
    """
    events: dict[str, list[Event]] = {}

    for recording, coarse in zip(recordings, known, strict=True):
        if steady_states(coarse) or coarse.time[-1] > TUNING.orders.lag_longest:
            continue
        fine = signals(recording, settings, TUNING.orders.lag_rate)
        for channel, event in lags(fine, settings):
            events.setdefault(channel, []).append(event)

    told = (latency_of(channel, each) for channel, each in events.items())
    return tuple(latency for latency in told if latency is not None)


def lags(fine: Signals, settings: Settings) -> Iterator[tuple[str, Event]]:
    """Of each channel at each event of a run, whose signals stand on a fine grid."""
    weights = weights_of(fine, settings)
    motion = motion_of(fine, weights.values, settings, 0.0)
    response = simulate_arrays(
        settings.wheel,
        _soil(settings),
        motion,
        configured(settings.effects),
        torque_constant=settings.drive.torque_constant.value,
        order=TUNING.rig.quadrature_order,
    )
    rim = settings.wheel.radius * np.abs(motion.wheel_speed)
    speed = 0.5 * (rim + np.abs(motion.carriage_speed))

    constant, step = settings.drive.torque_constant.value, 1.0 / TUNING.orders.lag_rate
    for channel in channels_of([fine], settings, [weights.known]):
        if channel == "load":  # what is given, and no answer to the motion
            continue
        model = sensed_as(response.sensed, channel, settings)
        read = measured_of(fine, channel, constant)
        for window in events(changes(model, step), step):
            event = lag_of(fine.time[window], read[window], model[window], speed[window])
            if event is not None:
                yield channel, event


def _soil(settings: Settings) -> Soil:
    """As the configuration knows it: level and size of each event are fitted."""
    prior = settings.soil
    return Soil(
        prior.cohesion.value,
        prior.tan_phi.value,
        prior.shear_modulus.value,
        prior.exponent.value,
        prior.pressure_sinkage.modulus(settings.wheel.width),
    )
