"""The configuration that models what was found: effects and soil with value and sigma, for
simulator, daemon, next campaign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import atan, cos, hypot, inf

from gritd.estimator.config.configuration import Configuration, loads
from gritd.estimator.config.settings import Settings, SoilPrior
from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Parameter
from gritd.estimator.model.learnt import CHANNELS, Domain, LearntForm, LearntSoil
from gritd.estimator.visible import visible
from gritd.tools.cli.yaml_edit import EditedYaml, quantity
from gritd.tools.diagnose.explain.result import Diagnosis, Quantity

HEADER = "# made by gritd diagnose: "
SOIL_KEYS = {"c": "cohesion", "tan_phi": "tan_phi", "k": "shear_modulus", "n": "exponent"}
SOIL_UNITS = {"c": "Pa", "tan_phi": "", "k": "m", "n": ""}
MODULI = {
    "bekker": (("k_c", "Pa/m^(n-1)"), ("k_phi", "Pa/m^n")),
    "reece": (("k1", "Pa"), ("k2", "Pa/m")),
}
CHANNEL_UNITS = ("N*m", "N", "m")  # of CHANNELS
KNOWN = ("consistent", "explained")  # verdicts under which the fitted soil is believed alone


def applied(configuration: Configuration, diagnosis: Diagnosis) -> str:
    """The effective YAML text with the effects found; without one, as it was."""
    document = EditedYaml(configuration.text, configuration.source)
    _set_effects(document, diagnosis)
    return document.text()


def rewritten(text: str, configuration: Configuration, diagnosis: Diagnosis) -> str:
    """The text of a configuration file with the effects found, the fitted soil and what was learnt
    of the discrepancy of form, where the verdict lets them be believed. Its comments stay.
    """
    document = EditedYaml(_without_header(text), configuration.source)
    _set_effects(document, diagnosis)
    if diagnosis.soil is not None and is_known(diagnosis):
        _set_soil(document, configuration.settings, _soil_of(diagnosis))
        if diagnosis.learnt is not None and diagnosis.law is None:
            set_discrepancy(document, diagnosis.learnt, configuration.source)
    return f"{HEADER}{visible(diagnosis.summary)}\n{document.text()}"


def is_known(diagnosis: Diagnosis) -> bool:
    """Whether the fitted soil is written. Where something without a name remains it needs beside it
    what carries that, δ or a law: see docs/decisions/0009. A misfit has one carrier.
    """
    beside = diagnosis.verdict == "unlisted" and diagnosis.learnt is not None
    return diagnosis.verdict in KNOWN or beside


def _without_header(text: str) -> str:
    first, _, rest = text.partition("\n")
    return rest if first.startswith(HEADER) else text


def _set_effects(document: EditedYaml, diagnosis: Diagnosis) -> None:
    parameters_of = _had(diagnosis)
    for h in diagnosis.accepted:
        parameters_of[h.effect] = _more(h.effect, parameters_of.get(h.effect, {}), h.parameters)
    if diagnosis.law is not None:
        parameters_of["empirical_law"] = diagnosis.law.parameters

    for effect, parameters in parameters_of.items():
        document.remove("effects", effect)
        known = {p.name: p for p in EFFECTS[effect].parameters()}
        for name, found in parameters.items():
            if name in known:
                document.set(("effects", effect, name), _stated(known[name], found))


def _had(diagnosis: Diagnosis) -> dict[str, Mapping[str, Quantity]]:
    """What the reference shows by itself: soil and δ were found beside it."""
    if diagnosis.reference is None or not is_known(diagnosis):
        return {}
    return dict(diagnosis.reference.effects)


def _more(
    effect: str, had: Mapping[str, Quantity], new: Mapping[str, Quantity]
) -> Mapping[str, Quantity]:
    """The parameters of an effect of which there is more than the rig had before: strengths add up,
    its shape is that of what is new.
    """
    strengths = {p.name: p for p in EFFECTS[effect].parameters() if p.role == "strength"}
    return {
        name: _sum(had[name], q, strengths[name]) if name in had and name in strengths else q
        for name, q in new.items()
    }


def _sum(had: Quantity, new: Quantity, strength: Parameter) -> Quantity:
    value = min(max(had.value + new.value - strength.off, strength.low), strength.high)
    return replace(new, value=value, sigma=hypot(had.sigma, new.sigma))


def _stated(parameter: Parameter, found: Quantity) -> str:
    """YAML text of a parameter; no σ is wider than a configuration may state."""
    low, high = parameter.low, parameter.high
    return quantity(found.value, min(found.sigma, high), parameter.unit, bounds=(low, high))


def _soil_of(diagnosis: Diagnosis) -> Mapping[str, Quantity]:
    """The soil that belongs to what is written beside it."""
    assert diagnosis.soil is not None
    return diagnosis.law.soil if diagnosis.law is not None else diagnosis.soil.after


def _set_soil(document: EditedYaml, settings: Settings, soil: Mapping[str, Quantity]) -> None:
    """The fitted soil as what is known before the next run, inside the filter's bounds."""
    for name, key in SOIL_KEYS.items():
        fitted, before = soil[name], document.written("soil", key)
        low, high = getattr(settings.filter, f"{key}_bounds", (0.0, inf))
        value = min(max(fitted.value, low), high)
        if name == "tan_phi" and document.has("soil", "phi"):
            _set_phi(document, value, fitted.sigma)
        else:
            document.set(("soil", key), quantity(value, fitted.sigma, SOIL_UNITS[name], before))

    _set_moduli(document, settings, soil["n"].value, soil["K"])


