"""The configured effects: by name, each parameter with its unit, bounds and default."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gritd.estimator.config.kinds import Kind, NumberWithUnit
from gritd.estimator.config.nearest import did_you_mean
from gritd.estimator.config.schema import NEEDED, Key, Named, Section, UncertainQuantity, entries
from gritd.estimator.config.settings import ConfiguredEffect
from gritd.estimator.config.yamltree import Mapping as Tree
from gritd.estimator.config.yamltree import Node
from gritd.estimator.effects import EFFECTS

EffectSchema = Callable[[str], Mapping[str, NumberWithUnit] | None]
"""Effect name → unit and bounds of each of its parameters; None for a name that is no effect."""


@dataclass(frozen=True)
class Effects:
    """Effect name → parameters. With a schema each has its unit and bounds; without one any
    quantity will do.
    """

    schema: EffectSchema | None
    expected: str = "a mapping of effects"

    def read(self, node: Node) -> tuple[tuple[ConfiguredEffect, ...], Node]:
        given = entries(node, self.expected)
        read = {name: self._parameters(name, item).read(item) for name, item in given.items()}
        effects = tuple(
            ConfiguredEffect(name, parameters) for name, (parameters, _) in read.items()
        )
        return effects, Tree(node.place, {name: complete for name, (_, complete) in read.items()})

    def _parameters(self, name: str, item: Node) -> Kind:
        if self.schema is None:
            return Named(
                UncertainQuantity(NumberWithUnit(None)),
                lambda _, value: value,
                "a mapping of parameters",
            )
        if (known := self.schema(name)) is None:
            raise item.place.error(
                f"an unknown effect{did_you_mean(name, EFFECTS)}", "the name of an effect"
            )
        if not entries(item, "a mapping of parameters"):
            raise item.place.error("no parameter", f"at least one of {', '.join(known)}")

        return parameters(name, known)


def parameters(name: str, known: Mapping[str, NumberWithUnit]) -> Section:
    """The keys of one effect. A default is the library's own value: off for a strength, usual for
    a shape.
    """
    own = {p.name: p for p in EFFECTS[name].parameters()} if name in EFFECTS else {}
    keys = {
        p: Key(UncertainQuantity(kind), own[p].meaning, f"{own[p].centre!r} {own[p].unit}".strip())
        if p in own
        else Key(UncertainQuantity(kind), "parameter", NEEDED)
        for p, kind in known.items()
    }
    return Section(keys, dict, "a mapping of parameters")
