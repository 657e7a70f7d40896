"""The typed configuration: SI units, frozen, nothing parsed here (see config.py)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import inf
from typing import Literal

from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.model.learnt import LearntForm
from gritd.estimator.terramechanics.soil import PressureSinkage, Wheel

ENGINES = ("filterpy", "plain")  # of the filter
# [N], [N·m] an axis of the wrench whose zero is no better known than this is not measured
UNMEASURED = 1e5
NO_SIGNAL = "none"  # of a channel that a rig does not have


@dataclass(frozen=True)
class Uncertain:
    """A value and its standard deviation, same unit."""

    value: float
    sigma: float = 0.0


@dataclass(frozen=True)
class SoilPrior:
    """What is known of the soil before the run, each value ± one standard deviation."""

    cohesion: Uncertain  # c [Pa]
    tan_phi: Uncertain  # tangent of the internal friction angle [-]
    shear_modulus: Uncertain  # k [m]
    exponent: Uncertain  # n [-]
    pressure_sinkage: PressureSinkage  # moduli in either form; .modulus(width) gives K of σ = K zⁿ
    modulus_sigma: float = 0.0  # relative standard deviation of K [-]


@dataclass(frozen=True)
class PeakPrior:
    """How well the place of the stress peak is known: σ of c₁ and c₂ of Eq. (5)."""

    c1_sigma: float = 0.0
    c2_sigma: float = 0.0


@dataclass(frozen=True)
class Calibration:
    """physical = raw · scale + offset. Units of scale and offset depend on the channel."""

    scale: Uncertain
    offset: Uncertain
    date: str = ""
    serial: str = ""


@dataclass(frozen=True)
class Channel:
    """One sensor channel: where it comes from and how raw becomes physical.

    Physical units: wheel_encoder rad; carriage_encoder rad of the pulley; sinkage_pot m;
    motor_shunt A; motor_temperature K above 0 °C (°C); wrench: see Wrench.
    """

    name: str
    device: str
    signal: str  # channel key in the frame, or Message.Signal of the DBC
    calibration: Calibration
    noise: float  # standard deviation of one reading, raw unit (counts, V, °C)
    low: float  # valid raw range; outside is quarantined
    high: float
    latency: float = 0.0  # [s] the sample is older than its stamp by this much
    stale_after: float = 0.04  # [s] silence after which the channel is STALE
    bits: int = 32  # width of an encoder's counter on the wire
    modulus: int | None = None  # [count] at which it wraps, where that is not 2^bits
    resolution: float | None = None  # one count in the number that is sent, where that is no count
    # fastest believable change [raw/s]; a faster one is a counter jump
    max_rate: float = inf

    @property
    def there(self) -> bool:
        """Whether there is such a sensor: a drive without a carriage says `signal: none`."""
        return self.signal != NO_SIGNAL


@dataclass(frozen=True)
class Wrench:
    """The optional force/torque sensor. fx is drawbar pull, fy side force, fz vertical load, ty
    torque about the axle.
    """

    device: str
    signal: str
    drawbar_pull: Calibration  # [-], [N]
    load: Calibration  # [-], [N]
    torque: Calibration  # [-], [N·m]
    force_noise: float  # [N] one reading
    torque_noise: float  # [N·m] one reading
    max_force: float = 1e4  # [N]
    max_torque: float = 1e3  # [N·m]
    latency: float = 0.0
    stale_after: float = 0.04
    side_force: Calibration | None = None  # [-], [N]

    @property
    def pulls(self) -> bool:
        """Whether the drawbar pull is measured."""
        return self.drawbar_pull.offset.sigma < UNMEASURED


@dataclass(frozen=True)
class Device:
    """A serial port or a CAN bus."""

    name: str
    kind: Literal["serial", "can"]
    port: str = ""  # serial: path
    baud: int = 115200
    framing: Literal["cobs", "ascii"] = "cobs"
    interface: str = "socketcan"  # can: python-can interface name
    channel: str = "can0"
    bitrate: int = 500_000
    dbc: str = ""  # path, resolved against the configuration file's folder
    # passed to python-can
    options: dict[str, str | int | float | bool] = field(default_factory=dict)
    # inline definitions instead of a DBC
    signals: dict[str, dict[str, object]] = field(default_factory=dict)


@dataclass(frozen=True)
class Drive:
    """Motor and gear, seen from the wheel axle."""

    torque_constant: Uncertain  # torque at the axle per ampere [N·m/A]
    # none: the drawbar pull alone tells of the soil
    torque_source: Literal["motor_shunt", "wrench", "none"] = "motor_shunt"


@dataclass(frozen=True)
class Load:
    """Vertical load W where no force/torque sensor measures it."""

    nominal: Uncertain  # [N]
    minimum: float = 5.0  # [N] below this the wheel is in the air


@dataclass(frozen=True)
class Rates:
    tick: float = 250.0  # [Hz]
    update: float = 10.0  # [Hz] filter updates; the averaging window is 1/update
    horizon: float = 0.05  # [s] a tick describes the bed this long ago
    # whether the pipeline chooses the window by what the encoders read (wheel/window_choice.py)
    auto: bool = False


@dataclass(frozen=True)
class FilterSettings:
    engine: Literal["filterpy", "plain"] = "plain"  # of ENGINES
    cohesion_walk: float = 2.0  # [Pa/√s]
    tan_phi_walk: float = 2e-4  # [1/√s]
    ln_k_walk: float = 1e-4  # [1/√s]
    gate: float = 5.0  # [σ] test ratio above 1 is rejected
    cohesion_bounds: tuple[float, float] = (0.0, 50e3)  # [Pa]
    tan_phi_bounds: tuple[float, float] = (0.05, 1.5)
    shear_modulus_bounds: tuple[float, float] = (1e-3, 0.2)  # [m]
    estimate_k: Literal["auto", "always", "never"] = "auto"
    model_sigma: float = 0.0  # relative error of the closed forms not otherwise modelled [-]


@dataclass(frozen=True)
class Logging:
    directory: str = "runs"
    flush_interval: float = 0.2  # [s] every chunk is closed and synced this often
    compression: Literal["zstd", "lz4", "none"] = "zstd"
    part_size: float = 256e6  # [bytes] a new part of the recording begins beyond it …
    part_time: float = 3600.0  # [s] … and after this time
    # [bytes] of all recordings in the folder; the oldest closed ones are deleted
    disk_cap: float = float("inf")
    readable_by: Literal["owner", "group"] = "owner"


@dataclass(frozen=True)
class Repeatability:
    """How far one preparation of a bed lies from all of them, standard deviations."""

    cohesion: float = 0.0  # [Pa]
    tan_phi: float = 0.0
    shear_modulus: float = 0.0  # share of k
    surface: float = 0.0  # [m]


@dataclass(frozen=True)
class BedSettings:
    """The bed that runs are driven on, one after the other."""

    name: str = ""  # none: every run begins with the stated prior
    repeatability: Repeatability = Repeatability()
    stale_after: float = 7 * 86400.0  # [s] without a run; then the next begins with the prior


@dataclass(frozen=True)
class BedPosition:
    """Where on the bed a run takes place; from the run's own metadata."""

    pass_number: int = 1  # how many times the wheel has gone over this soil, this run included
    start_position: float = 0.0  # [m]


