"""What one tick says: the fields of /tick and /loop by name, with type, unit and meaning.

`Tick` is the one table and the one order. It is made of blocks, each built by name where its values
are known; `row` lays their values one after the other, as they stand in a recording. A block that
occurs twice (`Aid`) gives its fields the name of its place as a prefix.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Annotated, Any, NamedTuple, get_origin, get_type_hints

# Raised by one whenever the same readings give another /tick, so that `gritd replay --verify`
# compares like with like. 2: changes of the soil, estimates that are not believed.
# 5: the record is judged and linearised anew in the ticks after a window; sums in a stated order,
# whatever the processor (3 and 4 were steps to it).
REVISION = 11

Field = tuple[str, str, str]  # (name, ROS type, meaning with unit)
TickRow = tuple[float, ...]  # the values of a Tick, in the order of TICK_FIELDS

Time = Annotated[int, "builtin_interfaces/Time"]  # [ns]
Byte = Annotated[int, "uint8"]
Bits = Annotated[int, "uint16"]
Count = Annotated[int, "uint32"]
LongCount = Annotated[int, "uint64"]
Real = Annotated[float, "float64"]
Truth = Annotated[bool, "bool"]


class Head(NamedTuple):
    """When the tick was, and what came in."""

    stamp: Annotated[Time, "tick time"]
    evaluated: Annotated[Time, "the instant the tick describes: centre of the window"]
    sequence: Annotated[
        LongCount, "number of the tick since the start of the run, missed ones counted"
    ]
    consumed: Annotated[Count, "readings handed to this tick"]
    status: Annotated[Byte, "Status"]
    flags: Annotated[Bits, "Flag bits"]
    stale: Annotated[Byte, "silent channels, CHANNEL_BITS"]
    stuck: Annotated[Byte, "stuck channels, CHANNEL_BITS"]
    late: Annotated[Count, "readings dropped as older than the horizon, since the start"]
    duplicates: Annotated[Count, "readings dropped as duplicates, since the start"]
    jumps: Annotated[Count, "encoder jumps re-baselined, since the start"]
    invalid: Annotated[Count, "readings refused as non-finite or out of range, since the start"]


class Measurements(NamedTuple):
    """What the sensors say of this window, effects accounted for."""

    wheel_angle: Annotated[Real, "[rad]"]
    wheel_speed: Annotated[Real, "ω [rad/s]"]
    wheel_speed_sigma: Annotated[Real, "its standard deviation [rad/s]"]
    carriage_position: Annotated[Real, "[m]"]
    carriage_speed: Annotated[Real, "v [m/s]"]
    carriage_speed_sigma: Annotated[Real, "its standard deviation [m/s]"]
    slip: Annotated[Real, "i [-]"]
    slip_sigma: Annotated[Real, "its standard deviation [-]"]
    sinkage: Annotated[Real, "z [m]"]
    sinkage_sigma: Annotated[Real, "its standard deviation [m]"]
    theta_1: Annotated[Real, "entry angle θ₁ [rad]"]
    theta_1_sigma: Annotated[Real, "its standard deviation [rad]"]
    theta_m: Annotated[Real, "angle of maximum stress θₘ [rad]"]
    current: Annotated[Real, "motor current [A]"]
    temperature: Annotated[Real, "motor temperature [°C], NaN without the sensor"]
    torque: Annotated[Real, "T measured at the axle [N·m]"]
    torque_sigma: Annotated[Real, "its standard deviation [N·m]"]
    load: Annotated[Real, "W measured, or configured [N]"]
    load_sigma: Annotated[Real, "its standard deviation [N]"]
    drawbar_pull: Annotated[Real, "DP measured, NaN without the sensor [N]"]
    drawbar_pull_sigma: Annotated[Real, "its standard deviation [N]"]


class SoilEstimate(NamedTuple):
    """The filter's estimate and its covariance."""

    cohesion: Annotated[Real, "c [Pa]"]
    cohesion_sigma: Annotated[Real, "its standard deviation [Pa]"]
    tan_phi: Annotated[Real, "tan φ [-]"]
    tan_phi_sigma: Annotated[Real, "its standard deviation [-]"]
    shear_modulus: Annotated[Real, "k [m]"]
    shear_modulus_sigma: Annotated[Real, "its standard deviation [m]"]
    cov_c_tan_phi: Annotated[Real, "[Pa]"]
    cov_c_ln_k: Annotated[Real, "[Pa]"]
    cov_tan_phi_ln_k: Annotated[Real, "[-]"]


