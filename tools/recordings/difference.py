"""How two recordings differ in what they were made with: configuration, run, versions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from gritd.estimator.config.units import UnitError, parse, split
from gritd.estimator.config.yamltree import ConfigError, Node, Scalar, YamlSequence, compose
from gritd.estimator.config.yamltree import Mapping as YamlMapping
from gritd.estimator.recording.recording import Recording

# where readings come from, where they go, and what people call things: the estimate is the same
BESIDE = re.compile(
    r"testbed|devices\..*|logging\..*|filter\.engine|bed\.(name|stale_after)"
    r"|channels\.(.*\.)?(device|signal|date|serial|bits)"
    r"|run\.(name|notes|operator|part|lost_before)"
    r"|versions\.(?!tick_revision$).*"
)
ABSENT = ""


@dataclass(frozen=True)
class Difference:
    """Of a key, as written in either; empty where it is absent."""

    key: str
    first: str
    second: str

    @property
    def matters(self) -> bool:
        """Whether the same readings may give another estimate."""
        return not BESIDE.fullmatch(self.key)


def differences(first: Recording, second: Recording) -> list[Difference]:
    """In the order of the first's keys; the same quantity in other units is none."""
    a, b = _aligned(made_with(first), made_with(second))
    keys = dict.fromkeys((*a, *b))
    return [
        Difference(key, a.get(key, ABSENT), b.get(key, ABSENT))
        for key in keys
        if not same(a.get(key, ABSENT), b.get(key, ABSENT))
    ]


def made_with(recording: Recording) -> dict[str, str]:
    """Keys with dots and what they say. Without a configuration that can be read, those of the run
    and the versions alone.
    """
    try:
        tree = compose(recording.config_yaml or "", str(recording.path))
    except ConfigError:
        tree = None
    return {
        **(dict(_flat(tree, "")) if tree is not None else {}),
        **{f"run.{key}": value for key, value in recording.run.entries().items()},
        **{f"versions.{key}": value for key, value in recording.versions.items()},
    }


def _flat(node: Node, key: str) -> Iterator[tuple[str, str]]:
    if isinstance(node, YamlMapping):
        for name, value in node.items.items():
            yield from _flat(value, f"{key}.{name}" if key else name)
    else:
        yield key, _text(node)


def _text(node: Node) -> str:
    if isinstance(node, Scalar):
        return node.text
    if isinstance(node, YamlSequence):
        return f"[{', '.join(map(_text, node.items))}]"
    return "{…}"


def _aligned(
    first: Mapping[str, str], second: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """A bare quantity stands for `value` where the other has `value` and `sigma`."""
    return _named_as(first, second), _named_as(second, first)


def _named_as(own: Mapping[str, str], other: Mapping[str, str]) -> dict[str, str]:
    return {
        f"{key}.value" if key not in other and f"{key}.value" in other else key: text
        for key, text in own.items()
    }


def same(a: str, b: str) -> bool:
    """Whether two texts say the same quantity, or are the same."""
    if a == b:
        return True
    try:
        unit = split(b)[1]
        return parse(a, unit) == parse(b, unit)
    except UnitError:
        return False
