"""One trial: draw and seal the answers, hand over recordings and configuration, have them diagnosed
elsewhere.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import gritd
from gritd.tools.cli.offspring import ends_with_us
from gritd.tools.proof.blind import cases, handover, seal
from gritd.tools.proof.blind.strata import Assignment

ROOT = Path(gritd.__file__).parents[1]  # of the checkout, or site-packages
DIAGNOSE = (sys.executable, "-m", "gritd", "diagnose")
PATIENCE = 1200.0  # [s] after which a diagnosis is given up and counts as failed
GIVEN, RESULT, OUTCOME = "given", "result.json", "outcome.json"
ALONE = "alone-"  # folder of the same campaign with one of several effects, by its number


@dataclass(frozen=True)
class WorkerSpec:
    """What a worker needs to know. The folder must be one that all workers see."""

    number: int
    seed: int
    assignment: Assignment
    output: str
    keep: bool = False  # the recordings, after the diagnosis
    diagnose: tuple[str, ...] = DIAGNOSE

    @property
    def name(self) -> str:
        return f"case-{self.number:04d}"

    @property
    def folder(self) -> Path:
        return Path(self.output) / "cases" / self.name

    @property
    def alone(self) -> list[Path]:
        """Folders of the same campaign with each of two effects alone."""
        effects = self.assignment.effects
        many = len(effects) if len(effects) > 1 else 0
        return [self.folder / f"{ALONE}{number + 1}" for number in range(many)]

    @property
    def answers(self) -> Path:
        return Path(self.output) / "answers" / f"{self.name}.json"

    @property
    def seal(self) -> Path:
        return self.folder / "seal.txt"

    @property
    def done(self) -> bool:
        return (self.folder / OUTCOME).exists()


def prepare(spec: WorkerSpec) -> str:
    """Draw the case, write what is handed over, seal the answers; returns the seal. A finished step
    is not redone.
    """
    if spec.seal.exists():
        return spec.seal.read_text(encoding="utf-8").strip()

    shutil.rmtree(spec.folder, ignore_errors=True)
    case = cases.drawn(spec.number, spec.seed, spec.assignment)
    campaigns = handover.driven(case)
    handover.write(case, campaigns, spec.folder / GIVEN)
    for one, folder in zip(case.alone(), spec.alone, strict=True):
        handover.write(one, handover.driven(one), folder / GIVEN)

    sealed = seal.close(spec.answers, case.answers(), _truth(spec, campaigns[-1]))
    spec.seal.write_text(sealed + "\n", encoding="utf-8")
    return sealed


def _truth(spec: WorkerSpec, judged: handover.DrivenCampaign) -> dict[str, str]:
    """The noiseless channels, beside the answers; hashes by file name."""
    spec.answers.parent.mkdir(parents=True, exist_ok=True)
    hashes = {}
    for number in range(len(judged.felt)):
        path = spec.answers.with_name(f"{spec.name}.{judged.name(number)}.npz")
        np.savez_compressed(path, **handover.truth(judged, number))  # type: ignore[arg-type]
        hashes[path.name] = seal.sha256(path)
    return hashes


def diagnose(spec: WorkerSpec) -> dict[str, Any]:
    """Run the diagnosis in a process of its own, in a folder that holds nothing but what was handed
    over; of two effects, each alone first.
    """
    for folder in spec.alone:
        _run(_command(spec, folder), folder / GIVEN)
    began = time.monotonic()
    code, stderr = _run(_command(spec, spec.folder), spec.folder / GIVEN)
    outcome = {"code": code, "seconds": time.monotonic() - began, "said": stderr[-2000:]}
    (spec.folder / OUTCOME).write_text(json.dumps(outcome, indent=1), encoding="utf-8")

    if not spec.keep:
        for path in spec.folder.rglob("*.mcap"):
            path.unlink()
    return outcome


def _command(spec: WorkerSpec, folder: Path) -> list[str]:
    """What an engineer would type in the folder of what was handed over."""
    given, result = folder / GIVEN, str((folder / RESULT).resolve())
    options = ["--config", handover.CONFIGURATION, "--json", result]
    options += ["--jobs", "1"]  # cases run side by side
    if not spec.assignment.pair:
        return [*spec.diagnose, *_recordings(given), *options]
    options += ["--bed", spec.assignment.bed]
    before = ["--reference", *_recordings(given, handover.REFERENCE)]
    return [*spec.diagnose, *_recordings(given, handover.NEW), *before, *options]


def _recordings(given: Path, folder: str = "") -> list[str]:
    return sorted(str(path.relative_to(given)) for path in (given / folder).glob("*.mcap"))


def _run(command: list[str], folder: Path) -> tuple[int, str]:
    """Exit code and what was said on standard error; -1 after PATIENCE."""
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=_environment(),
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
            preexec_fn=ends_with_us(),
        )
    except subprocess.TimeoutExpired:
        return -1, f"no answer within {PATIENCE:g} s"

    return done.returncode, done.stderr


def _environment() -> dict[str, str]:
    """Nothing of ours but where the code is; one thread for linear algebra, for cases run side by
    side.
    """
    kept = {
        name: value
        for name, value in os.environ.items()
        if name in ("PATH", "HOME", "LANG", "TMPDIR")
    }
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    return kept | threads | {"PYTHONPATH": str(ROOT)}
