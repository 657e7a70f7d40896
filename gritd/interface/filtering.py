"""The on-line filter over recordings or over arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import Settings, Uncertain, settings_of_run
from gritd.estimator.messages.readings import CHANNELS, ENCODERS, NS
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.messages.status import Status
from gritd.estimator.offline.batch import Replayed, followed, replayed
from gritd.estimator.offline.playback import without_absent
from gritd.estimator.offline.streams import streams_of
from gritd.estimator.online.bed import RunStart
from gritd.interface.runs import Place, Run, Table, configured

Series = tuple[ArrayLike, ArrayLike]  # times [s] (n,) and raw values (n,), of the wrench (n, 6)


@dataclass(frozen=True)
class Estimates:
    """What the filter made of a run: one row a window.

    rows: structured (n,), the fields of /tick that belong to a window, in SI (docs/recording.md).
    """

    rows: Table
    replayed: Replayed

    @property
    def time(self) -> NDArray[np.float64]:
        """Of each row (n,) [s], from the first."""
        evaluated = self.rows["evaluated"]
        return np.asarray((evaluated - evaluated[0]) / NS, dtype=np.float64)

    @property
    def tracking(self) -> NDArray[np.bool_]:
        """Rows (n,) at which the filter was updated and is believed."""
        return np.asarray(self.rows["status"] == Status.TRACKING)

    @property
    def cohesion(self) -> Uncertain:
        """c at the end [Pa]."""
        return self._last("cohesion")

    @property
    def tan_phi(self) -> Uncertain:
        """Tangent of the internal friction angle at the end."""
        return self._last("tan_phi")

    @property
    def shear_modulus(self) -> Uncertain:
        """k at the end [m]."""
        return self._last("shear_modulus")

    @property
    def believed(self) -> bool:
        """Whether what the run leaves is believed, of all that it showed."""
        return self.replayed.believed

    @property
    def reason(self) -> str:
        """Why it is not believed, and what to do; empty where it is."""
        return str(self.replayed.reason)

    def _last(self, name: str) -> Uncertain:
        return Uncertain(float(self.rows[name][-1]), float(self.rows[f"{name}_sigma"][-1]))

    def __repr__(self) -> str:
        c, tan_phi, k = self.cohesion, self.tan_phi, self.shear_modulus
        return (
            f"c {c.value:.0f} ± {c.sigma:.0f} Pa, tan φ {tan_phi.value:.4f} ± {tan_phi.sigma:.4f}, "
            f"k {k.value * 1e3:.1f} ± {k.sigma * 1e3:.1f} mm after {len(self.rows)} windows"
            f"{'' if self.believed else f' (not believed: {self.reason})'}"
        )


class Filter:
    """The filter of a configuration. The same readings give the same estimates as on line."""

    def __init__(self, config: Place | Configuration) -> None:
        """config: a file or a configuration that is read. Raises ConfigError."""
        self.configuration = configured(config)

    def run(
        self,
        readings: Run | Mapping[str, Series],
        *,
        load: float | None = None,
        after: Estimates | None = None,
    ) -> Estimates:
        """The estimates over a run or over arrays.

        readings: a recording, or channel → (times [s], raw values), as the configuration calls the
            channels; raw values are what its calibrations turn into physics.
        load: nominal load of the run [N]; default: the recording's, else the configured one.
        after: an earlier run on the same bed, with whose posterior this one begins.

        Raises ValueError for arrays that do not fit, RecordingError for a recording.

        >>> estimates = Filter(configuration).run(read(recorded))
        >>> abs(estimates.tan_phi.value - 0.577) < 2 * estimates.tan_phi.sigma
        True
        """
        start = RunStart(after.replayed.bank) if after is not None else None

        if isinstance(readings, Run):
            info = readings.info
            settings = without_absent(self._settings(info, load), readings.recording)
            made = replayed(settings, readings.recording, start=start)
        else:
            settings = self._settings(self.configuration.run, load)
            raw = {channel: _rows(channel, series) for channel, series in readings.items()}
            if missing := [channel for channel in ENCODERS if channel not in raw]:
                raise ValueError(f"{missing[0]}: found no readings; expected both encoders")
            made = followed(settings, streams_of(raw, settings.rates.tick), start=start)

        return Estimates(made.rows, made)

    def _settings(self, info: RunInfo, load: float | None) -> Settings:
        stated = info if load is None else replace(info, nominal_load=load)
        return settings_of_run(self.configuration.settings, stated)

    def __repr__(self) -> str:
        return f"Filter({self.configuration.settings.testbed!r})"


def _rows(channel: str, series: Series) -> Table:
    """Readings as a recording has them. Raises ValueError."""
    if channel not in CHANNELS:
        raise ValueError(f"{channel}: no channel; expected one of {', '.join(CHANNELS)}")

    time = np.asarray(series[0], dtype=np.float64)
    names, values = CHANNELS[channel], np.asarray(series[1])
    values = values[:, None] if values.ndim == 1 else values
    if time.ndim != 1 or values.shape != (time.size, len(names)):
        raise ValueError(
            f"{channel}: found times {np.shape(series[0])} and values {np.shape(series[1])}; "
            f"expected (n,) and (n{', ' + str(len(names)) if len(names) > 1 else ','})"
        )

    if not (np.isfinite(time).all() and np.isfinite(values.astype(np.float64)).all()):
        raise ValueError(
            f"{channel}: found a number that is not finite; expected a gap to have no reading"
        )

    kind: Any = np.int64 if channel in ENCODERS else np.float64
    rows = np.empty(time.size, [("log_time", "i8"), ("stamp", "i8"), *((n, kind) for n in names)])
    rows["log_time"] = rows["stamp"] = np.round(time * NS).astype(np.int64)
    for place, name in enumerate(names):
        rows[name] = values[:, place]
    return rows
