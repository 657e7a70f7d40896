"""What other packages add, by the entry points of their distributions: effects, sensors, importers.

A package that cannot be loaded, or offers something else than it says, ends the command with one
line: to go on without it would change results in silence.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

EFFECTS, SENSORS, IMPORTERS = "gritd.effects", "gritd.sensors", "gritd.importers"  # the groups


class PluginError(Exception):
    """A plug-in cannot be used: one line that names its distribution."""


def plugins(group: str) -> dict[str, Any]:
    """What the entry points of a group name, by their names, in order. Raises PluginError."""
    objects: dict[str, Any] = {}
    for entry in sorted(_offered(group), key=lambda each: each.name):
        if entry.name in objects:
            raise refused(group, entry.name, "found it twice; expected each name once")
        objects[entry.name] = _loaded(entry)
    return objects


def _offered(group: str) -> EntryPoints:
    # loaded here: it takes a fifth of the time in which a command without plug-ins ends
    from importlib.metadata import entry_points

    return entry_points(group=group)


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except Exception as error:
        cause = f"{type(error).__name__}: {error}"
        raise refused(entry.group, entry.name, f"cannot be loaded: {cause}") from error


def refused(group: str, name: str, why: str) -> PluginError:
    """The error for a plug-in that offers something else than was expected."""
    named = [each for each in _offered(group) if each.name == name]
    packages = ", ".join(sorted({each.dist.name for each in named if each.dist})) or "unknown"
    return PluginError(f"plug-in {name} of {group} (package {packages}): {why}")
