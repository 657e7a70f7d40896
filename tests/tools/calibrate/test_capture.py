"""Procedures on the live sensors of a simulated testbed, on real wires."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.messages.readings import Reading
from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.commands import calibrate
from gritd.tools.testbed import rig_config
from gritd.tools.testbed.wires import ConnectedDevices
from tests.tools.calibrate.bench import rig as described

pytestmark = pytest.mark.long

Raw = Mapping[str, float | int | tuple[float, ...]]
RATE = 100.0  # [Hz]
NS = 1e9


@contextmanager
def sensing(folder: Path, at: Callable[[float], Raw]) -> Iterator[Path]:
    """The configuration of a testbed whose sensors say at(t) [s] from now on."""
    configuration = config.load(described(folder / "bench"))
    stopped = threading.Event()

    with ConnectedDevices(configuration.settings, "slcan") as wires:
        written = rig_config.write(configuration, wires.devices, "original", folder)

        def play() -> None:
            begin = time.monotonic()
            for step in range(10**6):
                t = step / RATE
                time.sleep(max(begin + t - time.monotonic(), 0.0))
                if stopped.is_set():
                    return
                for channel, value in at(t).items():
                    wires.send(Reading(int(t * NS), channel, value, int(t * NS)))

        player = threading.Thread(target=play)
        player.start()
        try:
            yield written
        finally:
            stopped.set()
            player.join()


def value_of(path: Path, *keys: str) -> tuple[float, float]:
    """Value and σ in SI, of the written configuration."""
    settings = config.load(path).settings
    if keys[0] == "effects":
        found = {e.name: e.parameters for e in settings.effects}[keys[1]][keys[2]]
        return found.value, found.sigma
    calibration = settings.channels[keys[1]].calibration
    return calibration.offset.value, calibration.offset.sigma


def test_a_wheel_is_spun_while_gritd_records(tmp_path: Path) -> None:
    """Speeds change with the time of the testbed, whose losses and offset are found."""
    settings = config.load(described(tmp_path / "first")).settings
    count = settings.channels["wheel_encoder"].calibration.scale.value
    shunt, constant = settings.channels["motor_shunt"].calibration, settings.drive.torque_constant
    rng, speeds = np.random.default_rng(1), np.array([1.0, 2.0, -1.0, -2.0])
    loss, damping, offset = 0.3, 0.05, 0.02  # [N·m], [N·m·s/rad], [A]

    def at(t: float) -> Raw:
        number = int(t // 2.0) % 4
        turned = 2.0 * speeds[:number].sum() + (t % 2.0) * speeds[number]
        speed = speeds[number]
        current = (np.sign(speed) * loss + damping * speed) / constant.value + offset
        volts = (current - shunt.offset.value) / shunt.scale.value
        return {
            "wheel_encoder": int(1e6 + turned / count),
            "motor_shunt": volts + 1e-3 * rng.standard_normal(),
        }

    with sensing(tmp_path, at) as file:
        kept = tmp_path / "spin.mcap"
        command = ["torque", "--config", str(file), "--record", str(kept), "--seconds", "18"]
        assert calibrate.main([*command, "--in-place"]) == 0
    assert kept.exists()
    for truth, keys in (
        (loss, ("effects", "coulomb_friction", "loss")),
        (damping, ("effects", "viscous_friction", "damping")),
        (shunt.offset.value - offset, ("channels", "motor_shunt")),
    ):
        value, sigma = value_of(file, *keys)
        assert value == pytest.approx(truth, abs=4.0 * sigma + 1e-3)
        assert 0.0 < sigma < 0.05 * max(abs(truth), 0.1)


def test_the_testbed_presses_plates(tmp_path: Path) -> None:
    """σ = K zⁿ under a plate of 60 mm, pressed three times, in one recording each."""
    settings = config.load(described(tmp_path / "first")).settings
    pot, n, area = settings.channels["sinkage_pot"].calibration, 1.1, np.pi * 0.03**2
    rng = np.random.default_rng(2)

    def at(t: float) -> Raw:
        depth = -5e-3 + 15e-3 * (t % 3.0)  # [m] lowered from the air, lifted every three seconds
        pressure = 1.5e6 * max(depth, 0.0) ** n
        volts = (0.03 + depth - pot.offset.value) / pot.scale.value
        force = pressure * area + 0.1 * rng.standard_normal()
        return {
            "sinkage_pot": volts + 1e-3 * rng.standard_normal(),
            "wrench": (0.0, 0.0, force, 0.0, 0.0, 0.0),
        }

    kept = [str(tmp_path / f"press-{number}.mcap") for number in range(3)]
    records = [word for path in kept for word in ("--record", path)]
    with sensing(tmp_path, at) as file:
        options = ["--plate", "60 mm", "--seconds", "6.5", "--in-place"]
        assert calibrate.main(["soil", "--config", str(file), *records, *options]) == 0

    soil = config.load(file).settings.soil
    assert soil.exponent.value == pytest.approx(n, abs=0.08)
    modulus = soil.pressure_sinkage.modulus(settings.wheel.width)
    ours = modulus * 0.02**soil.exponent.value  # [Pa] 20 mm deep
    assert ours == pytest.approx(1.5e6 * 0.02**n, rel=0.08)

    with pytest.raises(CommandError, match="--plate") as error:
        calibrate.main(["soil", "--config", str(file), *kept])
    assert error.value.code == USAGE


def test_nobody_there_is_told(tmp_path: Path) -> None:
    with sensing(tmp_path, lambda t: {}) as file, pytest.raises(CommandError, match="no reading"):
        kept = tmp_path / "spin.mcap"
        calibrate.main(["torque", "--config", str(file), "--record", str(kept), "--seconds", "6"])
    assert not kept.exists()
