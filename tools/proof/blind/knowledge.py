"""What is true of a testbed and what its configuration says: soil, calibration, noise. The two
differ, within sigma.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.tools.proof.blind.plant.contact import PlantSoil
from gritd.tools.proof.blind.plant.scene import TrueRig
from gritd.tools.proof.blind.plant.sensors import Converter, SensorChain, SensorNoise
from gritd.tools.proof.blind.plant.servo import Servo

# name: c [Pa], φ [degrees], k [m], n, K of σ = K zⁿ [Pa/mⁿ]; each is drawn around
FAMILIES: dict[str, tuple[float, float, float, float, float]] = {
    "dry sand": (1000.0, 30.0, 0.025, 1.10, 1.54e6),
    "loose sand": (700.0, 31.0, 0.025, 1.10, 1.10e6),
    "sandy loam": (1700.0, 29.0, 0.025, 0.70, 0.60e6),
    "Mars-like": (220.0, 33.0, 0.025, 1.10, 1.50e6),
    "lunar simulant": (170.0, 36.0, 0.018, 1.00, 0.85e6),
    "firm regolith": (900.0, 35.0, 0.015, 1.00, 1.60e6),
    "clayey soil": (4100.0, 13.0, 0.010, 0.50, 0.30e6),
}
SPREAD = {
    "cohesion": 0.25,
    "tan_phi": 0.07,
    "shear_modulus": 0.2,
    "exponent": 0.04,
    "modulus": 0.25,
}
# Relative standard deviations from one preparation of the bed to the next.
REPEATABILITY = {
    "cohesion": 0.04,
    "tan_phi": 0.01,
    "shear_modulus": 0.04,
    "exponent": 0.005,
    "modulus": 0.04,
}
SLOW, SLOW_SHARE = 1.95, 0.9  # [s] correlation 0.95 over 0.1 s; share of the noise that is slow


@dataclass(frozen=True)
class Stated:
    """As configured: value ± one standard deviation."""

    value: float
    sigma: float


@dataclass(frozen=True)
class Instrument:
    """Calibration of one channel as configured, physical = raw · scale + offset, and its stated
    noise [raw].
    """

    scale: Stated
    offset: Stated
    noise: float


@dataclass(frozen=True)
class Knowledge:
    """All that the configuration says."""

    radius: float  # [m]
    width: float  # [m]
    pulley: float  # [m]
    soil: dict[str, Stated]  # by the fields of Ground
    torque_constant: Stated
    weight_share: float  # relative standard deviation of the weights
    instruments: dict[str, Instrument]  # by channel, with drawbar_pull, load, torque of the wrench


def ground_drawn(rng: np.random.Generator) -> tuple[str, PlantSoil]:
    """A soil of a family, its parameters drawn around the family's."""
    family = str(rng.choice(list(FAMILIES)))
    cohesion, phi, *others = FAMILIES[family]
    values = (cohesion, float(np.tan(np.radians(phi))), *others)
    drawn = [
        value * float(np.exp(s * rng.standard_normal()))
        for value, s in zip(values, SPREAD.values(), strict=True)
    ]
    return family, PlantSoil(*drawn)


def soil_known(ground: PlantSoil, rng: np.random.Generator) -> dict[str, Stated]:
    """What a bevameter measured: the truth and an error, within the sigma it states."""
    relative = {
        "cohesion": float(rng.uniform(0.15, 0.35)),
        "tan_phi": float(rng.uniform(0.04, 0.1)),
        "shear_modulus": float(rng.uniform(0.08, 0.15)),
        "exponent": float(rng.uniform(0.01, 0.03)),
        "modulus": float(rng.uniform(0.03, 0.1)),
    }

    known = {}
    for name, share in relative.items():
        true = float(getattr(ground, name))
        error = float(np.clip(rng.standard_normal(), -2.5, 2.5))
        known[name] = Stated(true * max(1.0 + share * error, 0.1), share * true)

    return known


def rig_drawn(rng: np.random.Generator) -> TrueRig:
    """A small testbed; its drives and its torque constant follow from the loads, see `fitted`."""
    radius = float(np.round(rng.uniform(0.055, 0.15), 3))
    width = float(np.round(radius * rng.uniform(0.6, 1.2), 3))
    idle = Servo(1.0, 1.0, 1.0)
    return TrueRig(radius, width, 1.0, idle, idle, float(rng.uniform(0.005, 0.025)))


def fitted(rig: TrueRig, heaviest: float, constant: Stated, rng: np.random.Generator) -> TrueRig:
    """The rig with drives that its loads ask for: full torque slows the wheel by 4-12 mrad/s until
    they catch up.
    """
    wheel = Servo(
        8e-4,
        heaviest * rig.radius / float(rng.uniform(0.004, 0.012)),
        float(rng.uniform(0.03, 0.1)),
    )
    carriage = Servo(5.0, heaviest / float(rng.uniform(2e-4, 6e-4)), float(rng.uniform(0.05, 0.15)))
    return replace(rig, torque_constant=_true(constant, rng), wheel=wheel, carriage=carriage)


