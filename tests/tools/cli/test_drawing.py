"""Figures of one look: apart in grey, names that do not cover each other, the same bytes again."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from gritd.tools.cli import drawing

ROOT = Path(__file__).parents[3]
PAGES = ("tools/report/style.css", "tools/view/page/style.css")


def lightness(colour: str) -> float:
    """L* of CIELAB."""
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    red, green, blue = linear
    return 116.0 * (0.2126 * red + 0.7152 * green + 0.0722 * blue) ** (1 / 3) - 16.0


def schemes(page: str) -> list[dict[str, str]]:
    """The colours of a page by name: light, dark, and where there is one, printed."""
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = re.findall(r":root[^{]*\{([^}]*--paper[^}]*)\}", text)
    return [dict(re.findall(r"--([\w-]+): (#\w{3,6})\b", block)) for block in blocks]


@pytest.mark.parametrize("page", PAGES)
def test_curves_differ_in_grey_in_every_scheme(page: str) -> None:
    before, after = ("before", "after") if "report" in page else ("predicted", "estimate")
    found = schemes(page)
    assert len(found) >= 2
    for colours in found:
        three = sorted(lightness(colours[name]) for name in ("measured", before, after))
        assert min(b - a for a, b in pairwise(three)) > 12.0
    light = found[0]
    assert [light[n] for n in ("measured", before, after)] == [
        drawing.MEASURED, drawing.BEFORE, drawing.AFTER,
    ]  # fmt: skip


@given(st.lists(st.floats(-0.5, 1.5), max_size=8).map(sorted), st.floats(0.02, 0.12))
def test_names_are_apart_and_in_order(heights: list[float], apart: float) -> None:
    moved = drawing.spread(heights, apart)
    assert all(b - a > apart - 1e-9 for a, b in pairwise(moved))
    assert all(-1e-9 <= height <= 1.0 for height in moved)


@pytest.mark.parametrize("name, begins", [("a.png", b"\x89PNG"), ("a.SVG", b"<?xml")])
def test_the_same_picture_is_the_same_file(name: str, begins: bytes, tmp_path: Path) -> None:
    made = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / name
        with drawing.look():
            figure = Figure(figsize=(drawing.COLUMN, 2.0), layout="constrained")
            figure.subplots().plot([0.0, 1.0], [0.0, 1.0])
            drawing.save(figure, path)
        made.append(path.read_bytes())
    assert made[0] == made[1] and made[0].startswith(begins)
