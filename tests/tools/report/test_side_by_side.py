"""Reference and new campaign on one page: each side has its own values."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np

from gritd.tools.diagnose.explain.result import Diagnosis, Reference
from gritd.tools.report.side_by_side import campaigns
from tests.tools.report import cases

FILES = ("old-1.mcap", "old-2.mcap", "old-3.mcap")


def left_by(side: float, diagnosis: Diagnosis) -> Diagnosis:
    """The reference's runs are left with 0.5 N·m, the new campaign's with `side`."""
    drawn = [
        replace(t, before=(np.array(t.measured) - 0.5).tolist())
        if int(t.run.split()[0]) < 80
        else replace(t, before=(np.array(t.measured) - side).tolist())
        for t in diagnosis.traces
        if t.channel == "torque"
    ]
    reference = Reference("explained", 1.0, "", {}, FILES)
    return replace(diagnosis, traces=tuple(drawn), reference=reference)


def cells(page: str, row: int) -> list[str]:
    table = next(ElementTree.fromstring(page).iter("table"))
    return ["".join(cell.itertext()) for cell in list(table.iter("tr"))[row]]


def test_each_side_has_its_own_root_mean_square() -> None:
    section = campaigns(left_by(0.02, cases.explained()))
    assert section is not None
    torque = cells(str(section), 1)
    assert torque[0] == "torque" and torque[1].startswith("0.5") and torque[2].startswith("0.02")


def test_dots_of_both_sides_are_drawn_apart() -> None:
    section = campaigns(left_by(0.02, cases.explained()))
    pictures = [e for e in ElementTree.fromstring(str(section)).iter("svg") if e.get("role")]
    sides = ["".join(next(e.iter("title")).itertext()).split(", ")[-1] for e in pictures]
    assert sides == ["reference", "new campaign"]


def test_without_a_reference_there_is_no_such_part() -> None:
    assert campaigns(cases.explained()) is None
