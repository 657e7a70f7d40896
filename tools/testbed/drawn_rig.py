"""A testbed as its configuration describes it, but with every calibration off by its own sigma."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gritd.estimator.config.settings import Calibration, Settings, Uncertain, Wrench


def drawn_rig(settings: Settings, rng: np.random.Generator) -> Settings:
    """The settings of a true testbed: calibrations and torque constant about the stated ones."""
    channels = {
        name: replace(channel, calibration=drawn_calibration(channel.calibration, rng))
        for name, channel in settings.channels.items()
    }
    wrench = settings.wrench and _drawn_wrench(settings.wrench, rng)
    constant = drawn(settings.drive.torque_constant, rng)

    return replace(
        settings,
        channels=channels,
        wrench=wrench,
        drive=replace(settings.drive, torque_constant=constant),
    )


def drawn(quantity: Uncertain, rng: np.random.Generator) -> Uncertain:
    """The quantity with a value drawn about its own by its sigma."""
    return replace(quantity, value=quantity.value + quantity.sigma * float(rng.normal()))


def drawn_calibration(calibration: Calibration, rng: np.random.Generator) -> Calibration:
    """Slope about the physical zero, and the zero itself, each off by its own sigma."""
    scale = drawn(calibration.scale, rng)
    zero = calibration.offset.value * scale.value / calibration.scale.value
    offset = drawn(Uncertain(zero, calibration.offset.sigma), rng)
    return replace(calibration, scale=scale, offset=offset)


def _drawn_wrench(wrench: Wrench, rng: np.random.Generator) -> Wrench:
    return replace(
        wrench,
        drawbar_pull=drawn_calibration(wrench.drawbar_pull, rng),
        load=drawn_calibration(wrench.load, rng),
        torque=drawn_calibration(wrench.torque, rng),
    )
