"""What a configuration states of the noise of a wheel's sensors."""

from __future__ import annotations

import numpy as np

from gritd.estimator.config.settings import Settings


def noise_of_readings(settings: Settings, loss_of_drive: bool) -> dict[str, float]:
    """Standard deviation of one reading of each channel that has a sensor, in the channel's unit.

    loss_of_drive: whether channel torque is motor torque less axle torque.
    """
    drive = settings.drive.torque_constant.value
    factors = {"torque": ("motor_shunt", drive), "sinkage": ("sinkage_pot", 1.0)}
    channels = settings.channels
    noise = {
        channel: abs(factor * channels[name].noise * channels[name].calibration.scale.value)
        for channel, (name, factor) in factors.items()
        if name in channels
    }

    wrench = settings.wrench
    if wrench is not None:
        noise["axle_torque"] = wrench.torque_noise * abs(wrench.torque.scale.value)
        noise["drawbar_pull"] = wrench.force_noise * abs(wrench.drawbar_pull.scale.value)
        if wrench.side_force is not None:
            noise["side_force"] = wrench.force_noise * abs(wrench.side_force.scale.value)
        noise["load"] = wrench.force_noise * abs(wrench.load.scale.value)
        if loss_of_drive and "torque" in noise:
            noise["torque"] = float(np.hypot(noise["torque"], noise["axle_torque"]))
    return noise
