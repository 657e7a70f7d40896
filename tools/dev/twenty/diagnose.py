"""`twenty diagnose`: the result of every campaign, and what it took."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gritd.tools.dev.twenty.process import environment

TIMES = "times.json"
PROGRESS = ".progress"  # what is said on the way: it follows the clock


@dataclass(frozen=True)
class Spent:
    """What a diagnosis took [s], and its exit code."""

    wall_s: float
    cpu_s: float
    exit: int


def diagnose(folder: Path, out: Path, gritd: Path, jobs: int, only: Sequence[str]) -> int:
    """OUT/NAME.json, what was printed (.txt), and what was said on the way (.progress). 1 if one
    could not be diagnosed.
    """
    campaigns = [f for f in sorted(folder.iterdir()) if f.is_dir() and (not only or f.name in only)]
    if missing := set(only) - {f.name for f in campaigns}:
        raise SystemExit(f"{folder}: found no campaign {', '.join(sorted(missing))}")
    out.mkdir(parents=True, exist_ok=True)

    # Threads only wait here: each diagnosis is a process of its own.
    with ThreadPoolExecutor(jobs) as pool:
        spent = list(pool.map(lambda f: _diagnosed(f, out.resolve(), gritd), campaigns))

    _write_times(out / TIMES, {f.name: vars(s) for f, s in zip(campaigns, spent, strict=True)})
    for campaign, took in zip(campaigns, spent, strict=True):
        print(_row(out / f"{campaign.name}.json", took))
    print(f"{len(spent)} campaigns, {sum(s.cpu_s for s in spent):.0f} s of processor time")
    return int(any(s.exit for s in spent))


def _diagnosed(campaign: Path, out: Path, gritd: Path) -> Spent:
    """One diagnosis, in the campaign's folder: its JSON holds the paths as they were given."""
    files = [path.name for path in sorted(campaign.glob("*.mcap"))]
    (configuration,) = campaign.glob("*.yaml")
    result = out / f"{campaign.name}.json"
    result.unlink(missing_ok=True)
    settled = ["--config", configuration.name, "--seed", "0", "--jobs", "1"]
    command = [str(gritd), "diagnose", *files, *settled, "--json", str(result)]

    began = time.monotonic()
    text, progress = (out / f"{campaign.name}{end}" for end in (".txt", PROGRESS))
    with text.open("wb") as printed, progress.open("wb") as rest:
        process = subprocess.Popen(
            command, cwd=campaign, env=environment(), stdout=printed, stderr=rest
        )
        _, status, used = os.wait4(process.pid, 0)

    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.monotonic() - began
    return Spent(round(wall, 2), round(used.ru_utime + used.ru_stime, 2), process.returncode)


def _write_times(path: Path, times: Mapping[str, Any]) -> None:
    """Beside those of campaigns that were not diagnosed this time."""
    before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    text = json.dumps({**before, **times}, indent=1, sort_keys=True)
    path.write_text(text + "\n", encoding="utf-8")


def _row(result: Path, took: Spent) -> str:
    """Name, verdict, what was accepted (else what is most probable), seconds."""
    head = f"{result.stem:26} {took.wall_s:6.1f} s  "
    if not result.exists():
        return f"{head}exit {took.exit}, no result"
    diagnosis = json.loads(result.read_text(encoding="utf-8"))
    first = [h for h in diagnosis["hypotheses"] if h["accepted"]] or diagnosis["hypotheses"][:2]
    names = ", ".join(f"{h['effect']} {h['probability']:.2f}" for h in first)
    return f"{head}{diagnosis['verdict']:13} {names}"
