"""The format of the configuration file: every key with its kind, unit, bounds, default and
meaning.

Parsing, defaults, error lines and the reference in docs/configuration.md all come from these
tables. A default is written as it would be in the file. The builders below them check what
concerns several keys at once.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, tan
from pathlib import Path
from typing import Any

from gritd.estimator.config.channels import channels
from gritd.estimator.config.devices import NAME, device
from gritd.estimator.config.discrepancy import discrepancy
from gritd.estimator.config.effect_keys import Effects, EffectSchema
from gritd.estimator.config.kinds import (
    UNLIMITED,
    Choice,
    Either,
    Integer,
    Interval,
    NumberWithUnit,
    Text,
)
from gritd.estimator.config.names import EXPECTED, PATTERN
from gritd.estimator.config.schema import (
    ABSENT,
    Impossible,
    Key,
    Named,
    Section,
    uncertain,
)
from gritd.estimator.config.settings import (
    ENGINES,
    BedSettings,
    Drive,
    FilterSettings,
    Load,
    Logging,
    PeakPrior,
    Rates,
    Repeatability,
    Settings,
    SoilPrior,
    Uncertain,
)
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.terramechanics.soil import PressureSinkage, Wheel

# ---- wheel, soil, drive, load --------------------------------------------------------------------

WHEEL = {
    "radius": Key(NumberWithUnit("m", above=0, high=5), "wheel radius r"),
    "width": Key(NumberWithUnit("m", above=0, high=5), "wheel width b"),
    "c1": Key(
        uncertain("", low=0, high=1),
        "c₁ of θₘ = (c₁ + c₂ i) θ₁, Eq. (5); the default covers what was measured in sands",
        "{value: 0.5, sigma: 0.1}",
    ),
    "c2": Key(uncertain("", low=-1, high=1), "c₂ of Eq. (5)", "{value: 0.0, sigma: 0.2}"),
}

SOIL = {
    "cohesion": Key(uncertain("Pa", low=0, high=1e6), "cohesion c, before the run"),
    "tan_phi": Key(
        uncertain("", above=0, high=5),
        "tangent of the internal friction angle φ, before the run",
        ABSENT,
    ),
    "phi": Key(
        uncertain("rad", above=0, high=1.373), "φ itself, instead of `tan_phi`: `30 deg`", ABSENT
    ),
    "shear_modulus": Key(uncertain("m", above=0, high=1), "shear deformation modulus k, Eq. (2)"),
    "exponent": Key(uncertain("", above=0, high=5), "sinkage exponent n"),
    "k_c": Key(NumberWithUnit("Pa/m^(n-1)"), "with `k_phi`, Bekker: σ = (k_c/b + k_φ) zⁿ", ABSENT),
    "k_phi": Key(NumberWithUnit("Pa/m^n"), "with `k_c`", ABSENT),
    "k1": Key(
        NumberWithUnit("Pa"),
        "with `k2`, instead of `k_c` and `k_phi`, Reece, Eq. (1): σ = (k₁ + k₂ b)(z/b)ⁿ",
        ABSENT,
    ),
    "k2": Key(NumberWithUnit("Pa/m"), "with `k1`", ABSENT),
    "modulus_sigma": Key(
        NumberWithUnit("", low=0, high=1), "relative standard deviation of K in σ = K zⁿ", "0.0"
    ),
}

DRIVE = {
    "torque_constant": Key(
        uncertain("N*m/A", above=0), "torque at the wheel axle per ampere of motor current"
    ),
    "torque_source": Key(
        Choice(("motor_shunt", "wrench", "none")),
        "the channel that gives the torque; none: the drawbar pull alone tells of the soil",
        "motor_shunt",
    ),
}

LOAD = {
    "nominal": Key(
        uncertain("N", above=0), "vertical load W on the wheel where no wrench measures it"
    ),
    "minimum": Key(NumberWithUnit("N", low=0), "under this load the wheel is in the air", "5 N"),
}

FORMS = {"bekker": ("k_c", "k_phi"), "reece": ("k1", "k2")}


def _soil(
    exponent: Uncertain, tan_phi: Uncertain | None, phi: Uncertain | None, **values: Any
) -> SoilPrior:
    """Raises Impossible unless friction and moduli stand there in exactly one form each."""
    friction = _friction(tan_phi, phi)
    moduli = {form: [values.pop(name) for name in names] for form, names in FORMS.items()}
    begun = [form for form, pair in moduli.items() if pair != [None, None]]
    expected = "the moduli in one form, k_c and k_phi or k1 and k2"
    if len(begun) != 1:
        raise Impossible(
            "k1" if begun and moduli["reece"][0] is not None else "k2" if begun else "k_c", expected
        )

    form = begun[0]
    for name, value in zip(FORMS[form], moduli[form], strict=True):
        if value is None:
            raise Impossible(name, expected)

    law = PressureSinkage("bekker" if form == "bekker" else "reece", exponent.value, *moduli[form])
    return SoilPrior(exponent=exponent, tan_phi=friction, pressure_sinkage=law, **values)


def _friction(tan_phi: Uncertain | None, phi: Uncertain | None) -> Uncertain:
    """tan φ, from φ [rad] where that is given: d tan φ = dφ / cos² φ. Raises Impossible."""
    if phi is None and tan_phi is not None:
        return tan_phi
    if phi is not None and tan_phi is None:
        return Uncertain(tan(phi.value), phi.sigma / cos(phi.value) ** 2)
    raise Impossible("tan_phi", "the friction in one form, tan_phi or phi")


def _wheel(c1: Uncertain, c2: Uncertain, **values: float) -> tuple[Wheel, PeakPrior]:
    return Wheel(c1=c1.value, c2=c2.value, **values), PeakPrior(c1.sigma, c2.sigma)


def _load(nominal: Uncertain, minimum: float) -> Load:
    if minimum >= nominal.value:
        raise Impossible("minimum", "less than load.nominal")
    return Load(nominal, minimum)


# ---- rates, filter, logging, effects, run --------------------------------------------------------

AUTO = "auto"
RATES = {
    "tick": Key(NumberWithUnit("Hz", low=1, high=2000), "ticks of the estimator", "250 Hz"),
    "update": Key(
        Either(AUTO, NumberWithUnit("Hz", low=0.01, high=1000)),
        "updates of the filter; its window is 1/update. auto: a window of 0.1 to 3.2 s, as short "
        "as the noise of slip allows",
        AUTO,
    ),
    "horizon": Key(
        NumberWithUnit("s", above=0, high=1), "a tick describes the bed this long ago", "50 ms"
    ),
}

FILTER = {
    "engine": Key(Choice(ENGINES), "equal to 1e-9; filterpy takes 1 s and 60 MB more", "plain"),
    "cohesion_walk": Key(
        NumberWithUnit("Pa/sqrt(s)", low=0, high=1e6), "random walk of c", "2 Pa/sqrt(s)"
    ),
    "tan_phi_walk": Key(
        NumberWithUnit("1/sqrt(s)", low=0, high=10), "random walk of tan φ", "2e-4 1/sqrt(s)"
    ),
    "ln_k_walk": Key(
        NumberWithUnit("1/sqrt(s)", low=0, high=10), "random walk of ln k", "1e-4 1/sqrt(s)"
    ),
    "gate": Key(
        NumberWithUnit("", low=0.1, high=1e6),
        "innovations of more standard deviations are rejected",
        "5.0",
    ),
    "cohesion_bounds": Key(
        Interval(NumberWithUnit("Pa", low=0)), "c stays inside", "[0 kPa, 50 kPa]"
    ),
    "tan_phi_bounds": Key(
        Interval(NumberWithUnit("", above=0)), "tan φ stays inside", "[0.05, 1.5]"
    ),
    "shear_modulus_bounds": Key(
        Interval(NumberWithUnit("m", above=0)), "k stays inside", "[1 mm, 200 mm]"
    ),
    "estimate_k": Key(
        Choice(("auto", "always", "never")),
        "read, so that older recordings are, and without effect: k is estimated with its prior",
        "auto",
    ),
    "model_sigma": Key(
        NumberWithUnit("", low=0, high=1),
        "relative error of the closed forms not modelled elsewhere",
        "0.0",
    ),
}

LOGGING = {
    "directory": Key(NAME, "folder of the recordings", "runs"),
    "flush_interval": Key(
        NumberWithUnit("s", above=0, high=60),
        "every chunk is closed and synced this often",
        "200 ms",
    ),
    "compression": Key(Choice(("zstd", "lz4", "none")), "compression of a chunk", "zstd"),
    "part_size": Key(
        NumberWithUnit("B", low=100e3, unlimited=True),
        "beyond it a new recording part begins",
        "256 MB",
    ),
    "part_time": Key(NumberWithUnit("s", low=1, unlimited=True), "and after this time", "1 h"),
    "disk_cap": Key(
        NumberWithUnit("B", low=1e6, unlimited=True),
        "all recordings in the folder together; beyond it the oldest closed ones are deleted",
        UNLIMITED,
    ),
    "readable_by": Key(
        Choice(("owner", "group")), "who may read the recordings: mode 0600 or 0640", "owner"
    ),
}

REPEATABILITY = {
    "cohesion": Key(NumberWithUnit("Pa", low=0), "of c", "0 Pa"),
    "tan_phi": Key(NumberWithUnit("", low=0), "of tan φ", "0.0"),
    "shear_modulus": Key(NumberWithUnit("", low=0, high=1), "of k, relative", "0 %"),
    "surface": Key(NumberWithUnit("m", low=0, high=0.1), "of its height along the bed", "0 mm"),
}

BED = {
    "name": Key(
        Text(EXPECTED, PATTERN), "the bed in the bin; none: every run begins with `soil`", "''"
    ),
    "repeatability": Key(
        Section(REPEATABILITY, Repeatability),
        "standard deviation of one preparation about the bed's soil",
        "{}",
    ),
    "stale_after": Key(
        NumberWithUnit("s", above=0, unlimited=True),
        "without a run for so long the next begins with `soil`",
        "168 h",
    ),
}

RUN = {
    "name": Key(Text(EXPECTED, PATTERN), "name of the run and its files", "''"),
    "load": Key(NumberWithUnit("N", above=0), "nominal load of the run", ABSENT),
    "pass": Key(Integer(1, 1000), "how often the wheel goes over this track, from 1", "1"),
    "start": Key(NumberWithUnit("m"), "starting position of the wheel on the bed", "0 m"),
    "operator": Key(Text(), "who runs it, for the lab book", "''"),
    "notes": Key(Text(), "anything worth keeping, one line", "''"),
}


def _run(name: str, load: float | None, start: float, **values: Any) -> RunInfo:
    return RunInfo(name, load, values["pass"], start, values["notes"], operator=values["operator"])


def _rates(tick: float, update: float | None, horizon: float) -> Rates:
    if update is None:
        return Rates(tick, horizon=horizon, auto=True)
    ratio = tick / update
    if round(ratio) < 2 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        raise Impossible(
            "tick", f"a whole multiple of rates.update ({update:g} Hz), at least twice it"
        )
    return Rates(tick, update, horizon)


# ---- the whole file ------------------------------------------------------------------------------


def table(folder: Path | None = None, effect_schema: EffectSchema | None = None) -> Section:
    """The whole format; reading it gives (Settings, run). Relative paths count from the folder,
    if there is one.
    """
    devices = Named(
        device(folder), lambda name, value: replace(value, name=name), "a mapping of devices"
    )

    keys = {
        "testbed": Key(NAME, "name of the testbed"),
        "wheel": Key(Section(WHEEL, _wheel), "the rigid wheel"),
        "pulley_radius": Key(
            NumberWithUnit("m", above=0, high=5), "radius of the carriage encoder's pulley"
        ),
        "soil": Key(Section(SOIL, _soil), "what is known of the soil before the run"),
        "drive": Key(Section(DRIVE, Drive), "motor and gear, seen from the wheel axle"),
        "load": Key(Section(LOAD, _load), "the vertical load"),
        "devices": Key(devices, "serial ports and CAN buses, by names of your choice"),
        "channels": Key(channels(), "the sensors"),
        "rates": Key(Section(RATES, _rates), "how often", "{}"),
        "filter": Key(Section(FILTER, FilterSettings), "the extended Kalman filter", "{}"),
        "logging": Key(Section(LOGGING, Logging), "the recordings", "{}"),
        "bed": Key(Section(BED, BedSettings), "runs on one bed add up to one estimate", "{}"),
        "effects": Key(Effects(effect_schema), "physics beyond the paper's, by effect name", "{}"),
        "discrepancy": Key(
            discrepancy(),
            "what the equations miss on this rig, as `gritd diagnose --apply` wrote it",
            ABSENT,
        ),
        "run": Key(
            Section(RUN, _run), "about this run; the command line may say it instead", ABSENT
        ),
    }

    return Section(keys, _settings)


def _settings(
    channels: dict[str, Any], run: RunInfo | None, **values: Any
) -> tuple[Settings, RunInfo]:
    wrench = channels.pop("wrench")
    known = {name: channel for name, channel in channels.items() if channel is not None}
    wheel, peak = values.pop("wheel")
    settings = Settings(channels=known, wrench=wrench, wheel=wheel, peak=peak, **values)
    _check_channels(settings)
    _check_soil(settings)
    return settings, run or RunInfo()


def _check_channels(settings: Settings) -> None:
    """Every channel has its device and arrives within the horizon; the torque's channel is
    there.
    """
    source, wrench = settings.drive.torque_source, settings.wrench
    if source == "wrench" and wrench is None:
        raise Impossible("drive.torque_source", "motor_shunt, since there is no channel wrench")
    if source == "none" and (wrench is None or not wrench.pulls):
        raise Impossible(
            "drive.torque_source", "motor_shunt or wrench, since no drawbar pull is measured"
        )

    sources = dict(settings.channels) | ({"wrench": settings.wrench} if settings.wrench else {})
    for name, channel in sources.items():
        if channel.device not in settings.devices:
            names = ", ".join(settings.devices) or "none there"
            raise Impossible(f"channels.{name}.device", f"the name of a device ({names})")
        if channel.latency >= settings.rates.horizon:
            raise Impossible(
                f"channels.{name}.latency", "less than rates.horizon, or no reading arrives in time"
            )


def _check_soil(settings: Settings) -> None:
    """The moduli carry the wheel, and the filter starts inside its bounds."""
    soil, bounds = settings.soil, settings.filter
    if settings.soil.pressure_sinkage.modulus(settings.wheel.width) <= 0:
        second = FORMS[soil.pressure_sinkage.form][1]
        raise Impossible(f"soil.{second}", "moduli that give a positive pressure under this wheel")

    for name in ("cohesion", "tan_phi", "shear_modulus"):
        low, high = getattr(bounds, f"{name}_bounds")
        value = getattr(soil, name).value
        if not low <= value <= high:
            raise Impossible(
                f"soil.{name}", f"a value inside filter.{name}_bounds", f"{value:g} (SI)"
            )
