"""Scales, ticks, thinning and the words for numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gritd.tools.report as report_package
from gritd.tools.cli.wording import listed, number, percent
from gritd.tools.diagnose.explain.result import Quantity
from gritd.tools.report import figures, plot
from gritd.tools.report.words import held, quantity

SIZES = st.floats(-1e6, 1e6, allow_nan=False)


@given(SIZES, st.floats(1e-6, 1e6))
def test_ticks_are_round_and_inside(low: float, width: float) -> None:
    high = low + width
    if not high > low * (1 + 1e-9):
        return
    found = plot.ticks(low, high)

    assert 1 <= len(found) <= 5 or width < 1e-9 * abs(low)

    slack = 1e-6 * width
    assert all(low - slack <= t <= high + slack for t in found)

    steps = np.diff(found)
    if steps.size and width > 1e-6 * abs(low):
        assert np.allclose(steps, steps[0], rtol=1e-3)
        assert round(steps[0] / 10 ** np.floor(np.log10(steps[0] * 1.001))) in (1, 2, 5)
        assert len(set(plot.tick_labels(found))) == len(found)


@given(st.lists(st.one_of(st.just(float("nan")), SIZES), max_size=20))
def test_limits_hold_every_value_and_are_never_empty(values: list[float]) -> None:
    low, high = plot.limits(values)
    assert low < high and all(low <= v <= high for v in values if np.isfinite(v))


def test_thinning_keeps_extremes_and_order() -> None:
    time, values = np.arange(20_000.0), np.sin(np.arange(20_000.0) / 900.0)
    values[12_345], values[777] = 9.0, np.nan
    x, y = plot.thinned(time, values)
    assert len(x) <= plot.MOST * 1.1 and (np.diff(x) > 0).all()
    assert 9.0 in y and np.nanmin(y) == pytest.approx(np.nanmin(values))
    assert x[0] == 0.0 and x[-1] == 19_999.0


def test_line_is_broken_at_what_is_missing() -> None:
    at = plot.axes((0.0, 4.0), (0.0, 1.0), 0.0, 100.0)
    path = re.search(
        r'd="([^"]*)"', plot.line(at, range(5), [0.0, 1.0, float("nan"), 1.0, 0.0], "line")
    )
    assert path is not None and path[1].count("M") == 2 and path[1].count("L") == 2


def test_running_mean_finds_the_trend_and_leaves_out_lone_values() -> None:
    x = np.append(np.repeat([0.1, 0.2, 0.3], 50), 0.9)
    y = np.append(np.repeat([1.0, 2.0, 3.0], 50), 77.0)
    mean_x, mean_y = figures.running_mean(x, y)
    assert mean_x == pytest.approx([0.1, 0.2, 0.3]) and mean_y == pytest.approx([1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (Quantity(1020.4, 61.0, "Pa"), "1020 ± 61 Pa"),
        (Quantity(0.0246, 0.0004, "m"), "24.60 ± 0.40 mm"),
        (Quantity(0.61, 0.02, "m"), "0.610 ± 0.020 m"),
        (Quantity(1.55e6, 2.1e4, "Pa/m^n"), "1550 ± 21 kPa/mⁿ"),
        (Quantity(-0.02, 0.003, "rad"), "−1.15 ± 0.17°"),
        (Quantity(0.577, 0.0, "-"), "0.5770"),
        (Quantity(3e-6, 1e-7, "m/N"), "3.00 ± 0.10 mm/kN"),
        (Quantity(2.5e-9, 1e-10, "1/A^2"), "2.50·10⁻⁹ ± 1.0·10⁻¹⁰ 1/A²"),
        (Quantity(float("nan"), 1.0, "Pa"), "–"),
        (None, "–"),
    ],
)
def test_quantities_carry_the_digits_their_uncertainty_deserves(
    given: Quantity | None, said: str
) -> None:
    assert quantity(given) == said


def test_small_words() -> None:
    assert (percent(0.004), percent(0.997), percent(0.5), percent(1.0)) == (
        "< 1 %",
        "> 99 %",
        "50 %",
        "100 %",
    )
    assert (number(0.0), number(-2.5), number(float("inf")), number(123456.0)) == (
        "0",
        "−2.50",
        "–",
        "123456",
    )
    assert (listed([]), listed(["a"]), listed(["a", "b", "c"])) == ("", "a", "a, b and c")


# --- colours ---


def palettes() -> list[dict[str, str]]:
    """The light, dark and printed sets of colours of the style sheet."""
    style = (Path(report_package.__file__).parent / "style.css").read_text(encoding="utf-8")
    full = {"#fff": "#ffffff", "#000": "#000000", "#444": "#444444", "#ccc": "#cccccc"}
    blocks = re.findall(r":root \{([^}]*)\}", style)
    return [
        {k: full.get(v, v) for k, v in re.findall(r"--([a-z]+): (#[0-9a-f]+);", block)}
        for block in blocks
    ]


def luminance(colour: str) -> float:
    """WCAG 2.1, relative luminance."""
    channels = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(one: str, other: str) -> float:
    bright, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def test_text_and_curves_stand_out_from_the_paper() -> None:
    found = palettes()
    assert len(found) == 3

    for colours in found:
        for name in (
            "ink",
            "soft",
            "before",
            "after",
            "consistent",
            "explained",
            "unlisted",
            "insufficient",
        ):
            assert contrast(colours[name], colours["paper"]) >= 4.5, name
        assert contrast(colours["soft"], colours["wash"]) >= 4.5
        for name in ("before", "after"):
            assert contrast(colours[name], colours["band"]) >= 3.0, name


def test_numbers_keep_their_units_at_the_end_of_a_line() -> None:
    space = "\N{NO-BREAK SPACE}"
    assert (
        held("86 % of 3 N, c 1020 ± 60 Pa at high slip").replace(space, "_")
        == "86_% of 3_N, c 1020_±_60_Pa at high slip"
    )
