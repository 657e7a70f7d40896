"""Key `discrepancy`: what is written is read back, and every mistake is one line."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gritd.estimator.config import configuration as config
from gritd.tools.cli.yaml_edit import EditedYaml
from gritd.tools.diagnose.explain.apply import set_discrepancy
from tests import forms
from tests.estimator.config.rig import MINIMAL, message

SOIL = (800.0, 0.6, 0.025)  # of MINIMAL


def written(form):
    document = EditedYaml(MINIMAL, "rig.yaml")
    set_discrepancy(document, form, "rig.yaml")
    return document.text()


TEXT = written(forms.form(3, points=4, directions=2, soil=forms.soil(SOIL, directions=2)))


@given(
    seed=st.integers(0, 10_000),
    points=st.integers(1, 20),
    directions=st.integers(0, 8),
    pull=st.booleans(),
    known=st.booleans(),
)
@settings(max_examples=25)
def test_what_is_written_is_what_is_read(seed, points, directions, pull, known):
    """And again from the effective text."""
    soil = forms.soil(SOIL, directions) if known and directions else None
    form = forms.form(seed, points, directions, soil, pull)
    read = config.loads(written(form), "rig.yaml")
    assert read.settings.discrepancy == form
    assert config.loads(read.text, "effective").settings.discrepancy == form


def test_a_discrepancy_of_twenty_points_is_a_few_kilobytes():
    soil = forms.soil(SOIL, 8)
    more = len(written(forms.form(1, 20, 8, soil))) - len(MINIMAL)
    assert more < 8_000
    read = config.loads(written(forms.form(1, 20, 8, soil)), "rig.yaml").text
    assert len(read) < 16_000


def test_without_the_key_there_is_none():
    assert config.loads(MINIMAL, "rig.yaml").settings.discrepancy is None
    assert "discrepancy" not in config.loads(MINIMAL, "rig.yaml").text


def test_it_takes_the_place_of_an_earlier_one():
    document = EditedYaml(TEXT, "rig.yaml")
    set_discrepancy(document, forms.form(4, pull=False), "rig.yaml")
    read = config.loads(document.text(), "rig.yaml").settings.discrepancy
    assert read == forms.form(4, pull=False)


@pytest.mark.parametrize(
    ("pattern", "new", "key", "expected"),
    [
        (r"load: 60\.0 N\n", "load: 60 kg\n", "discrepancy.load", "a quantity in N above 0 N"),
        (r"load: 60\.0 N\n", "load: -60 N\n", "discrepancy.load", "a quantity in N above 0 N"),
        (r"  speed: 0\.025 m/s\n", "", "discrepancy.speed", "a quantity in m/s"),
        (r"slip: \[0\.02, 0\.65\]", "slip: [0.7, 0.65]", "domain.slip", "the low end below"),
        (r"travel: forward", "travel: sideways", "domain.travel", "one of forward, backward, both"),
        (r"points: \[\[", "points: [[1.0, ", "discrepancy.points.0", "a list of 10 numbers (slip"),
        (r"points: .*\n", "points: []\n", "discrepancy.points", "a list of 1 to 64 points"),
        (r"points: .*\n", "points: 3\n", "discrepancy.points", "a list of 1 to 64 points"),
        (r"mean: \[", "mean: [0.5, ", "discrepancy.torque.mean", "4 numbers, one a point"),
        (r"spread: \[\[", "spread: [[0.5, ", "discrepancy.torque.spread", "4 numbers a direction"),
        (r"mean: \[", "mean: [x, ", "discrepancy.torque.mean.0", "a number"),
        (r"rest: 0\.02", "rest: 1.2", "discrepancy.torque.rest", "a number from 0 to 1"),
        (r"size: 0\.1 N\*m", "size: 0.1 N", "discrepancy.torque.size", "a quantity in N*m"),
        (r"with_cohesion: \[-0\.4", "with_cohesion: [-1.4", "with_cohesion.0", "from -1 to 1"),
        (r"with_cohesion: \[-0\.4", "with_cohesion: [0.0, -0.4", "with_cohesion", "2 correlations"),
        (r"with_cohesion: \[-0\.4", "with_cohesion: [-1.0", "soil.among", "that hold together"),
        (r"among: \[-0\.3, ", "among: [", "soil.among", "a list of 3 correlations"),
        (r"  torque:", "  tork:", "discrepancy.tork", "did you mean torque?"),
    ],
)
def test_a_mistake_is_one_line(pattern, new, key, expected):
    text, count = re.subn(pattern, new, TEXT, count=1)
    assert count == 1, pattern
    line = message(text)
    assert line.startswith("rig.yaml:") and key in line and "found" in line and expected in line


def test_of_sinkage_and_pull_alone():
    """A table without torque teaches a discrepancy too."""
    given = forms.form(2, torque=False)
    assert config.loads(written(given), "rig.yaml").settings.discrepancy == given


def test_points_that_differ_by_nothing_still_have_a_root():
    """Rounding may put two of them on one place."""
    text = re.sub(r"points: \[(\[[^]]*\]), \[[^]]*\]", r"points: [\1, \1", TEXT)
    assert config.loads(text, "rig.yaml").settings.discrepancy is not None
