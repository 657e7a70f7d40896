"""What recordings show at their own rate alone, beside the answers.

    gritd prove --seal-only --keep --output BATCH …
    python -m gritd.tools.dev.full_rate BATCH…
    python -m gritd.tools.dev.full_rate --nulls N

A batch: lines and sure latencies of each case, the new campaign's alone, and what was concealed.
Nulls: campaigns of our own simulator in which nothing acts; how many have a line.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.tools.diagnose.orders.lines import Line
from gritd.tools.diagnose.rig.full_rate import beside_lines, with_lines
from gritd.tools.diagnose.rig.latencies import latencies_in
from gritd.tools.diagnose.rig.signals import read_all, signals
from gritd.tools.proof.ours.cases import GRID, draw, record_fully


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("batches", nargs="*", type=Path, metavar="BATCH")
    parser.add_argument("--nulls", type=int, default=0, metavar="N")
    given = parser.parse_args()

    for batch in given.batches:
        for answers in sorted((batch / "answers").glob("case-*.json")):
            for row in of_case(batch, answers):
                print(row, flush=True)
    if given.nulls:
        with_line = sum(bool(lines_of_nothing(seed)) for seed in range(given.nulls))
        print(f"{given.nulls} campaigns with nothing in them: {with_line} have a line")


def of_case(batch: Path, answers: Path) -> Iterator[str]:
    """Rows of one case."""
    truth: Any = json.loads(answers.read_text(encoding="utf-8"))["answers"]
    truth = json.loads(truth) if isinstance(truth, str) else truth
    held = [h for h in truth["world_habits"] if h.get("order")]
    concealed = [c for c in (*truth["concealed"], *held) if c.get("order") or c.get("count")]
    true = ", ".join(f"{c['form']} {c.get('order', c.get('count'))}" for c in concealed)
    effects = ", ".join(truth["effects"]) or "nothing"
    yield f"{answers.stem}: {effects} in world {truth['world']}; ripples: {true or 'none'}"

    folder = batch / "cases" / answers.stem / "given"
    settings = config.load(folder / "testbed.yaml").settings
    own = folder / "new" if (folder / "new").is_dir() else folder
    recordings = read_all(sorted(own.glob("*.mcap")))
    means = [signals(recording, settings, GRID) for recording in recordings]
    for line in with_lines(recordings, means, settings, 0)[1].new:
        yield f"    {_told(line)}"
    for late in latencies_in(recordings, means, settings):
        if late.sure:
            yield f"    {late.channel} late by {late.delay:.3f} ± {late.delay_sigma:.3f} s"


def _told(line: Line) -> str:
    unit = "a turn" if line.axis == "angle" else "Hz"
    harmonic = f", harmonic of {line.harmonic:.2f}" if line.harmonic else ""
    size = f"{line.size:.4g} ± {line.size_sigma:.1g}"
    place = f"{line.channel} {line.at:.3f} ± {line.sigma:.3f} {unit}"
    return f"{place}: {size}, p {line.p:.1g}{harmonic}"


def lines_of_nothing(seed: int) -> tuple[Line, ...]:
    """Of a drawn campaign in which no effect acts."""
    settings = replace(config.load(packaged()).settings, effects=())
    made = record_fully(draw(settings, np.random.default_rng((seed, 99))), ())
    reads = [lambda full=full: full for _, full in made]
    return beside_lines([s for s, _ in made], reads, 1.0)[1].new


if __name__ == "__main__":
    with np.errstate(all="ignore"):
        main()
