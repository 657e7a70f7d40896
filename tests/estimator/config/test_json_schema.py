"""The JSON Schema of the configuration, held against what the parser accepts and refuses."""

from __future__ import annotations

import datetime
import json
from collections import defaultdict
from collections.abc import Iterator
from string import Template
from typing import Any

import jsonschema
import pytest
import yaml

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from gritd.estimator.config.json_schema import json_schema
from gritd.tools.commands import check_config
from gritd.tools.dev import config_reference
from tests.estimator.config.rig import changed

VALIDATOR = jsonschema.Draft7Validator(json_schema())
FILLED = {"side_force": "", "where": "a hall", "source": "a table", "torque_source": "wrench"}


def amiss(text: str) -> list[str]:
    """Where a text breaks the schema."""
    document = json.loads(json.dumps(yaml.safe_load(text), default=datetime.date.isoformat))
    return [error.json_path for error in VALIDATOR.iter_errors(document)]


def test_the_command_prints_a_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert check_config.main(["--schema"]) == 0
    printed = json.loads(capsys.readouterr().out)
    jsonschema.Draft7Validator.check_schema(printed)
    assert printed == VALIDATOR.schema


@pytest.mark.parametrize("name", ["testbed.yaml", "rig_cmu.yaml", "rig_csv.yaml", "rig_emps.yaml"])
def test_a_shipped_configuration_and_its_effective_text(name: str) -> None:
    text = filled(name)
    assert amiss(text) == []
    assert amiss(config.loads(text, name).text) == []


@pytest.mark.parametrize("name", ["rig_mgst.yaml", "rig_table.yaml"])
def test_a_shipped_template(name: str) -> None:
    assert amiss(filled(name)) == []


def filled(name: str) -> str:
    """A packaged configuration; what an importer fills in is a number, as a rule."""
    template = Template(packaged(name).read_text(encoding="utf-8"))
    return template.substitute(defaultdict(lambda: "1.0", FILLED))


def test_it_has_every_key_of_the_reference() -> None:
    rows = config_reference.reference().splitlines()
    documented = [row.split("`")[1] for row in rows if row.startswith("| `")]
    assert len(documented) > 100
    assert set(documented) <= set(keys(VALIDATOR.schema))


def keys(schema: Any) -> Iterator[str]:
    """Every key of every mapping in a schema."""
    parts = schema.values() if isinstance(schema, dict) else schema
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
    for part in parts:
        if isinstance(part, dict | list):
            yield from keys(part)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("wheel: {radius:", "wheel: {raduis:"),
        ("pulley_radius:", "pulley_raduis:"),
        ("kind: serial, port:", "kind: serial, prot:"),
        ("kind: serial", "kind: seriel"),
        ("width: 71 mm", "width: 71"),
        ("tan_phi: 0.6", "tan_phi: -1.0"),
        ("range: [0 V, 5 V]}\n  motor", "range: [0 V]}\n  motor"),
        ("sigma: 300 Pa", "sigma: true"),
        ("load: {nominal: 70 N}", "load: {}"),
        ("load: {nominal: 70 N}", "load: {nominal: 70 N}\neffects: {bulldozzing: {}}"),
        ("load: {nominal: 70 N}", "load: {nominal: 70 N}\nrates: {update: sometimes}"),
    ],
)
def test_what_the_parser_refuses(right: str, wrong: str) -> None:
    text = changed(right, wrong)
    with pytest.raises(ConfigError):
        config.loads(text, "test")
    assert amiss(text)


@pytest.mark.parametrize(
    "more",
    [
        "rates: {update: auto}",
        "rates: {update: 10 Hz}",
        "logging: {disk_cap: unlimited, part_size: 1 GB}",
        "run: {pass: 2, notes: 'a note'}",
        "effects: {bed_slope: {angle: 2 deg}}",
    ],
)
def test_it_agrees_with_the_parser(more: str) -> None:
    text = changed("load: {nominal: 70 N}", f"load: {{nominal: 70 N}}\n{more}")
    try:
        config.loads(text, "test")
    except ConfigError:
        assert amiss(text)
    else:
        assert amiss(text) == []
