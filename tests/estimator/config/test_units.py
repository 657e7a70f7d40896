"""Quantities as text: the right SI value, rounded once, and nothing of another kind."""

from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.config import units


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("72 mm", "m", 0.072),
        ("72mm", "m", 0.072),
        ("7.2 cm", "m", 0.072),
        ("0.9 kN/m^(n+1)", "Pa/m^(n-1)", 900.0),
        ("1523.4 kN/m^(n+2)", "Pa/m^n", 1_523_400.0),
        ("1500 kN/m^3", "Pa/m", 1.5e6),
        ("0 kPa", "Pa", 0.0),
        ("0.0958738 mrad/count", "rad/count", 0.0958738e-3),
        ("250 Hz", "1/s", 250.0),
        ("-5 A", "A", -5.0),
        ("2 N*m/A", "N*m/A", 2.0),
        ("2 N·m/A", "N*m/A", 2.0),
        ("20 mN*m", "N*m", 0.02),
        ("2 Pa/sqrt(s)", "Pa/sqrt(s)", 2.0),
        ("1e3 Pa", "Pa", 1000.0),
        ("5 %", "", 0.05),
        ("0.577", "", 0.577),
        ("3 µs", "s", 3e-6),  # U+00B5
        ("3 μs", "s", 3e-6),  # U+03BC
        ("3 us", "s", 3e-6),
        ("180 deg", "rad", math.pi),
        ("0.5 turn", "rad", math.pi),
        ("60 turn/min", "rad/s", 2 * math.pi),
        ("0.0039 1/K", "1/K", 0.0039),
        ("25 degC", "degC", 25.0),
        ("5 kg", "kg", 5.0),
    ],
)
def test_value_in_si(text: str, unit: str, value: float) -> None:
    assert units.parse(text, unit) == value


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("72", "m"),  # no unit
        ("72 N", "m"),
        ("72 mm^2", "m"),
        ("72 furlong", "m"),
        ("1 mm/count", "rad/count"),  # an angle is no length
        ("25 degC", "K"),  # a point on a scale is no difference
        ("1 kN/m^(n+1)", "Pa/m^n"),
        ("1 kN/mm^(n+2)", "Pa/m^n"),  # the factor would depend on n
        ("1 Pa", ""),
        (".", ""),
        ("", ""),
        ("nan", ""),
        (".inf", ""),
        ("1_000", ""),
        ("1:30", ""),
        ("010", ""),
        ("1e9999", ""),
        ("1e400", ""),
        ("1,5 m", "m"),
        ("1 m m", "m"),
        ("1 m*", "m"),
        ("1  m", "m"),
        ("1 mdeg", "rad"),
        ("٣ m", "m"),
    ],
)
def test_refused(text: str, unit: str) -> None:
    with pytest.raises(units.UnitError):
        units.parse(text, unit)


@given(
    st.decimals(
        allow_nan=False, allow_infinity=False, min_value=-(10**9), max_value=10**9, places=6
    )
)
def test_prefix_costs_no_digit(number: object) -> None:
    """A prefix only moves the decimal point: the value is the float nearest to the written one."""
    assert units.parse(f"{number} mm", "m") == float(f"{number}e-3")
    assert units.parse(f"{number} kPa", "Pa") == float(f"{number}e3")


@given(st.text(max_size=100))
def test_any_text_is_a_number_or_a_unit_error(text: str) -> None:
    with contextlib.suppress(units.UnitError):
        assert math.isfinite(units.parse_any(text))


@given(st.sampled_from(sorted(units.SYMBOLS)), st.sampled_from(sorted(units.SYMBOLS)))
def test_quotient_undoes_product(left: str, right: str) -> None:
    assert units.unit(f"{left}*{right}/{right}") == units.unit(left)


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("72", "m", "its unit is missing"),
        ("72 N", "m", "N is not a unit of the same kind as m"),
        ("1 Pa", "", "this quantity has no unit, not Pa"),
    ],
)
def test_what_is_wrong_with_a_unit_is_said(text: str, unit: str, words: str) -> None:
    with pytest.raises(units.UnitError, match=f"^{words}$"):
        units.parse(text, unit)
