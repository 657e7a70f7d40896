"""The learnt discrepancy of form as YAML, beside the soil that is written with it."""

from __future__ import annotations

from collections.abc import Sequence

from gritd.estimator.config.configuration import loads
from gritd.estimator.config.settings import SoilPrior
from gritd.estimator.model.learnt import CHANNELS, Domain, LearntForm, LearntSoil
from gritd.tools.cli.yaml_edit import EditedYaml, quantity

UNITS = ("N*m", "N", "m")  # of CHANNELS


def set_discrepancy(document: EditedYaml, form: LearntForm, source: str) -> None:
    """Put it in the place of an earlier one, with the values of the soil as the document has it."""
    document.remove("discrepancy")
    soil = loads(document.text(), source).settings.soil

    values = {"load": _plain(form.load, "N"), "speed": _plain(form.speed, "m/s")}
    values |= {"domain": _domain(form.domain), "points": _rows(form.points)}
    for name, channel, unit in zip(CHANNELS, form.channels, UNITS, strict=True):
        if channel is not None:
            values[name] = _mapping(
                size=_plain(channel.size, unit),
                mean=_list(channel.mean),
                spread=_rows(channel.spread),
                rest=_plain(channel.rest),
            )
    if form.soil is not None:
        values["soil"] = _soil(form.soil, soil)

    for name, fragment in values.items():
        document.set(("discrepancy", name), fragment)


def _soil(learnt: LearntSoil, soil: SoilPrior) -> str:
    return _mapping(
        cohesion=_plain(soil.cohesion.value, "Pa"),
        tan_phi=_plain(soil.tan_phi.value),
        shear_modulus=_plain(soil.shear_modulus.value, "m"),
        with_cohesion=_list(learnt.with_cohesion),
        with_tan_phi=_list(learnt.with_tan_phi),
        with_shear_modulus=_list(learnt.with_shear_modulus),
        among=_list(learnt.among),
    )


def _domain(domain: Domain) -> str:
    return _mapping(
        slip=_list(domain.slip),
        load=_list(domain.load, "N"),
        speed=_list(domain.speed, "m/s"),
        travel=domain.travel,
    )


def _mapping(**items: str) -> str:
    return "{" + ", ".join(f"{key}: {item}" for key, item in items.items()) + "}"


def _rows(rows: Sequence[Sequence[float]]) -> str:
    return "[" + ", ".join(_list(row) for row in rows) + "]"


def _list(values: Sequence[float], unit: str = "") -> str:
    return "[" + ", ".join(_plain(value, unit) for value in values) + "]"


def _plain(value: float, unit: str = "") -> str:
    return quantity(value, 0.0, unit)
