"""What a calibration found, as a page of text and as keys of the configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from gritd.estimator.config import units
from gritd.estimator.config.settings import Uncertain
from gritd.tools.calibrate.line import CalibrationLine
from gritd.tools.cli.yaml_edit import EditedYaml, plain_text, quantity

BAR = 41  # characters of the picture of a residual


@dataclass(frozen=True)
class CalibratedKey:
    """One key: its path in the configuration, value ± σ in SI, the SI unit, and the unit that is
    shown.
    """

    path: tuple[str, ...]
    value: Uncertain
    unit: str
    shown: str = ""


@dataclass(frozen=True)
class CalibrationOutcome:
    """Everything one calibration found.

    sensor: path of the mapping that gets date and serial number; none where no sensor was.
    lines:  what is reported of the data, before the values.
    """

    values: tuple[CalibratedKey, ...]
    sensor: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    fits: tuple[tuple[str, CalibrationLine], ...] = field(default=())

    def text(self, before: EditedYaml) -> str:
        """For a person: data, values next to those of the configuration, warnings."""
        rows = [
            f"{'.'.join(each.path)}: {_shown(each, before)}"
            + (f" (was {was})" if (was := _was(before, each.path)) else "")
            for each in self.values
        ]
        return "\n".join([*self.lines, *rows, *(f"warning: {each}" for each in self.warnings)])

    def serial(self, before: EditedYaml) -> str:
        """Key and serial number that the configuration has of the sensor; '' where it has none."""
        path = (*self.sensor, "serial")
        number = before.written(*path) if self.sensor else ""
        return f"{'.'.join(path)}: {number}" if number else ""


def written(outcome: CalibrationOutcome, document: EditedYaml, date: str, serial: str) -> str:
    """The text of the configuration with what was found."""
    for each in outcome.values:
        like = document.written(*each.path) or f"1 {each.shown}"
        document.set(each.path, quantity(each.value.value, each.value.sigma, each.unit, like))
    if outcome.sensor:
        document.set((*outcome.sensor, "date"), date)
        if serial:
            document.set((*outcome.sensor, "serial"), plain_text(serial))
    return document.text()


def _shown(each: CalibratedKey, before: EditedYaml) -> str:
    like = before.written(*each.path) or f"1 {each.shown}"
    text = quantity(each.value.value, each.value.sigma, each.unit, like)
    return text.removeprefix("{value: ").replace(", sigma: ", " ± ").removesuffix("}")


def _was(before: EditedYaml, path: Sequence[str]) -> str:
    return before.written(*path)


def residual_table(line: CalibrationLine, raw: str, unit: str) -> list[str]:
    """The points of a line, one a row, with the residual as a bar about zero."""
    factor = float(units.unit(unit).factor)
    largest = max(abs(line.residuals).max(), line.expected.max()) or 1.0
    rows = [f"{'read [' + raw + ']':>14} {'known [' + unit + ']':>14} {'residual':>12}"]

    for point, residual in zip(line.points, line.residuals.tolist(), strict=True):
        at = round((BAR - 1) / 2 * (1.0 + residual / largest))
        bar = "".join("●" if i == at else "│" if i == BAR // 2 else " " for i in range(BAR))
        rows.append(
            f"{point.raw.value:>14.7g} {point.known.value / factor:>14.6g} "
            f"{residual / factor:>12.3g}  {bar.rstrip()}"
        )

    rms = f"{line.rms / factor:.3g}" if line.rms else "–"
    usual = float((line.expected**2).mean() ** 0.5) / factor
    rows.append(f"residual {rms} {unit} r.m.s., {usual:.2g} {unit} expected")
    return rows
