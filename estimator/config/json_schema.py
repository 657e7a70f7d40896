"""The format of the configuration file as a JSON Schema (draft 7), from the tables that parsing
comes from: an editor completes keys and marks a misspelt one with it.

A schema cannot say everything: the kind of a unit, the bounds of a quantity with a unit, and what
concerns several keys at once are for `gritd check-config`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import singledispatch
from typing import Any

import yaml

from gritd.estimator.config import units
from gritd.estimator.config.channels import Unlimited
from gritd.estimator.config.discrepancy import NumberList, NumberRows
from gritd.estimator.config.effect_keys import Effects, parameters
from gritd.estimator.config.effects import quantities
from gritd.estimator.config.kinds import (
    UNLIMITED,
    Choice,
    Either,
    FilePath,
    Integer,
    Interval,
    Kind,
    NumberWithUnit,
    Text,
    YesNo,
)
from gritd.estimator.config.schema import (
    ABSENT,
    NAMES,
    NEEDED,
    Key,
    Named,
    Options,
    Section,
    UncertainQuantity,
    Variant,
)
from gritd.estimator.config.table import table
from gritd.estimator.effects import EFFECTS

DRAFT = "http://json-schema.org/draft-07/schema#"
WITH_UNIT = f"(?:{units.NUMBER.pattern})(?: \\S|[^\\s0-9.]).*"

Schema = dict[str, Any]


def json_schema() -> Schema:
    """Every key of the file: kind, bounds, default and meaning."""
    definitions = {"quantity": {"type": "string", "pattern": _whole(WITH_UNIT)}}
    return {
        "$schema": DRAFT,
        "title": "configuration of gritd",
        "definitions": definitions,
        **of(table()),
    }


@singledispatch
def of(kind: Kind) -> Schema:
    """What a kind of value accepts."""
    raise TypeError(kind)


# ---- single values -------------------------------------------------------------------------------


@of.register
def _(kind: NumberWithUnit) -> Schema:
    """With a unit it is text. Bounds are those of a number without one."""
    text: Schema = {"$ref": "#/definitions/quantity"}
    number: Schema = {"type": "number"} | _bounds(kind)
    choices = [text] if kind.unit else [number, text]
    return _any([*choices, {"const": UNLIMITED}] if kind.unlimited else choices)


def _bounds(kind: NumberWithUnit) -> Schema:
    bounds = {"exclusiveMinimum": kind.above, "minimum": kind.low, "maximum": kind.high}
    return {name: bound for name, bound in bounds.items() if math.isfinite(bound)}


@of.register
def _(kind: Integer) -> Schema:
    return {"type": "integer", "minimum": kind.low, "maximum": kind.high}


@of.register
def _(kind: YesNo) -> Schema:
    return {"type": "boolean"}


@of.register
def _(kind: Text) -> Schema:
    return {"type": "string", "pattern": _whole(kind.pattern)}


@of.register
def _(kind: FilePath) -> Schema:
    return {"type": "string"}


@of.register
def _(kind: Choice) -> Schema:
    return {"enum": list(kind.words)}


@of.register
def _(kind: Unlimited) -> Schema:
    return {"const": UNLIMITED}


@of.register
def _(kind: Either) -> Schema:
    return _any([{"const": kind.word}, of(kind.other)])


# ---- lists ---------------------------------------------------------------------------------------


@of.register
def _(kind: Interval) -> Schema:
    return _list(of(kind.quantity), 2, 2)


@of.register
def _(kind: NumberList) -> Schema:
    return _list(of(kind.number), kind.least, kind.most)


@of.register
def _(kind: NumberRows) -> Schema:
    return _list(of(kind.row), kind.least, kind.most)


def _list(items: Schema, least: int, most: int) -> Schema:
    return {"type": "array", "items": items, "minItems": least, "maxItems": most}


# ---- mappings ------------------------------------------------------------------------------------


@of.register
def _(kind: UncertainQuantity) -> Schema:
    return _any([of(kind.quantity), of(kind.mapping())])


@of.register
def _(kind: Options) -> Schema:
    return {"type": "object"}


@of.register
def _(kind: Section) -> Schema:
    return {
        "type": "object",
        "properties": {name: _key(key) for name, key in kind.keys.items()},
        "required": [name for name, key in kind.keys.items() if key.default == NEEDED],
        "additionalProperties": False,
    }


def _key(key: Key) -> Schema:
    schema = of(key.kind)
    expected = "" if schema.get("type") == "object" else f" ({key.kind.expected})"
    schema["description"] = key.doc + expected

    if key.default not in (NEEDED, ABSENT):
        schema["default"] = yaml.safe_load(key.default)
    return schema


@of.register
def _(kind: Named) -> Schema:
    return {
        "type": "object",
        "propertyNames": {"pattern": _whole(NAMES)},
        "additionalProperties": of(kind.kind),
    }


@of.register
def _(kind: Variant) -> Schema:
    cases = [
        {"if": {"properties": {kind.selector: {"const": case}}}, "then": of(section)}
        for case, section in kind.cases.items()
    ]
    return {
        "type": "object",
        "properties": {kind.selector: {"enum": list(kind.cases)}},
        "required": [kind.selector],
        "allOf": cases,
    }


@of.register
def _(kind: Effects) -> Schema:
    """Each effect with at least one of its parameters."""
    return {
        "type": "object",
        "properties": {name: _effect(name) for name in sorted(EFFECTS)},
        "additionalProperties": False,
    }


def _effect(name: str) -> Schema:
    section = parameters(name, quantities(name) or {})
    return of(section) | {"minProperties": 1, "description": EFFECTS[name].sentence()}


# ---- pieces --------------------------------------------------------------------------------------


def _any(choices: Iterable[Schema]) -> Schema:
    """Always a list: what stands beside a `$ref` is not read."""
    return {"anyOf": list(choices)}


def _whole(pattern: str) -> str:
    """A pattern that the whole text must match: JSON Schema looks for one anywhere."""
    return f"^(?:{pattern})$"
