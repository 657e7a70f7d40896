"""A small configuration that is valid, changes of it, texts that mean harm, and the
error line of a text."""

from __future__ import annotations

import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError

MINIMAL = """\
testbed: bench
wheel: {radius: 72 mm, width: 71 mm}
pulley_radius: 20 mm
soil:
  cohesion: {value: 800 Pa, sigma: 300 Pa}
  tan_phi: 0.6
  shear_modulus: 25 mm
  exponent: 1.1
  k1: 0 kPa
  k2: 1500 kN/m^3
drive: {torque_constant: 2 N*m/A}
load: {nominal: 70 N}
devices:
  rig: {kind: serial, port: /dev/ttyACM0}
channels:
  wheel_encoder: {device: rig, signal: wheel, scale: 0.1 mrad/count, noise: 0.3 count}
  carriage_encoder: {device: rig, signal: carriage, scale: 0.7 mrad/count, noise: 0.3 count}
  sinkage_pot: {device: rig, signal: z, scale: 25 mm/V, noise: 2 mV, range: [0 V, 5 V]}
  motor_shunt: {device: rig, signal: i, scale: 2 A/V, noise: 2 mV, range: [0 V, 5 V]}
"""


def changed(old: str, new: str, text: str = MINIMAL) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


HOSTILE = {
    "bomb": (
        "a: &a [x,x,x,x,x,x]\n" + "".join(f"b{i}: &b{i} [*a,*a,*a]\n" for i in range(20)),
        "without anchors",
    ),
    "deep flow": ("[" * 200_000, "nesting deeper than 20"),
    "deep blocks": ("- " * 100_000, "nesting deeper than 20"),
    "deep mappings": ("{a: " * 50_000, "nesting deeper than 20"),
    "many keys": ("".join(f"key{i}: 1\n" for i in range(20_000)), "more than 5000 values"),
    "long list": ("a: [" + "1," * 120_000 + "]", "more than 5000 values"),
    "long name": (
        changed("testbed: bench", "testbed: bench\nx: " + "x" * 250_000),
        "an unknown key",
    ),
    "long number": (
        changed("pulley_radius: 20 mm", "pulley_radius: " + "9" * 250_000),
        "found 99999",
    ),
    "large exponent": (
        changed("pulley_radius: 20 mm", "pulley_radius: 1e999999999 m"),
        "found 1e999999999 m",
    ),
    "large power": (
        changed("pulley_radius: 20 mm", "pulley_radius: 9e999 Mm^9*Mm^9*Mm^9"),
        "expected a quantity",
    ),
    "long key": ("x" * 200_000 + ": 1", "valid YAML"),
    "long unknown key": (
        changed("testbed: bench", "testbed: bench\n? " + "x" * 200_000 + "\n: 1"),
        "an unknown key",
    ),
    "quotes": ("testbed: '" + "''" * 120_000, "end of stream"),
    "questions": ("? " * 100_000, "as a key"),
    "tags": ("a: !" + "x" * 200_000 + " 1", "without a tag"),
    "huge": ("# " + "x" * 3_000_000, "more than 256 KiB"),
}


def message(text: str) -> str:
    """The error line of a text that must be refused."""
    with pytest.raises(ConfigError) as caught:
        config.loads(text, "rig.yaml")
    line = str(caught.value)
    assert "\n" not in line and len(line) < 400
    return line
