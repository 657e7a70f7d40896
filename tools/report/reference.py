"""The reference campaign of `gritd diagnose --reference`: recordings, or what an earlier diagnosis
wrote.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.cli.wording import percent
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.rig.signals import sha256
from gritd.tools.diagnose.rig.wheel import Bed

WELL = 0.9  # share of the new campaign that must be covered for nothing to be reported of it


@dataclass(frozen=True)
class Given:
    """Recordings of a campaign in which nothing is new; verdict: of its own diagnosis, if known."""

    files: tuple[Path, ...] = ()
    bed: Bed = "prepared"
    verdict: str | None = None

    def kept(self, hashes: Mapping[str, str]) -> dict[str, Any]:
        """What doing the diagnosis again needs."""
        if not self.files:
            return {}
        files = {str(path): hashes[str(path)] for path in self.files}
        return {"reference": {"files": files, "bed": self.bed}}


NONE = Given()


def given(paths: Sequence[Path], bed: Bed) -> Given:
    """From the command line. Raises CommandError where an earlier diagnosis cannot be read."""
    files: list[Path] = []
    verdicts: list[str] = []
    for path in paths:
        if path.suffix == ".json":
            earlier = _earlier(path)
            files += [_recorded(path, *each) for each in earlier["redo"]["files"].items()]
            verdicts.append(str(earlier["verdict"]))
        else:
            files.append(path)

    return Given(tuple(files), bed, verdicts[0] if len(verdicts) == 1 else None)


def again(redo: Mapping[str, Any]) -> Given:
    """From what a diagnosis kept."""
    kept = redo.get("reference")
    if not kept:
        return NONE
    return Given(tuple(Path(name) for name in kept["files"]), kept["bed"])


def with_reference(diagnosis: Diagnosis, reference: Given) -> Diagnosis:
    """The result with what it was held against, and what of it lies outside."""
    assert diagnosis.reference is not None
    files = tuple(str(path) for path in reference.files)
    verdict = reference.verdict or diagnosis.reference.verdict
    kept = replace(diagnosis.reference, files=files, bed=reference.bed, verdict=verdict)
    caveats = diagnosis.caveats

    if kept.covered < WELL:
        caveats = (
            *caveats,
            f"{percent(kept.covered)} of the new campaign lies where the reference was driven;"
            f" outside: {kept.outside}. What is said of the rest is less certain.",
        )
    return replace(diagnosis, reference=kept, caveats=caveats)


def _earlier(path: Path) -> Mapping[str, Any]:
    try:
        diagnosis = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(diagnosis["redo"]["files"], dict) or not isinstance(
            diagnosis["verdict"], str
        ):
            raise KeyError("redo.files")
    except FileNotFoundError:
        raise CommandError(f"{path}: found no such file; expected a reference", USAGE) from None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise CommandError(
            f"{path}: found no diagnosis; expected recordings or the JSON of `gritd diagnose`",
            DAMAGED,
        ) from None

    return diagnosis  # type: ignore[no-any-return]


def _recorded(path: Path, name: str, digest: str) -> Path:
    """A recording that a diagnosis names: as it is, or in the folder of its JSON. Raises
    CommandError where it is missing, or another one by its SHA-256.
    """
    next_to_it = path.parent / Path(name).name
    recording = Path(name) if Path(name).exists() else next_to_it
    if not recording.exists():
        places = " nor ".join(dict.fromkeys((name, str(next_to_it))))
        reason = f"found no {places}; expected a recording that it diagnosed"
        raise CommandError(f"{path}: {reason}", USAGE)

    if sha256(recording) != str(digest):
        reason = f"found another {recording}; expected the one that it diagnosed, by its SHA-256"
        raise CommandError(f"{path}: {reason}", DAMAGED)

    return recording
