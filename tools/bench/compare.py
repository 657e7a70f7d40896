"""Two runs of `gritd bench` held against each other: by ratios, since machines differ."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gritd.tools.cli.command import USAGE, CommandError

WORSE = 0.8  # of what a ratio was; less is worse than the noise of a run explains


def is_ratio(name: str) -> bool:
    """Whether a figure is a ratio of which larger is better."""
    return name.startswith("over_") or "ratio" in name.split("_")


def ratios(figures: Mapping[str, Any]) -> dict[str, float]:
    """`section.name` -> ratio."""
    return {
        f"{section}.{name}": float(value)
        for section, values in figures.items()
        if isinstance(values, Mapping) and section != "machine"
        for name, value in values.items()
        if is_ratio(name)
    }


def loaded(path: Path) -> dict[str, float]:
    """The ratios of an earlier run. Raises CommandError where the file is none of `--json`."""
    try:
        figures = json.loads(path.read_text(encoding="utf-8"))
        earlier = ratios(figures)
    except OSError as error:
        raise CommandError(f"{path}: cannot read: {error.strerror}", USAGE) from None
    except (ValueError, TypeError, AttributeError):
        earlier = {}

    if not earlier:
        raise CommandError(f"{path}: found no ratios; expected the output of --json", USAGE)
    return earlier


def comparison(before: Mapping[str, float], now: Mapping[str, float]) -> tuple[list[str], bool]:
    """A line for each ratio of both, and whether one is worse by a fifth or more."""
    lines, failed = [], False
    for name in sorted(before.keys() & now.keys()):
        worse = now[name] <= WORSE * before[name]
        failed |= worse
        lines.append(
            f"{name}: {before[name]:.3g} before, {now[name]:.3g} now{' WORSE' if worse else ''}"
        )

    for name in sorted(before.keys() - now.keys()):
        lines.append(f"{name}: {before[name]:.3g} before, not measured now")

    return lines, failed
