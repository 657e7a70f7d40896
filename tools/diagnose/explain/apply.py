"""The configuration that models what was found: effects with value and sigma, for simulator,
daemon, next campaign.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.yamltree import dumped
from gritd.estimator.effects import EFFECTS
from gritd.estimator.visible import visible
from gritd.tools.diagnose.explain.result import Diagnosis, Quantity


def applied(configuration: Configuration, diagnosis: Diagnosis) -> str:
    """YAML text; without an accepted effect or law it is the configuration as it was."""
    document: dict[str, Any] = yaml.safe_load(configuration.text)
    effects = dict(document.get("effects") or {})
    for hypothesis in diagnosis.accepted:
        effects[hypothesis.effect] = _entry(hypothesis.effect, hypothesis.parameters)
    if diagnosis.law is not None and diagnosis.law.parameters:
        effects["empirical_law"] = _entry("empirical_law", diagnosis.law.parameters)
    document["effects"] = effects
    return f"# made by gritd diagnose: {visible(diagnosis.summary)}\n{dumped(document)}"


def _entry(effect: str, parameters: Mapping[str, Quantity]) -> dict[str, Any]:
    units = {p.name: p.unit for p in EFFECTS[effect].parameters()}
    return {n: _quantity(q, units[n]) for n, q in parameters.items() if n in units}


def _quantity(quantity: Quantity, unit: str) -> dict[str, Any]:
    """{value, sigma} with the unit written behind the number, as the configuration has it."""

    def written(value: float) -> Any:
        return f"{value:.9g} {unit}" if unit else float(f"{value:.9g}")

    return {"value": written(quantity.value), "sigma": written(max(quantity.sigma, 0.0))}