class Predictions(NamedTuple):
    """What the estimate says of this window; NaN where the wheel touches nothing."""

    torque_predicted: Annotated[Real, "T from Eq. 22 at the estimate [N·m]"]
    torque_predicted_sigma: Annotated[Real, "its standard deviation [N·m]"]
    load_predicted: Annotated[Real, "W from Eq. 21 with σₘ of Eq. 3 and the prior moduli [N]"]
    load_predicted_sigma: Annotated[Real, "its standard deviation [N]"]
    drawbar_pull_predicted: Annotated[Real, "DP from Eq. 20 at the estimate [N]"]
    drawbar_pull_predicted_sigma: Annotated[Real, "its standard deviation [N]"]
    rolling_resistance: Annotated[Real, "second term of Eq. 8 [N]"]
    rolling_resistance_sigma: Annotated[Real, "its standard deviation [N]"]


class LargestPull(NamedTuple):
    """The largest drawbar pull that the soil offers."""

    drawbar_pull_max: Annotated[Real, "largest DP over slip at this load and sinkage [N]"]
    drawbar_pull_max_sigma: Annotated[Real, "its standard deviation [N]"]
    drawbar_pull_max_slip: Annotated[Real, "the slip at which it is reached [-]"]


class FilterHealth(NamedTuple):
    """Whether the estimate can be trusted."""

    separability: Annotated[
        Real, "posterior over prior σ in the weakest direction of (c, tan φ) [-]"
    ]
    consistency: Annotated[
        Real, "mean normalised innovation squared per measurement over 2 s, 1 when honest [-]"
    ]
    updates: Annotated[LongCount, "filter updates applied since the start"]
    resets: Annotated[Count, "covariance resets since the start"]


class Aid(NamedTuple):
    """What every measurement update leaves; zeros where there was no update."""

    z: Annotated[Real, "measurement offered to the filter [{unit}]"]
    r: Annotated[Real, "its variance, all known noise included [{unit}²]"]
    innovation: Annotated[Real, "measurement minus prediction before the update [{unit}]"]
    s: Annotated[Real, "innovation variance [{unit}²]"]
    test_ratio: Annotated[Real, "innovation² / (gate² · S) [-]"]
    accepted: Annotated[Truth, "true only if it was applied"]


class Tick(NamedTuple):
    """One tick: its blocks in the order of the recording."""

    head: Head
    measurements: Measurements
    soil: SoilEstimate
    predictions: Predictions
    largest_pull: LargestPull
    health: FilterHealth
    torque: Annotated[Aid, "N·m"]
    drawbar_pull: Annotated[Aid, "N"]


class LoopRecord(NamedTuple):
    """One /loop message: what only the live loop can know."""

    stamp: Annotated[Time, "tick time"]
    lateness: Annotated[Real, "wake-up minus deadline [s]"]
    duration: Annotated[Real, "time the tick took [s]"]
    missed: Annotated[LongCount, "ticks missed since the start"]
    queued: Annotated[Count, "readings waiting when the tick began"]
    dropped: Annotated[LongCount, "readings the queue dropped since the start"]
    log_queued: Annotated[Count, "messages waiting for the writer"]
    log_dropped: Annotated[LongCount, "messages the writer dropped since the start"]
    wall_offset: Annotated[Real, "wall clock minus the daemon's clock [s]; a step shows here"]


def row(blocks: tuple[tuple[Any, ...], ...]) -> TickRow:
    """The values of all blocks, one after the other."""
    return tuple(chain.from_iterable(blocks))


def names_of(blocks: type) -> tuple[str, ...]:
    """Names of the values in a row of a tuple of blocks, like `Tick`."""
    return tuple(prefix + name for block, prefix, _ in _placed(blocks) for name in block._fields)


def _placed(blocks: type) -> Iterator[tuple[Any, str, str]]:
    """Each block's class with the prefix of its names and the unit that its place gives."""
    for place, hint in get_type_hints(blocks, include_extras=True).items():
        if get_origin(hint) is Annotated:
            yield hint.__origin__, f"{place}_", hint.__metadata__[0]
        else:
            yield hint, "", ""


def _fields_of(block: type, prefix: str = "", unit: str = "") -> Iterator[Field]:
    for name, hint in get_type_hints(block, include_extras=True).items():
        kind, meaning = hint.__metadata__
        yield prefix + name, kind, meaning.replace("{unit}", unit)


def fields_of(blocks: type) -> tuple[Field, ...]:
    """Fields of the values in a row of a tuple of blocks, like `Tick`."""
    return tuple(field for placed in _placed(blocks) for field in _fields_of(*placed))


TICK_NAMES = names_of(Tick)
TICK_FIELDS = fields_of(Tick)
LOOP_FIELDS = tuple(_fields_of(LoopRecord))
