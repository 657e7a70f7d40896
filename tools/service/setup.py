"""What does not change from tick to tick of a run, as the status socket tells it."""

from __future__ import annotations

from typing import Any

from gritd.estimator.config.settings import Settings, Uncertain

Report = dict[str, Any]


def setup(settings: Settings, run: str) -> Report:
    """What does not change from tick to tick: run, testbed, wheel and the soil as it is stated."""
    soil, wheel = settings.soil, settings.wheel
    return {
        "run": run,
        "testbed": settings.testbed,
        "wheel": {"radius": wheel.radius, "width": wheel.width, "c1": wheel.c1, "c2": wheel.c2},
        "prior": {
            "cohesion": _pair(soil.cohesion),
            "tan_phi": _pair(soil.tan_phi),
            "shear_modulus": _pair(soil.shear_modulus),
        },
    }


def _pair(known: Uncertain) -> Report:
    return {"value": known.value, "sigma": known.sigma}
