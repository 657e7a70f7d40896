"""What a diagnosis found, put to use on recordings it has not seen: predictions, and measurements
freed of the effects.

The constants (soil, calibration) and accepted effects are read from the JSON alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.effects import make
from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.signals import read_all, signals
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.importers.segments import DURATION, PAUSE

RATE = 10.0  # [Hz]
RIG_STAGES = ("testbed", "drivetrain", "sensor")  # what stands between soil and reading


class Judge:
    """Recordings, and what a diagnosis said of others of the same rig."""

    def __init__(self, recordings: Sequence[Path], configuration: Path) -> None:
        self.settings: Settings = config.load(configuration).settings
        series = [signals(r, self.settings, RATE) for r in read_all(sorted(recordings))]
        self.rig = wheel_rig(series, self.settings, read_off=False)

    def time(self, run: int) -> Array:
        """Seconds since the beginning of a run (n,)."""
        return np.asarray(self.rig.runs[run].time - self.rig.runs[run].time[0])

    def measured(self, run: int, channel: str) -> Array:
        """A channel of a run (n,), in its unit."""
        return np.asarray(self.rig.runs[run].measured[channel])

    def predicted(self, diagnosis: dict[str, Any] | None = None) -> list[dict[str, Array]]:
        """Every channel (n,) of every run: by the configuration alone, or with the soil that a
        diagnosis fitted without effects.
        """
        known = np.zeros(len(self.rig.constants))
        return self.rig.predict(
            known if diagnosis is None else self._constants(diagnosis, "before"), ()
        )

    def freed(self, diagnosis: dict[str, Any], channel: str) -> list[Array]:
        """A channel (n,) of every run less what the accepted effects of the rig, and its
        calibration, put on it.
        """
        u = self._constants(diagnosis, "after")
        acting = effects(diagnosis)
        ideal = [e for e in acting if e.stage not in RIG_STAGES]

        plain = np.array(
            [
                0.0 if k.name.startswith(f"{channel}_") else x
                for k, x in zip(self.rig.constants, u, strict=True)
            ]
        )
        added = zip(self.rig.predict(u, acting), self.rig.predict(plain, ideal), strict=True)

        return [
            self.measured(n, channel) - (real[channel] - bare[channel])
            for n, (real, bare) in enumerate(added)
        ]

    def means(self, channel: str, *series: Sequence[Array]) -> Array:
        """Means (rows, conditions) of series of every run over each steady state, where the channel
        counts.
        """
        parts = []
        for n, run in enumerate(self.rig.runs):
            number = np.floor((self.time(n) - 0.5 * PAUSE) / (DURATION + PAUSE))
            inside = run.used[channel]
            parts += [
                [np.nanmean(s[n][inside & (number == k)]) for s in series]
                for k in np.unique(number[inside])
            ]

        return np.array(parts).T

    def covariate(self, name: str) -> list[Array]:
        """A covariate (n,) of every run."""
        return [np.asarray(run.covariates[name]) for run in self.rig.runs]

    def _constants(self, diagnosis: dict[str, Any], when: str) -> Array:
        """In prior σ; what the result does not state stays at its prior mean."""
        soil = (diagnosis["soil"] or {}).get(when, {})
        stated = {**(diagnosis["nuisance"] if when == "after" else {}), **soil}
        return np.array(
            [
                k.strain(stated[k.name]["value"]) if k.name in stated else 0.0
                for k in self.rig.constants
            ]
        )


def effects(diagnosis: dict[str, Any]) -> tuple[Effect, ...]:
    """The accepted effects as they were fitted."""
    return tuple(
        make(h["effect"], {n: q["value"] for n, q in h["parameters"].items()})
        for h in diagnosis["hypotheses"]
        if h["accepted"]
    )


def rms(values: Array) -> float:
    """Root mean square of what is finite of values (n,)."""
    return float(np.sqrt(np.nanmean(np.asarray(values) ** 2)))