def knowledge_drawn(
    rig: TrueRig, ground: PlantSoil, heaviest: float, wrench: bool, rng: np.random.Generator
) -> Knowledge:
    """A configuration for this rig: its calibrations are what the rig will be drawn around."""
    torque = heaviest * rig.radius
    constant = float(np.round(torque / 3.0, 3))
    volts = 1e-3 * float(rng.choice((1.0, 2.0, 4.0)))

    instruments = {
        "wheel_encoder": Instrument(
            Stated(2.0 * np.pi / int(rng.choice((16384, 65536))), 0.0), Stated(0.0, 0.0), 0.35
        ),
        "carriage_encoder": _carriage(rng),
        "sinkage_pot": _pot(rig, volts),
        "motor_shunt": Instrument(Stated(2.0, 0.004), Stated(-5.0, 0.002), volts),
    }
    if wrench:
        instruments |= _wrench(heaviest, torque, float(rng.uniform(0.5, 2.0)))

    return Knowledge(
        rig.radius,
        rig.width,
        0.02,
        soil_known(ground, rng),
        Stated(constant, 0.005 * constant),
        0.005,
        instruments,
    )


def _carriage(rng: np.random.Generator) -> Instrument:
    scale = 2.0 * np.pi / int(rng.choice((8192, 20000)))
    return Instrument(Stated(scale, 5e-4 * scale), Stated(0.0, 0.0), 0.35)


def _pot(rig: TrueRig, volts: float) -> Instrument:
    scale = float(np.round(rig.radius * 0.35, 4))
    return Instrument(Stated(scale, 0.002 * scale), Stated(-0.5 * scale, 1.5e-4), volts)


def _wrench(heaviest: float, torque: float, worse: float) -> dict[str, Instrument]:
    force, twist = 0.004 * worse * heaviest, 0.004 * worse * torque
    return {
        "drawbar_pull": Instrument(Stated(1.0, 0.002), Stated(0.0, 0.3 * force), force),
        "load": Instrument(Stated(1.0, 0.002), Stated(0.0, 0.3 * force), force),
        "torque": Instrument(Stated(1.0, 0.002), Stated(0.0, 0.3 * twist), twist),
    }


def chain_drawn(known: Knowledge, rng: np.random.Generator) -> SensorChain:
    """The rig's sensors as they truly are: off their calibration by an error within its sigma,
    coloured noise.
    """
    made = {
        name: _converter(name, instrument, rng) for name, instrument in known.instruments.items()
    }

    wrench = (made["drawbar_pull"], made["load"], made["torque"]) if "load" in made else None
    simple = tuple(
        made[name] for name in ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt")
    )
    return SensorChain(
        simple, wrench, float(rng.uniform(2e-5, 4e-4)), float(rng.uniform(0.0, 0.01))
    )


def _converter(name: str, instrument: Instrument, rng: np.random.Generator) -> Converter:
    """`said.noise` is the true total here; what the configuration will state may be wrong by a
    factor.
    """
    encoder = name.endswith("_encoder")
    share = 0.0 if encoder else float(rng.uniform(0.2, 0.6))
    white = 0.2 if encoder else instrument.noise * float(np.sqrt(1.0 - share**2))

    noise = SensorNoise(
        white,
        share * instrument.noise,
        float(np.exp(rng.uniform(np.log(0.03), np.log(0.6)))),
        rng.random() < 0.3,
    )

    volts = name in ("sinkage_pot", "motor_shunt")
    quantum = (
        1.0
        if encoder
        else 4.8 / 2 ** int(rng.choice((12, 14, 16)))
        if volts
        else 0.2 * instrument.noise
    )
    low, high = (0.1, 4.9) if volts else (-1e12, 1e12)
    scale, offset = _calibrated(instrument, rng)

    return Converter(
        name, scale, offset, noise, quantum, low, high, 0.0 if encoder else 1e-3, 250.0
    )


def slowed(chain: SensorChain) -> SensorChain:
    """The same sensors with noise as large, nine tenths of it correlated over SLOW."""
    wrench = chain.wrench
    if wrench is not None:
        pull, load, torque = wrench
        wrench = (_slowed(pull), _slowed(load), _slowed(torque))
    return replace(chain, converters=tuple(_slowed(one) for one in chain.converters), wrench=wrench)


def _slowed(one: Converter) -> Converter:
    if one.channel.endswith("_encoder"):
        return one
    total = float(np.hypot(one.noise.white, one.noise.colour))
    white = total * float(np.sqrt(1.0 - SLOW_SHARE**2))
    return replace(one, noise=SensorNoise(white, SLOW_SHARE * total, SLOW))


def prepared(ground: PlantSoil, rng: np.random.Generator) -> PlantSoil:
    """The soil after the bed was prepared anew, within its repeatability."""
    drawn = {
        name: getattr(ground, name)
        * (1.0 + share * float(np.clip(rng.standard_normal(), -2.5, 2.5)))
        for name, share in REPEATABILITY.items()
    }
    return replace(ground, **drawn)


def _calibrated(instrument: Instrument, rng: np.random.Generator) -> tuple[float, float]:
    """True scale and offset. Sensors are zeroed where they read nothing, so the gain errs about the
    physical zero.
    """
    gain = _true(instrument.scale, rng) / instrument.scale.value
    return instrument.scale.value / gain, (
        2.0 * instrument.offset.value - _true(instrument.offset, rng)
    ) / gain


def _true(stated: Stated, rng: np.random.Generator) -> float:
    return stated.value + stated.sigma * float(np.clip(rng.standard_normal(), -2.5, 2.5))


def misstated(known: Knowledge, factor: float) -> Knowledge:
    """The same configuration with every analogue noise wrong by a factor."""
    changed = {
        name: instrument
        if name.endswith("_encoder")
        else replace(instrument, noise=instrument.noise * factor)
        for name, instrument in known.instruments.items()
    }
    return replace(known, instruments=changed)
