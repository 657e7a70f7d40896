"""The map of `gritd import csv`: what is read, and the one line for what is not."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.config import units
from gritd.estimator.config.yamltree import ConfigError
from gritd.tools.importers.series.mapping import MEASURED, loads, spelled

TIME = "time: {channel: time, unit: s}"
UNITS = {
    "wheel_angle": ["rad", "deg", "turn", "mrad"],
    "wheel_speed": ["rpm", "rad/s", "deg/s", "turn/min"],
    "carriage_position": ["m", "mm", "cm", "um"],
    "drawbar_pull": ["N", "kN", "mN"],
    "torque": ["N*m", "Nm", "N.m", "mN*m"],
    "current": ["A", "mA"],
}


@given(st.data(), st.floats(-1e3, 1e3).filter(lambda x: abs(x) > 1e-6))
def test_a_column_becomes_si_by_its_unit(data: st.DataObject, factor: float) -> None:
    channel = data.draw(st.sampled_from(sorted(UNITS)))
    unit = data.draw(st.sampled_from(UNITS[channel]))
    text = f"columns: {{{TIME}, x: {{channel: {channel}, unit: {unit}, factor: {factor:.9f}}}}}"
    mapped = loads(text, "map.yaml").columns["x"]

    assert mapped.factor.value == pytest.approx(factor, rel=1e-6, abs=1e-9)
    assert mapped.per_unit == pytest.approx(units.parse(f"1 {spelled(unit)}", MEASURED[channel][0]))


@given(
    st.sampled_from(sorted(MEASURED)),
    st.text(st.characters(codec="ascii", exclude_characters="\x7f"), max_size=12),
)
def test_a_unit_is_right_or_told_in_one_line(channel: str, unit: str) -> None:
    quoted = "'" + "".join(c for c in unit if c.isprintable()).replace("'", "''") + "'"
    text = f"columns: {{{TIME}, x: {{channel: {channel}, unit: {quoted}}}}}"
    try:
        mapped = loads(text, "map.yaml").columns["x"]
    except ConfigError as error:
        assert "\n" not in str(error) and "map.yaml:1: columns.x.unit" in str(error)
        assert "unit of the same kind" in str(error)
    else:
        wanted = units.unit(MEASURED[channel][0]).dimension
        assert units.unit(mapped.unit).dimension == wanted


@given(st.text(max_size=200))
def test_any_text_is_a_map_or_one_line(text: str) -> None:
    try:
        loads(text, "map.yaml")
    except ConfigError as error:
        assert "\n" not in str(error) and str(error).startswith("map.yaml:")


def test_revolutions_a_minute() -> None:
    text = f"columns: {{{TIME}, w: {{channel: wheel_speed, unit: rpm}}}}"
    assert loads(text, "m").columns["w"].per_unit == pytest.approx(math.pi / 30)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("columns: {t: {channel: tim, unit: s}}", "found tim (did you mean time?)"),
        ("columns: {t: {channel: time, unit: mm}}", "expected a unit of the same kind as s"),
        (f"columns: {{{TIME}, x: {{channel: load, units: N}}}}", "(did you mean unit?)"),
        ("columns: {t: {channel: time}}", "t.unit: found nothing"),
        (
            f"columns: {{{TIME}, x: {{channel: load, unit: N}}, y: {{channel: load, unit: N}}}}",
            "expected each channel once",
        ),
        (
            f"columns: {{{TIME}, x: {{channel: load, unit: N, factor: 0}}}}",
            "expected a factor other than 0",
        ),
        ("load: 3 N", "columns: found nothing"),
        (f"columns: {{{TIME}}}\nfiles: {{a.csv: {{columns: {{{TIME}}}}}}}", "files"),
        (f"columns: {{{TIME}}}\nruns: {{a: {{load: 3 m}}}}", "runs.a.load"),
        ("", "found nothing"),
    ],
)
def test_what_is_wrong_is_one_line(text: str, line: str) -> None:
    with pytest.raises(ConfigError) as error:
        loads(text, "map.yaml")
    assert line in str(error.value) and str(error.value).startswith("map.yaml:")
