"""Where a proof works: a folder of its own, the public data beside it, and the commands that a user
would type.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gritd.tools.cli.command import CommandError

ROOT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True)
class DiagnosisRun:
    """What one diagnosis printed, and its JSON."""

    command: str
    text: str
    result: dict[str, Any]
    seconds: float

    @property
    def accepted(self) -> dict[str, dict[str, Any]]:
        """Accepted effects by name, most probable first."""
        return {h["effect"]: h for h in self.result["hypotheses"] if h["accepted"]}

    def values(self, effect: str) -> dict[str, float]:
        """Parameters of an accepted effect; empty if it was not accepted."""
        accepted = self.accepted.get(effect)
        return {name: q["value"] for name, q in accepted["parameters"].items()} if accepted else {}

    @property
    def group(self) -> set[str]:
        """Accepted effects, and what the diagnosis says it cannot tell from them."""
        return {
            n for name, h in self.accepted.items() for n in (name, *h["indistinguishable_from"])
        }


@dataclass
class CommandBench:
    """Runs commands in `folder`; `data` holds the public files, a folder a rig."""

    data: Path
    folder: Path
    step: Callable[[str], None] = lambda _: None
    commands: list[str] = field(default_factory=list)

    def imported(self, importer: str, name: str, *arguments: str, files: Sequence[str]) -> Path:
        """Recordings and configuration in folder/name, from files and folders of the data."""
        self.step(f"importing {name}")
        paths = [str(self.data / file) for file in files]
        self._gritd("import", importer, *paths, "-o", str(self.folder / name), *arguments)
        return self.folder / name

    def diagnosis(
        self,
        recordings: Sequence[Path],
        configuration: Path,
        name: str,
        reference: Sequence[Path] = (),
    ) -> DiagnosisRun:
        """One diagnosis, in a process that is given these files alone. Raises CommandError."""
        self.step(f"diagnosing {name}")
        result = self.folder / f"{name}.json"
        began = time.monotonic()

        given = [str(p.relative_to(self.folder)) for p in sorted(recordings)]
        if reference:
            given += ["--reference", *(str(p.relative_to(self.folder)) for p in sorted(reference))]
        given += ["--config", str(configuration.relative_to(self.folder))]
        outputs = ("--json", result.name, "--apply", f"{name}.yaml")

        printed = self._gritd("diagnose", *given, *outputs, "--jobs", "1")
        read = json.loads(result.read_text(encoding="utf-8"))
        return DiagnosisRun(self.commands[-1], printed.rstrip(), read, time.monotonic() - began)

    def _gritd(self, *arguments: str) -> str:
        """What the command printed. Raises CommandError with its one line."""
        shown = (a.replace(f"{self.data}/", "").replace(f"{self.folder}/", "") for a in arguments)
        self.commands.append("gritd " + " ".join(shown))

        done = subprocess.run(
            [sys.executable, "-m", "gritd", *arguments],
            cwd=self.folder, env=_environment(), capture_output=True, text=True, check=False,
        )  # fmt: skip

        if done.returncode:
            raise CommandError(
                f"{self.commands[-1]}: exit {done.returncode}: "
                f"{done.stderr.strip() or 'nothing said'}"
            )

        return done.stdout


def _environment() -> dict[str, str]:
    """Ours without what could tell, and one thread a process."""
    kept = {
        k: v
        for k, v in os.environ.items()
        if k in ("PATH", "HOME", "LANG", "LC_ALL", "TMPDIR", "VIRTUAL_ENV")
    }

    return kept | {
        "PYTHONPATH": str(ROOT),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "PYTHONUTF8": "1",
    }
