"""The configuration file: what is read, and into what."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from gritd.estimator.config.kinds import NumberWithUnit
from gritd.estimator.config.settings import (
    Channel,
    ConfiguredEffect,
    FilterSettings,
    Load,
    Logging,
    Rates,
    Uncertain,
)
from gritd.estimator.messages.run_info import RunInfo
from tests.estimator.config.rig import MINIMAL, changed

TESTBED = packaged().read_text(encoding="utf-8")


# ---- what is read --------------------------------------------------------------------------------


def test_quantities_become_si() -> None:
    read = config.loads(MINIMAL, "rig.yaml").settings
    assert read.wheel.radius == 0.072
    assert read.soil.cohesion == Uncertain(800.0, 300.0)
    assert read.soil.tan_phi == Uncertain(0.6, 0.0)
    assert read.soil.pressure_sinkage.form == "reece"
    assert read.soil.pressure_sinkage.second == 1.5e6
    assert read.channels["sinkage_pot"].calibration.scale.value == 0.025
    assert (read.channels["motor_shunt"].low, read.channels["motor_shunt"].high) == (0.0, 5.0)
    assert read.wrench is None and "motor_temperature" not in read.channels


def test_defaults_are_those_of_the_settings() -> None:
    """Two places state defaults, the table and the dataclasses; they agree."""
    read = config.loads(MINIMAL, "rig.yaml").settings
    assert (
        read.rates == Rates(auto=True)
        and read.filter == FilterSettings()
        and read.logging == Logging()
    )
    assert read.load == Load(Uncertain(70.0)) and read.effects == ()
    given = read.channels["wheel_encoder"]
    assert given == Channel(
        "wheel_encoder",
        "rig",
        "wheel",
        given.calibration,
        0.3,
        low=-float("inf"),
        high=float("inf"),
    )


def test_bekker_and_reece_meet() -> None:
    bekker = changed(
        "  k1: 0 kPa\n  k2: 1500 kN/m^3\n", "  k_c: 0.9 kN/m^(n+1)\n  k_phi: 1523.4 kN/m^(n+2)\n"
    )
    law = config.loads(bekker, "rig.yaml").settings.soil.pressure_sinkage
    assert law.form == "bekker" and law.modulus(0.071) == pytest.approx(900 / 0.071 + 1_523_400)


@pytest.mark.parametrize("text", [TESTBED, MINIMAL])
def test_effective_text_gives_the_same_settings_anywhere(text: str, tmp_path: Path) -> None:
    first = config.loads(text, "a.yaml", folder=tmp_path)
    again = config.loads(first.text, "b.yaml")
    assert again.settings == first.settings
    assert repr(again.settings) == repr(first.settings)  # repr tells every bit of a float
    assert again.text == first.text
    assert "horizon: 50 ms" in first.text and "radius: 72 mm" in first.text


def test_relative_database_counts_from_the_files_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "rig.yaml").write_text(TESTBED, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert config.load("rig.yaml").settings.devices["bus"].dbc == str(tmp_path / "testbed.dbc")


def test_inline_signals_and_bus_options() -> None:
    bus = """\
  bus:
    kind: can
    interface: udp_multicast
    options: {hop_limit: 0, fd: false, "port": 43113, name: "no"}
    signals:
      Pot.z: {id: 0x120, start: 0, length: 16, signed: true, scale: 0.001}
