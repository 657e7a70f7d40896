"""The forward model: a schedule in, what the sensors send out."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.nearest import did_you_mean
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.model.forward import Response
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Soil
from gritd.interface.filtering import Series
from gritd.interface.runs import Place, Run, configured, read
from gritd.tools.testbed import run_files
from gritd.tools.testbed import schedule as schedules
from gritd.tools.testbed.schedule import Schedule, Segment
from gritd.tools.testbed.simulation import SimulatedRun as Made
from gritd.tools.testbed.simulation import simulate_run, soil_of

SEGMENT = tuple(field.name for field in fields(Segment))
SOIL = ("cohesion", "tan_phi", "shear_modulus", "exponent", "modulus_factor")


@dataclass(frozen=True)
class Simulation:
    """A simulated run: the truth, and what the sensors sent."""

    configuration: Configuration
    soil: Soil
    made: Made

    @property
    def motion(self) -> Motion:
        """What the wheel did; arrays (n,), SI."""
        return self.made.motion

    @property
    def truth(self) -> Response:
        """Sinkage, forces, torque as they were, arrays (n,), SI; `.sensed` as sensors feel it."""
        return self.made.response

    @property
    def arrays(self) -> dict[str, Series]:
        """Channel → (times [s], raw values), for `Filter.run`."""
        start = min(reading.stamp for reading in self.made.readings)
        series: dict[str, tuple[list[float], list[object]]] = {}
        for reading in self.made.readings:
            times, values = series.setdefault(reading.channel, ([], []))
            times.append((reading.stamp - start) / NS)
            values.append(reading.value)
        return {
            name: (np.array(times), np.array(values)) for name, (times, values) in series.items()
        }

    def __repr__(self) -> str:
        time = np.asarray(self.motion.time)
        soil = f"c {float(self.soil.cohesion):.0f} Pa, tan φ {float(self.soil.tan_phi):.4f}"
        return f"Simulation({np.ptp(time):.1f} s, {soil})"

    def write(self, path: Place) -> Run:
        """The recording of it. Raises RecordingError where the file is there or cannot be made."""
        loads = set(np.round(np.asarray(self.made.motion.load), 9).tolist())
        load = loads.pop() if len(loads) == 1 else None
        info = RunInfo(name=Path(path).stem, nominal_load=load)
        run_files.write(Path(path), self.configuration, info, self.made)
        return read(path)


def simulate(
    config: Place | Configuration | None = None,
    schedule: Place | Schedule | Sequence[Mapping[str, float]] | None = None,
    *,
    soil: Mapping[str, float] | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    seed: int = 0,
) -> Simulation:
    """A run of a testbed by Eqs. (1)-(10).

    config: the testbed; default: the packaged one.
    schedule: a file as for `gritd simulate`, or segments {duration [s], load [N], slip, speed
        [m/s]}; default: three loads, five slips.
    soil: values in the place of the configured ones: cohesion [Pa], tan_phi, shear_modulus [m],
        exponent, modulus_factor.
    effects: name → parameters in SI; default: those of the configuration do not act.
    seed: of the noise.

    Raises ConfigError and ValueError, one line.

    >>> steps = [{"duration": 4.0, "load": 60.0, "slip": 0.2, "speed": 0.02}]
    >>> run = simulate(schedule=steps, soil={"cohesion": 1200.0}, seed=1)
    >>> float(run.soil.cohesion), sorted(run.arrays)[0]
    (1200.0, 'carriage_encoder')
    """
    library = importlib.import_module("gritd.estimator.effects")
    configuration = configured(packaged() if config is None else config)
    settings = configuration.settings

    motion = schedules.motion_of(_schedule(schedule), settings.wheel.radius, settings.rates.tick)
    acting = tuple(library.make(name, values) for name, values in (effects or {}).items())
    true = soil_of(settings, _checked(soil))
    made = simulate_run(settings, true, motion, acting, seed)
    return Simulation(configuration, true, made)


def _schedule(given: Place | Schedule | Sequence[Mapping[str, float]] | None) -> Schedule:
    """Raises ConfigError, ValueError."""
    if isinstance(given, Schedule):
        return given
    if given is None:
        return schedules.read(packaged("schedule.yaml"))
    if isinstance(given, Sequence) and not isinstance(given, str):
        if not given:
            raise ValueError(f"schedule: found no segments; expected {{{', '.join(SEGMENT)}}} each")
        return Schedule(tuple(_segment(number, each) for number, each in enumerate(given, 1)), 0.5)
    return schedules.read(Path(given))


def _segment(number: int, given: Mapping[str, float]) -> Segment:
    """Raises ValueError where a key is missing or unknown."""
    if set(given) != set(SEGMENT):
        raise ValueError(
            f"segment {number}: found {', '.join(given) or 'nothing'}; "
            f"expected {', '.join(SEGMENT)}"
        )
    return Segment(**given)


def _checked(soil: Mapping[str, float] | None) -> Mapping[str, float] | None:
    """Raises ValueError for an unknown name."""
    for name in soil or ():
        if name not in SOIL:
            raise ValueError(
                f"soil: found {name!r}{did_you_mean(name, SOIL)}; expected {', '.join(SOIL)}"
            )
    return soil
