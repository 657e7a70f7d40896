"""What `gritd diagnose` prints: numbers as a person reads them, a misfit in words."""

from __future__ import annotations

import re

import pytest

from gritd.tools.commands.diagnose_text import text
from gritd.tools.diagnose.explain.result import Diagnosis
from tests.tools.report import cases


@pytest.mark.parametrize("diagnosis", [cases.consistent(), cases.explained(), cases.several()])
def test_numbers_have_the_digits_of_their_sigma_and_a_unit_or_none(diagnosis: Diagnosis) -> None:
    printed = text(diagnosis)
    assert not re.search(r"\de[+-]\d", printed), "no exponents"
    assert not re.search(r" - (before|after)", printed), "no dash for a unit"
    for value, sigma in re.findall(r"(\d[\d.]*) ± (\d[\d.]*)", printed):
        places = [len(each.partition(".")[2]) for each in (value, sigma)]
        assert places[0] == places[1], f"{value} ± {sigma}"


def test_the_soil_is_told_with_its_unit_both_times() -> None:
    diagnosis = cases.explained()
    soil = diagnosis.soil
    assert soil is not None
    (line,) = (each for each in text(diagnosis).splitlines() if each.startswith("  c: "))
    assert line.count(" Pa ") == 2
    assert line.startswith(f"  c: {soil.before['c'].value:.0f} ± ")