def _set_phi(document: EditedYaml, tangent: float, sigma: float) -> None:
    """The friction angle where the file states it as an angle: dφ = cos² φ d tan φ."""
    phi, before = atan(tangent), document.written("soil", "phi")
    document.set(("soil", "phi"), quantity(phi, sigma * cos(phi) ** 2, "rad", before))


def _set_moduli(
    document: EditedYaml, settings: Settings, exponent: float, modulus: Quantity
) -> None:
    """Both moduli by one factor: one width cannot tell k_c from k_φ. The factor makes them K at
    the new exponent, which Reece's form contains.
    """
    law = replace(settings.soil.pressure_sinkage, exponent=exponent)
    factor = modulus.value / law.modulus(settings.wheel.width)

    for (key, unit), value in zip(MODULI[law.form], (law.first, law.second), strict=True):
        before = document.written("soil", key)
        document.set(("soil", key), quantity(factor * value, 0.0, unit, before))

    relative = min(modulus.sigma / modulus.value, 1.0)
    before = document.written("soil", "modulus_sigma")
    document.set(("soil", "modulus_sigma"), quantity(relative, 0.0, "", before or "1 %"))


# ---- the learnt discrepancy of form --------------------------------------------------------------


def set_discrepancy(document: EditedYaml, form: LearntForm, source: str) -> None:
    """Put it in the place of an earlier one, with the values of the soil as the document has it."""
    document.remove("discrepancy")
    soil = loads(document.text(), source).settings.soil

    values = {"load": _plain(form.load, "N"), "speed": _plain(form.speed, "m/s")}
    values |= {"domain": _domain(form.domain), "points": _rows(form.points)}
    for name, channel, unit in zip(CHANNELS, form.channels, CHANNEL_UNITS, strict=True):
        if channel is not None:
            values[name] = _mapping(
                size=_plain(channel.size, unit),
                mean=_list(channel.mean),
                spread=_rows(channel.spread),
                rest=_plain(channel.rest),
            )
    if form.soil is not None:
        values["soil"] = _learnt_soil(form.soil, soil)

    for name, fragment in values.items():
        document.set(("discrepancy", name), fragment)


def _learnt_soil(learnt: LearntSoil, soil: SoilPrior) -> str:
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
