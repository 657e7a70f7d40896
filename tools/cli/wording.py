"""Numbers and names as a person reads them: SI inside, millimetres and degrees on the page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gritd.estimator.filter.tuning import TRUST

NOTHING = "–"
PROPER = {"coulomb": "Coulomb", "stribeck": "Stribeck"}
SHOWN = {  # unit inside -> unit shown, factor
    "m": ("mm", 1e3),
    "rad": ("°", math.degrees(1.0)),
    "Pa/m^n": ("kPa/mⁿ", 1e-3),
    "-": ("", 1.0),
    "1/A^2": ("1/A²", 1.0),
    "N/m^3": ("kN/m³", 1e-3),
    "kg·m^2": ("kg·m²", 1.0),
    "m/N": ("mm/kN", 1e6),
}
COVARIATES = {  # inside -> unit shown, factor; the others by their unit
    "slip": ("%", 100.0),
    "speed": ("mm/s", 1e3),
    "position": ("m", 1.0),
}
TOO_SMALL, TOO_LARGE = 0.5, 2.0  # mean normalised innovation squared, of about 40: 1 is honest
SCIENTIFIC = (1e-4, 1e6)


def spelled(key: str) -> str:
    """A channel, effect or covariate in words."""
    return " ".join(PROPER.get(word, word) for word in key.split("_"))


def shown(unit: str) -> tuple[str, float]:
    """The unit to show for one inside, and the factor to it."""
    return SHOWN.get(unit, (unit, 1.0))


def covariate_shown(covariate: str, unit: str) -> tuple[str, float]:
    """A drive's speed and position are angles, and are shown as such."""
    return shown(unit) if unit.startswith("rad") else COVARIATES.get(covariate) or shown(unit)


def number(value: float | None, digits: int = 3) -> str:
    """A few significant digits, never an exponent where a plain number can be read."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if not SCIENTIFIC[0] <= abs(value) < SCIENTIFIC[1]:
        return _scientific(value, digits)
    return fixed(value, max(digits - 1 - magnitude(value), 0))


def fixed(value: float, places: int) -> str:
    """With a true minus sign; 0 has none."""
    return f"{round(value, places) + 0.0:.{places}f}".replace("-", "−")


def magnitude(value: float) -> int:
    """The power of ten of the first digit."""
    return math.floor(math.log10(abs(value)))


def _scientific(value: float, digits: int) -> str:
    mantissa, exponent = f"{value:.{max(digits - 1, 0)}e}".split("e")
    raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa.replace('-', '−')}·10{raised}"


def percent(share: float | None) -> str:
    """A share; what is nearly none or nearly all is said so."""
    if share is None or not math.isfinite(share):
        return NOTHING
    if 0.0 < share < 0.01:
        return "< 1 %"
    if 0.99 < share < 1.0:
        return "> 99 %"
    return f"{fixed(100.0 * share, 0)} %"


def chance(p: float) -> str:
    """A p-value: small ones as a bound."""
    return "p < 0.001" if p < 0.001 else f"p = {p:.2g}"


def sigmas(u: float) -> str:
    """How far something stands from what is known of it, with its sign."""
    return f"{'+' if u >= 0.0 else ''}{fixed(u, 1)} σ"


def spaced(value: float | None, unit: str, digits: int = 3) -> str:
    """A number and its unit, both as shown."""
    text = number(value, digits)
    return text if text == NOTHING else f"{text} {unit}".rstrip()


def listed(names: Sequence[str]) -> str:
    """a; a and b; a, b and c."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def honesty(consistency: float | None) -> str:
    """What the mean normalised innovation squared means for σ. It is 1 where σ is honest."""
    if consistency is None or not math.isfinite(consistency):
        return "no innovations yet"
    if consistency > TRUST.mismatch:
        return "model disagrees"
    if consistency > TOO_LARGE:
        return "σ too small"
    return "σ consistent" if consistency > TOO_SMALL else "σ conservative"
