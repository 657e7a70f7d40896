"""The procedure that most sensors share: known values are set, a line is fitted, and scale, offset,
date and serial number are written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gritd.estimator.config.settings import Uncertain
from gritd.tools.calibrate.line import CalibrationLine, fitted
from gritd.tools.calibrate.outcome import CalibratedKey, CalibrationOutcome, residual_table
from gritd.tools.calibrate.sources import CalibrationSource, Signal


@dataclass(frozen=True)
class Straight:
    """What is fitted, and where it is written.

    path:   of the mapping with scale and offset in the configuration.
    scale:  SI unit of the scale; shown: a usual unit of the known values.
    offset: whether it is written; counts have none.
    """

    signal: Signal
    path: tuple[str, ...]
    unit: str
    scale: str
    shown: str
    offset: bool = True

    def outcome(self, source: CalibrationSource, known: Sequence[Uncertain]) -> CalibrationOutcome:
        """Raises CommandError."""
        return self.of_line(fitted(source.points(self.signal, known)))

    def of_line(self, line: CalibrationLine, factor: float = 1.0) -> CalibrationOutcome:
        """What a line says. `factor` turns the known values into what the channel measures."""
        scale = Uncertain(line.scale.value * factor, line.scale.sigma * abs(factor))
        shown = f"{self.shown}/{self.signal.unit}" if self.scale else ""

        values = [CalibratedKey((*self.path, "scale"), scale, self.scale, shown)]
        if self.offset:
            values.append(CalibratedKey((*self.path, "offset"), line.offset, self.unit, self.shown))

        return CalibrationOutcome(
            tuple(values),
            self.path,
            tuple(residual_table(line, self.signal.unit, self.shown)),
            line.warnings,
            ((".".join(self.path), line),),
        )
