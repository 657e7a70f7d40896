"""A configuration changed by a command keeps its comments and its layout."""

from __future__ import annotations

import difflib

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from gritd.config import packaged
from gritd.estimator.config import units
from gritd.estimator.config.yamltree import ConfigError
from gritd.tools.cli.yaml_edit import EditedYaml, plain_text, quantity

TESTBED = packaged().read_text(encoding="utf-8")
FOUR = "a:\n    b: 1 # one\n    # of a\n\n\n# of c\nc:\n    - 1\n    - 2\n"
LAYOUTS = {
    "testbed": TESTBED,
    "four spaces": FOUR,
    "windows": TESTBED.replace("\n", "\r\n"),
    "no end": "# head\n\na: 1\nb: {c: 2 mm} # mm\n# tail\n",
    "words": "a: yes\nb: 012\nc: 1e3\nd: 'no'\ne: \"x\"\nf: 2026-11-02\n",
}


def changed(before: str, after: str) -> list[str]:
    lines = difflib.ndiff(before.splitlines(), after.splitlines())
    return [line for line in lines if line[0] in "+-"]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_is_not_changed_stays_byte_for_byte(layout: str) -> None:
    text = LAYOUTS[layout]
    assert EditedYaml(text, "x").text() == text

    document = EditedYaml(text, "x")
    document.set(("new",), "1 mm")
    ending = "\r\n" if layout == "windows" else "\n"
    assert sorted(changed(text, document.text())) == ["+ new: 1 mm"]
    assert document.text().count(ending) == text.count(ending) + 1


def test_values_take_the_place_of_values() -> None:
    document = EditedYaml(TESTBED, "x")
    pot = ("channels", "sinkage_pot")
    document.set((*pot, "scale"), quantity(0.02513, 4e-5, "m/V", document.written(*pot, "scale")))
    document.set((*pot, "date"), "2026-11-22")
    document.set(("soil", "exponent"), quantity(1.2, 0.01, ""))
    document.set(("soil", "tan_phi"), quantity(0.6, 0.02, ""))

    assert changed(TESTBED, document.text()) == [
        "-   tan_phi: {value: 0.577, sigma: 0.06} # φ = 30°",
        "+   tan_phi: {value: 0.6, sigma: 0.02}   # φ = 30°",
        "-   exponent: 1.1",
        "+   exponent: {value: 1.2, sigma: 0.01}",
        "-     scale: {value: 25 mm/V, sigma: 0.05 mm/V}",
        "+     scale: {value: 25.13 mm/V, sigma: 0.04 mm/V}",
        "-     date: 2026-11-02",
        "+     date: 2026-11-22",
    ]


def test_a_new_key_stays_with_its_mapping() -> None:
    """Not behind the empty line that ends it."""
    document = EditedYaml(TESTBED, "x")
    document.set(("channels", "motor_temperature", "serial"), plain_text("12"))
    document.set(("effects", "bulldozing", "share"), quantity(0.5, 0.1, ""))
    assert changed(TESTBED, document.text()) == [
        "+     serial: '12'",
        "+   bulldozing:",
        "+     share: {value: 0.5, sigma: 0.1}",
    ]
    lines = document.text().splitlines()
    assert lines[lines.index("    serial: '12'") + 1] == "    stale_after: 3 s"


def test_a_key_can_go() -> None:
    document = EditedYaml(TESTBED, "x")
    document.remove("effects", "stress_linearisation")
    document.remove("effects", "not there")
    assert set(changed(TESTBED, document.text())) == {
        "- effects:",
        "-   stress_linearisation: {share: 1.0}",
        "+ effects: {}",
    }
    assert document.has("effects") and not document.has("effects", "stress_linearisation")


def test_the_empty_line_below_a_key_stays_when_it_goes() -> None:
    document = EditedYaml(TESTBED, "x")
    for key in ("date", "serial"):
        document.remove("channels", "sinkage_pot", key)
    assert changed(TESTBED, document.text()) == [
        "-     date: 2026-11-02",
        "-     serial: LP-100-31",
    ]

    document = EditedYaml("a:\n  b: 1 # one\n  c: 2\n\n# of d\nd: 3\n", "x")
    document.remove("a", "c")
    assert document.text() == "a:\n  b: 1 # one\n\n# of d\nd: 3\n"


def test_what_is_no_configuration_is_told_with_its_line() -> None:
    with pytest.raises(ConfigError, match=r"^bad\.yaml:2: "):
        EditedYaml("a: 1\n b: 2\n", "bad.yaml")


@given(
    st.floats(-1e6, 1e6).filter(lambda x: abs(x) > 1e-9),
    st.floats(1e-7, 1.0),
    st.sampled_from(["25 mm/V", "1 m/V", "", "3 um/V", "{nonsense"]),
)
def test_a_quantity_is_read_back_within_a_hundredth_of_its_sigma(
    value: float, relative: float, like: str
) -> None:
    sigma = abs(value) * relative
    read = yaml.safe_load(quantity(value, sigma, "m/V", like))
    assert units.parse(read["value"], "m/V") == pytest.approx(value, abs=0.01 * sigma)
    assert units.parse(read["sigma"], "m/V") == pytest.approx(sigma, rel=0.01)


@given(st.floats(1e-9, 1e9), st.booleans())
def test_a_plain_number_is_a_number_to_yaml(value: float, exact: bool) -> None:
    """1e-05 would be read as text."""
    read = yaml.safe_load(quantity(value, 0.0 if exact else 0.1 * value, ""))
    found = read if exact else read["value"]
    assert isinstance(found, float) and found == pytest.approx(value, rel=2e-3)


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=20))
def test_any_serial_number_is_read_back(serial: str) -> None:
    document = EditedYaml("a: {serial: x, b: 1} # c\n", "x")
    document.set(("a", "serial"), plain_text(serial))
    assert yaml.safe_load(document.text()) == {"a": {"serial": serial, "b": 1}}