@dataclass(frozen=True)
class ConfiguredEffect:
    """An effect the filter and the simulator apply, with its parameters ± sigma in SI."""

    name: str
    parameters: dict[str, Uncertain]


@dataclass(frozen=True)
class Settings:
    testbed: str
    wheel: Wheel
    pulley_radius: float  # [m] carriage encoder pulley
    soil: SoilPrior
    drive: Drive
    load: Load
    channels: dict[str, Channel]  # by channel name, without the wrench
    wrench: Wrench | None
    devices: dict[str, Device]
    rates: Rates
    filter: FilterSettings
    logging: Logging
    effects: tuple[ConfiguredEffect, ...] = ()
    place: BedPosition = BedPosition()
    bed: BedSettings = BedSettings()
    peak: PeakPrior = PeakPrior()
    discrepancy: LearntForm | None = None  # what the equations miss on this rig, as it was learnt


def settings_of_run(settings: Settings, run: RunInfo) -> Settings:
    """The settings of one run: its place on the bed, and its nominal load where it states one."""
    settings = replace(settings, place=BedPosition(run.pass_number, run.start_position))
    if run.nominal_load is None:
        return settings
    nominal = replace(settings.load.nominal, value=run.nominal_load)
    return replace(settings, load=replace(settings.load, nominal=nominal))
