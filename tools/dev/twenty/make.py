"""`twenty make`: every campaign in a folder of its own."""

from __future__ import annotations

import random
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from gritd.tools.dev.twenty.campaigns import (
    EFFECTS,
    PRIOR,
    REAL,
    SIMULATED,
    TESTBED,
    WRENCH,
    Edits,
    Real,
    Simulated,
)
from gritd.tools.dev.twenty.process import environment


def make(folder: Path, gritd: Path, real: Path | None) -> int:
    """Every campaign in a folder of its own: its recordings and one configuration."""
    for number, simulated in enumerate(SIMULATED, start=1):
        _simulate(_new(folder / simulated.name), simulated, number, gritd)
        print(f"{simulated.name}: {len(simulated.runs)} simulated runs", flush=True)

    for imported in REAL if real else ():
        assert real is not None
        count = _import(_new(folder / imported.name), imported, real, gritd)
        print(f"{imported.name}: {count} imported runs", flush=True)
    return 0


def _new(folder: Path) -> Path:
    if folder.exists():
        raise SystemExit(f"{folder}: found a campaign; expected none, so that none is half of two")
    folder.mkdir(parents=True)
    return folder


def _simulate(folder: Path, campaign: Simulated, number: int, gritd: Path) -> None:
    """The world's configuration, schedules and truth go to a folder that no diagnosis reads."""
    truth = folder / "truth"
    truth.mkdir()
    world = truth / "world.yaml"
    world.write_text(_configuration(campaign, campaign.world), encoding="utf-8")
    configured = _configuration(campaign, campaign.configured)
    (folder / "testbed.yaml").write_text(configured, encoding="utf-8")

    soil = _soil(number)
    for n, run in enumerate(campaign.runs, start=1):
        schedule, recording = truth / f"run-{n}.schedule.yaml", truth / f"run-{n}.mcap"
        schedule.write_text(run.schedule, encoding="utf-8")
        acting = [a for effect in (*campaign.effects, *run.effects) for a in ("--effect", effect)]
        seed = ["--seed", str(100 * number + n)]
        where = ["--config", world.name, "--schedule", schedule.name, "-o", recording.name]
        _call([str(gritd), "simulate", *where, *soil, *acting, *seed], truth)
        recording.rename(folder / recording.name)


def _configuration(campaign: Simulated, edits: Edits) -> str:
    text = TESTBED + WRENCH * campaign.wrench + EFFECTS * campaign.linearised
    for old, new in edits:
        if old not in text:
            raise SystemExit(f"{campaign.name}: found no '{old}' to edit")
        text = text.replace(old, new)
    return text


def _soil(number: int) -> list[str]:
    """Arguments of a soil off what is configured, of its own in each campaign."""
    drawn = random.Random(number)
    values = {name: mean + sigma * drawn.gauss(0.0, 1.0) for name, (mean, sigma) in PRIOR.items()}
    return [a for name, value in values.items() for a in ("--soil", f"{name}={value:.6g}")]


def _import(folder: Path, campaign: Real, real: Path, gritd: Path) -> int:
    """How many recordings there are."""
    imported = folder / "imported"
    files = [str(real.resolve() / file) for file in campaign.files]
    command = [str(gritd), "import", campaign.importer, *files, "-o", imported.name]
    _call([*command, *campaign.arguments], folder)

    recordings = sorted(imported.glob(campaign.recordings))
    for path in (*recordings, imported / campaign.configuration):
        path.rename(folder / path.name)
    shutil.rmtree(imported)
    return len(recordings)


def _call(command: Sequence[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, env=environment(), capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: exit {done.returncode}: {done.stderr.strip()}")
