"""Numbers and names as a person reads them: SI inside, millimetres and degrees on the page."""

from __future__ import annotations

import math
import re

from gritd.tools.diagnose.explain.result import SOIL, Quantity

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
LARGE = 0.3  # [m] lengths from here on are read in metres
SCIENTIFIC = (1e-4, 1e6)
HELD = re.compile(r"(?<=[0-9±<>]) (?=[0-9±%σ°]|(?:N|m|mm|s|Pa|kPa|nats)\b)|(?<=[0-9]) (?=±)")


def name_of(key: str) -> str:
    """A channel, effect, soil parameter or covariate in words."""
    return SOIL.get(key) or " ".join(PROPER.get(word, word) for word in key.split("_"))


def held(words: str) -> str:
    """Numbers and their units are not parted at the end of a line."""
    return HELD.sub("\N{NO-BREAK SPACE}", words)


def sentence(words: str) -> str:
    """With a capital and a full stop."""
    words = held(words.strip())
    return (
        words[:1].upper()
        + words[1:]
        + ("" if words.endswith((".", "!", "?")) or not words else ".")
    )


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
    return fixed(value, max(digits - 1 - _magnitude(value), 0))


def fixed(value: float, places: int) -> str:
    """With a true minus sign."""
    return f"{value:.{places}f}".replace("-", "−")


def _magnitude(value: float) -> int:
    return math.floor(math.log10(abs(value)))


def _scientific(value: float, digits: int) -> str:
    mantissa, exponent = f"{value:.{max(digits - 1, 0)}e}".split("e")
    raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa.replace('-', '−')}·10{raised}"


def quantity(q: Quantity | None) -> str:
    """value ± sigma unit, as many digits as the uncertainty deserves (two of its own)."""
    if q is None or not math.isfinite(q.value):
        return NOTHING
    unit, factor = _unit_for(q)
    value, sigma = q.value * factor, q.sigma * factor
    return (
        f"{uncertain(value, sigma)} {unit}".rstrip()
        if unit != "°"
        else f"{uncertain(value, sigma)}°"
    )


def _unit_for(q: Quantity) -> tuple[str, float]:
    small = q.unit != "m" or abs(q.value) < LARGE
    return shown(q.unit) if small else ("m", 1.0)


def uncertain(value: float, sigma: float) -> str:
    """value ± sigma, unit already shown."""
    if not (math.isfinite(sigma) and sigma > 0.0):
        return number(value, 4)
    if not (SCIENTIFIC[0] / 10 <= sigma and max(abs(value), sigma) < SCIENTIFIC[1]):
        return f"{number(value)} ± {number(sigma, 2)}"
    places = min(max(1 - _magnitude(sigma), 0), 6)
    return f"{fixed(value, places)} ± {fixed(sigma, places)}"


def percent(share: float | None) -> str:
    """A share; what is nearly none or nearly all is said so."""
    if share is None or not math.isfinite(share):
        return NOTHING
    if 0.0 < share < 0.01:
        return "< 1 %"
    if 0.99 < share < 1.0:
        return "> 99 %"
    return f"{fixed(100.0 * share, 0)} %"


def probability(p: float | None) -> str:
    """A p-value: small ones as a bound."""
    if p is None or not math.isfinite(p):
        return NOTHING
    return "< 0.001" if p < 0.001 else number(p, 2)


def spaced(value: float | None, unit: str, digits: int = 3) -> str:
    """A number and its unit, both as shown."""
    said = number(value, digits)
    return said if said == NOTHING else f"{said} {unit}".rstrip()


def with_unit(value: float | None, unit: str, digits: int = 3) -> str:
    """A value inside, in the unit it is shown in."""
    seen, factor = shown(unit)
    return spaced(None if value is None else value * factor, seen, digits)


def nats(value: float | None) -> str:
    """Evidence: whole nats, tenths where they matter."""
    return (
        NOTHING
        if value is None or not math.isfinite(value)
        else f"{fixed(value, int(abs(value) < 10.0))} nats"
    )


def counted(count: int, what: str) -> str:
    """1 run, 2 runs."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def listed(names: list[str]) -> str:
    """a; a and b; a, b and c."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