"""
    read = config.loads(changed("channels:\n", bus + "channels:\n"), "rig.yaml")
    device = read.settings.devices["bus"]
    assert device.options == {"hop_limit": 0, "fd": False, "port": 43113, "name": "no"}
    assert device.signals == {
        "Pot.z": {"id": 0x120, "start": 0, "length": 16, "signed": True, "scale": 0.001}
    }
    assert config.loads(read.text, "b.yaml").settings == read.settings


def test_bus_options_of_every_kind_are_handed_on_as_they_are() -> None:
    options = "{rate: 1.5, fast: true, ids: [1, two, {mask: 0x7ff}], deep: {a: -3}}"
    bus = f"  bus: {{kind: can, interface: virtual, options: {options}, signals: {SIGNAL}}}\n"
    read = config.loads(changed("channels:\n", bus + "channels:\n"), "rig.yaml")
    assert read.settings.devices["bus"].options == {
        "rate": 1.5, "fast": True, "ids": [1, "two", {"mask": 0x7FF}], "deep": {"a": -3},
    }  # fmt: skip
    assert config.loads(read.text, "b.yaml").settings == read.settings


SIGNAL = "{Pot.z: {id: 0x120, start: 0, length: 16}}"


@pytest.mark.parametrize(
    "bus, words",
    [
        (f"signals: {SIGNAL}, options: {{when: 2026-11-02}}", "found 2026-11-02"),
        (
            f"signals: {SIGNAL}, options: {{none: }}",
            "found nothing; expected a number, true, false, or text",
        ),
        ("signals: {Pot.z: {id: 1, start: 0, length: 16, signed: 1}}", "expected true or false"),
        ("signals: {Pot.z: {id: 1, start: 0, length: 16, signed: yes}}", "found yes"),
    ],
)
def test_what_a_bus_cannot_be_told_is_one_line(bus: str, words: str) -> None:
    line = f"  bus: {{kind: can, interface: virtual, {bus}}}\n"
    with pytest.raises(ConfigError, match=re.escape(words)):
        config.loads(changed("channels:\n", line + "channels:\n"), "rig.yaml")


def test_effects_of_a_recording_are_read_without_a_library() -> None:
    """Another version of gritd may know others; a shape that is not given has no default there."""
    named = EFFECTS.replace("coulomb_friction", "of_tomorrow")
    read = config.loads(MINIMAL + named, "rig.yaml", effect_schema=None)
    with pytest.raises(ConfigError, match="the name 'a b'; expected letters"):
        config.loads(MINIMAL + "effects: {new: {'a b': 1}}\n", "rig.yaml", effect_schema=None)
    (effect,) = read.settings.effects
    assert effect.name == "of_tomorrow" and effect.parameters.keys() == {"loss"}

    def schema(name: str) -> dict[str, NumberWithUnit]:
        return {"loss": NumberWithUnit("N*m"), "rate": NumberWithUnit("1/s")}

    with pytest.raises(ConfigError, match=re.escape("effects.of_tomorrow.rate: found nothing")):
        config.loads(MINIMAL + named, "rig.yaml", effect_schema=schema)


EFFECTS = "effects: {coulomb_friction: {loss: {value: 1.8 N*m, sigma: 100 mN*m}}}\n"


def test_effects_are_read_into_si() -> None:
    read = config.loads(MINIMAL + EFFECTS, "rig.yaml")
    assert read.settings.effects == (
        ConfiguredEffect("coulomb_friction", {"loss": Uncertain(1.8, 0.1)}),
    )
    assert config.loads(read.text, "b.yaml").settings == read.settings


def test_effects_are_checked_against_a_schema() -> None:
    def schema(name: str) -> dict[str, NumberWithUnit] | None:
        return {
            "coulomb_friction": {"loss": NumberWithUnit("N*m")},
            "other": {"gain": NumberWithUnit("")},
        }.get(name)

    assert config.loads(MINIMAL + EFFECTS, "rig.yaml", effect_schema=schema).settings.effects
    for old, new, words in [
        ("coulomb_friction", "colomb_friction", "effects.colomb_friction: found an unknown effect"),
        ("loss", "los", "did you mean loss?"),
        ("100 mN*m", "100 N", "effects.coulomb_friction.loss.sigma: found 100 N"),
    ]:
        with pytest.raises(ConfigError, match=re.escape(words)):
            config.loads(MINIMAL + EFFECTS.replace(old, new), "rig.yaml", effect_schema=schema)


def test_run_section() -> None:
    read = config.loads(
        MINIMAL
        + "run: {name: sand 3, load: 70 N, pass: 2, start: 150 mm, operator: Ada, notes: dry}\n",
        "rig.yaml",
    )
    assert read.run == RunInfo(
        "sand 3", 70.0, pass_number=2, start_position=0.15, notes="dry", operator="Ada"
    )
    assert config.loads(read.text, "b.yaml").run == read.run
    assert config.loads(MINIMAL, "rig.yaml").run == RunInfo()


def test_packaged_testbed_is_consistent() -> None:
    """The packaged file states the wheel and soil the documents speak of, and has every sensor."""
    read = config.load(packaged()).settings
    assert (read.wheel.radius, read.wheel.width) == (0.072, 0.071)
    assert read.soil.tan_phi == Uncertain(0.577, 0.06)
    assert read.wrench is not None and len(read.channels) == 5


def test_an_effect_needs_only_what_differs_from_the_library():
    """Parameters that are not given have the library's own value; the effective text states them
    all.
    """
    text = MINIMAL + "\neffects: {grousers: {height: 5 mm}}\n"
    read = config.loads(text, "rig.yaml")
    (effect,) = read.settings.effects
    assert effect.parameters["height"].value == 0.005 and effect.parameters["count"].value == 16.0
    assert config.loads(read.text, "effective").settings == read.settings
    with pytest.raises(config.ConfigError, match="at least one of"):
        config.loads(MINIMAL + "\neffects: {grousers: {}}\n", "rig.yaml")


def test_the_friction_angle_stands_for_its_tangent() -> None:
    text = changed("tan_phi: 0.6", "phi: {value: 30 deg, sigma: 3 deg}")
    given = config.loads(text, "c").settings.soil.tan_phi
    assert given.value == pytest.approx(math.tan(math.pi / 6))
    assert given.sigma == pytest.approx(math.radians(3.0) / 0.75)

    for both in ("phi: 30 deg\n  tan_phi: 0.6", "# none"):
        with pytest.raises(ConfigError, match=r"soil\.tan_phi: found .*tan_phi or phi"):
            config.loads(changed("tan_phi: 0.6", both), "c")
