"""`twenty compare`: whether two versions give the same results."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gritd.tools.dev.twenty.diagnose import TIMES

SHOWN = 3  # keys that differ, of each campaign


def compare(one: Path, other: Path) -> int:
    """1 if a result or what was printed differs, other than in the version that is stated."""
    names = sorted({p.stem for f in (one, other) for p in f.glob("*.json") if p.name != TIMES})
    if not names:
        raise SystemExit(f"{one}, {other}: found no results; expected those of `diagnose`")
    differences = {name: _compared(name, one, other) for name in names}
    for name, differs in differences.items():
        print(f"{name:26} {differs or 'identical'}")

    count = sum(not _matters(differs) for differs in differences.values())
    print(f"{count} of {len(names)} the same")
    return int(count < len(names))


VERSION_ONLY = "the same but for "


def _matters(differs: str) -> bool:
    return bool(differs) and not differs.startswith(VERSION_ONLY)


def _compared(name: str, one: Path, other: Path) -> str:
    """What differs, empty if nothing does."""
    results, texts = ([f / f"{name}{end}" for f in (one, other)] for end in (".json", ".txt"))
    if absent := [str(path) for path in (*results, *texts) if not path.exists()]:
        return f"missing: {', '.join(absent)}"
    a, b = (path.read_bytes() for path in results)
    differs = "" if a == b else _differing(json.loads(a), json.loads(b))
    if not _matters(differs) and texts[0].read_bytes() != texts[1].read_bytes():
        return "what was printed differs"
    return differs


def _differing(a: dict[str, Any], b: dict[str, Any]) -> str:
    """The first keys that differ; a release has another version in it, which is no difference."""
    keys = [f"{key}: {x!s:.40} | {y!s:.40}" for key, x, y in _leaves(a, b)]
    listed = "; ".join(keys[:SHOWN])
    versions = [{**d["redo"]["versions"], "gritd": ""} for d in (a, b)]
    same = [
        {**d, "redo": {**d["redo"], "versions": v}} for d, v in zip((a, b), versions, strict=True)
    ]
    if json.dumps(same[0]) == json.dumps(same[1]):
        return VERSION_ONLY + listed
    return f"{len(keys)} values differ: {listed}" if keys else "order or layout differs"


def _leaves(a: Any, b: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Key and both values, wherever they differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        for name in dict.fromkeys((*a, *b)):
            yield from _leaves(a.get(name), b.get(name), f"{key}.{name}" if key else name)
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for n, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from _leaves(x, y, f"{key}[{n}]")
    elif repr(a) != repr(b):
        yield key, a, b
