"""The library of effects: physics that may be at work on a testbed and that Eqs. (1)-(10) leave
out.

Each module of this package but `base` and this one defines one Effect; the file's name is the
effect's name. `EFFECTS` finds them, and those of other packages (docs/plug-ins.md). A subclass of
it in the same file is a form of it, not another.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from collections.abc import Iterable, Mapping
from dataclasses import fields

from gritd.estimator.effects.base import STAGES, Effect
from gritd.estimator.plugins import EFFECTS as GROUP
from gritd.estimator.plugins import PluginError, leave_out, plugins, refused, without

SHARED = ("base", "library")  # modules of this package that are no effect


def _find() -> dict[str, type[Effect]]:
    effects = {}
    folders = sys.modules[__package__].__path__
    for module in sorted(m.name for m in pkgutil.iter_modules(folders) if m.name not in SHARED):
        members = vars(importlib.import_module(f"{__package__}.{module}")).values()
        own = [
            m
            for m in members
            if isinstance(m, type) and Effect in m.__bases__ and m.__module__.endswith("." + module)
        ]
        if len(own) != 1:
            raise TypeError(
                f"estimator/effects/{module}.py: expected one subclass of Effect, found {len(own)}"
            )
        effects[module] = own[0]

    return effects | _added(effects)


def _added(own: Mapping[str, type[Effect]]) -> dict[str, type[Effect]]:
    """Effects of other packages; without what is none, which is said."""
    effects = {}
    for name, effect in plugins(GROUP).items():
        try:
            _check(name, effect, own)
            effects[name] = effect
        except PluginError as error:
            leave_out(GROUP, name, error)
    return effects


def _check(name: str, effect: object, own: Mapping[str, type[Effect]]) -> None:
    """Raises PluginError."""
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        raise refused(GROUP, name, "found no subclass of Effect; expected one")
    if effect.name != name:
        why = f"found the effect {effect.name}; expected {name}, the name of its file"
        raise refused(GROUP, name, why)
    if name in own:
        raise refused(GROUP, name, "found an effect of gritd's own; expected another name")


def make(name: str, values: Mapping[str, float]) -> Effect:
    """The effect of this name; parameters not given keep their default. ValueError names what does
    not exist.
    """
    if name not in EFFECTS:
        known = ", ".join(EFFECTS)
        raise ValueError(f"effects: no effect '{name}'{without(GROUP, name)}; there are {known}")

    effect = EFFECTS[name]

    parameters = {parameter.name: parameter for parameter in effect.parameters()}
    for key, value in values.items():
        if key not in parameters:
            there = ", ".join(parameters)
            raise ValueError(f"effects.{name}: no parameter '{key}'; there are {there}")
        bounds = parameters[key]
        if not bounds.low <= value <= bounds.high:
            raise ValueError(
                f"effects.{name}.{key}: {value:g} is outside"
                f" {bounds.low:g} … {bounds.high:g} {bounds.unit}"
            )

    return effect(**values)


def in_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Effects in the order in which they act, whatever order they are listed in."""
    return tuple(
        sorted(
            effects,
            key=lambda e: (STAGES.index(e.stage), e.name, *(getattr(e, f.name) for f in fields(e))),
        )
    )


EFFECTS: dict[str, type[Effect]] = _find()
