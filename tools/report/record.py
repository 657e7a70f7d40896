"""A diagnosis done again: from its JSON or its report, on the same files by their hash, and
compared.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gritd.estimator.recording import metadata
from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.diagnose.explain.result import Diagnosis, plain
from gritd.tools.diagnose.rig.signals import sha256
from gritd.tools.diagnose.rig.wheel import Bed
from gritd.tools.report.reference import Given

EMBEDDED = "redo"  # id of the element of a report that holds what is needed
ELEMENT = re.compile(rf'<pre id="{EMBEDDED}"[^>]*>(.*?)</pre>', re.DOTALL)
MOST_BYTES = 1 << 30
ALIKE = 0.02  # difference of a probability that other versions of the libraries may make


@dataclass(frozen=True)
class Record:
    """What was diagnosed, with what, and what was found."""

    folder: Path  # of its files
    files: Mapping[Path, str]  # with their SHA-256
    configuration: str
    seed: int
    command: str
    versions: Mapping[str, str]
    verdict: str
    accepted: tuple[str, ...]
    probability: Mapping[str, float]
    known: Mapping[Path, str] = field(default_factory=dict)  # the reference's, with their SHA-256
    bed: Bed = "prepared"
    quick: bool = False  # a first answer

    @property
    def reference(self) -> Given:
        """The campaign that it was held against."""
        return Given(tuple(self.known), self.bed)

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> Record:
        return cls.parsed(json.loads(as_json(diagnosis)), Path("/"))

    @classmethod
    def parsed(cls, document: Mapping[str, Any], folder: Path) -> Record:
        """Of the JSON; its files are looked for in a folder. Raises KeyError, …"""
        redo, hypotheses = document["redo"], document["hypotheses"]
        reference = redo.get("reference", {})

        return cls(
            folder,
            {_within(folder, Path(name)): str(value) for name, value in redo["files"].items()},
            str(redo["configuration"]),
            int(redo["seed"]),
            str(redo.get("command", "")),
            {str(k): str(v) for k, v in redo["versions"].items()},
            str(document["verdict"]),
            tuple(str(h["effect"]) for h in hypotheses if h["accepted"]),
            {str(h["effect"]): float(h["probability"]) for h in hypotheses},
            {_within(folder, Path(n)): str(v) for n, v in reference.get("files", {}).items()},
            "same" if reference.get("bed") == "same" else "prepared",
            bool(redo.get("quick", False)),
        )


def _within(folder: Path, name: Path) -> Path:
    """A file of the folder: of this name, or of this name from the folder; else its place there."""
    places = (name, folder / name)
    return next((place for place in places if _lies_in(folder, place)), folder / name.name)


def _lies_in(folder: Path, path: Path) -> bool:
    """Whether a file is there, and in the folder: a report that somebody sent has no other read."""
    return path.is_file() and path.resolve().is_relative_to(folder.resolve())


def as_json(diagnosis: Diagnosis) -> str:
    """What a report holds of the JSON, so that it is enough to do the diagnosis again."""
    kept = [
        {"effect": h.effect, "probability": h.probability, "accepted": h.accepted}
        for h in diagnosis.hypotheses
    ]
    return json.dumps(
        plain({"verdict": diagnosis.verdict, "hypotheses": kept, "redo": diagnosis.redo}),
        ensure_ascii=False,
    )


def read(path: Path, data: Path | None = None) -> Record:
    """A diagnosis whose recordings lie in the folder `data`, or beside it.

    Raises CommandError where the file is neither the JSON nor the report of one.
    """
    if path.exists() and not path.is_file():
        raise CommandError(f"{path}: found no regular file; expected a diagnosis to redo", USAGE)

    try:
        with path.open(encoding="utf-8") as stream:
            text = stream.read(MOST_BYTES)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "no text"
        raise CommandError(
            f"{path}: found {reason.lower()}; expected a diagnosis to redo", USAGE
        ) from None

    embedded = ELEMENT.search(text)
    try:
        return Record.parsed(
            json.loads(html.unescape(embedded[1]) if embedded else text), data or path.parent
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        expected = "the JSON or the report that gritd diagnose wrote"
        raise CommandError(f"{path}: found no diagnosis; expected {expected}", USAGE) from None


def check(record: Record) -> None:
    """Raises CommandError for the first file that is missing or not the one that was diagnosed."""
    for path, expected in {**record.files, **record.known}.items():
        if not _lies_in(record.folder, path):
            raise CommandError(
                f"{path}: found no such file there; expected the recording that was diagnosed"
                " (--data says where they are)",
                USAGE,
            )

        if sha256(path) != expected:
            raise CommandError(
                f"{path}: found another file; expected the recording that was diagnosed, by its"
                " SHA-256",
                DAMAGED,
            )


def changed_versions(then: Record) -> list[str]:
    """What computes otherwise than then, in words."""
    return metadata.changed_versions(then.versions)


def differences(then: Record, now: Record) -> Iterator[str]:
    """Of verdict, accepted effects and probabilities, in words."""
    if then.verdict != now.verdict:
        yield f"verdict {now.verdict}, then {then.verdict}"
    if set(then.accepted) != set(now.accepted):
        yield f"accepted {_names(now.accepted)}, then {_names(then.accepted)}"
    for name, before in then.probability.items():
        if abs(now.probability.get(name, 0.0) - before) > ALIKE:
            yield f"{name} {now.probability.get(name, 0.0):.2f} probable, then {before:.2f}"


def _names(effects: Sequence[str]) -> str:
    return ", ".join(effects) or "no effect"
