"""The table of docs/proof.md on what `--apply` carries over: `python -m gritd.tools.dev.applied
[NAME ...]`.

Three runs in which physics is concealed are diagnosed and applied; three runs with the same, other
slips and loads on the same soil are compared with what was written, and diagnosed with it.
"""

from __future__ import annotations

import io
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.tools.cli.command import DONE, Parser
from gritd.tools.commands import diagnose, simulate
from gritd.tools.commands.compare import compare
from gritd.tools.diagnose.explain.result import Trace

CONCEALED = {
    "effect": ("coulomb_friction.loss=0.25",),
    "family": (
        "contact_relaxation.forces=1",
        "contact_relaxation.sinkage=1",
        "contact_relaxation.length=0.06",
    ),
    "two effects": ("coulomb_friction.loss=0.25", "slip_sinkage.deepening=0.5"),
    "law": ("empirical_law.torque_slip=-0.6", "empirical_law.torque_slip_squared=1.5"),
    "pair": ("coulomb_friction.loss=0.25", "bed_slope.angle=0.04"),
}
USUAL = {"pair": ("coulomb_friction.loss=0.25",)}  # what a reference has too
CHANNELS = ("torque", "drawbar_pull", "sinkage")
FIRST = ((35.0, 50.0, 65.0), (0.05, 0.15, 0.25, 0.35, 0.5))  # loads [N], slips
THEN = ((42.0, 58.0, 70.0), (0.1, 0.2, 0.3, 0.4, 0.45))


def main(argv: Sequence[str] | None = None) -> int:
    """Prints the rows of a table in Markdown."""
    parser = Parser(prog="python -m gritd.tools.dev.applied", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="rows; default: all")
    names = parser.parse_args(argv).names or list(CONCEALED)
    for name in (name for name in names if name not in CONCEALED):
        parser.error(f"{name}: expected one of {', '.join(CONCEALED)}")
    print("| concealed | found | then | " + " | ".join(CHANNELS) + " |")
    print("|---|---|---|---|---|---|")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            print("| " + " | ".join(_row(name, Path(folder))) + " |", flush=True)
    return DONE


def _row(name: str, folder: Path) -> Iterator[str]:
    concealed, written = CONCEALED[name], folder / "new.yaml"
    first = _runs(folder / "first", FIRST, 1, concealed)
    then = _runs(folder / "then", THEN, 11, concealed)
    options = ["--apply", str(written)]
    if usual := USUAL.get(name):
        before = _runs(folder / "before", FIRST, 21, usual)
        options += ["--reference", *map(str, before), "--bed", "same"]

    yield name
    yield _said(_diagnosed(first, packaged(), options, folder))
    yield _said(_diagnosed(then, written, [], folder))
    errors = [_errors(then, path) for path in (packaged(), written)]
    for channel in CHANNELS:
        yield " → ".join(f"{one[channel][0]:.2g}" for one in errors) + (
            f" (noise {errors[1][channel][1]:.2g})"
        )


def _runs(
    folder: Path,
    plan: tuple[Sequence[float], Sequence[float]],
    seed: int,
    effects: Sequence[str],
) -> list[Path]:
    """Recordings of one run a load [N], of all slips each, by `gritd simulate`."""
    folder.mkdir()
    files, options = [], [part for effect in effects for part in ("--effect", effect)]
    for number, load in enumerate(plan[0]):
        slips = (*plan[1][number:], *plan[1][:number])
        stretches = [(2, slips[0], 0), *((6, slip, (20, 30, 15)[number]) for slip in slips)]
        schedule = folder / f"{number}.yaml"
        schedule.write_text(
            "segments:\n"
            + "".join(
                f"  - {{duration: {t} s, load: {load} N, slip: {slip}, speed: {speed} mm/s}}\n"
                for t, slip, speed in stretches
            ),
            encoding="utf-8",
        )
        files.append(folder / f"run-{number + 1}.mcap")
        driven = ["--schedule", str(schedule), "--seed", str(seed + number)]
        with redirect_stdout(io.StringIO()):
            simulate.main([*driven, *options, "-o", str(files[-1])])
    return files


def _diagnosed(
    files: Sequence[Path], configuration: Path, options: Sequence[str], folder: Path
) -> dict[str, object]:
    """The JSON of `gritd diagnose`."""
    result = folder / "result.json"
    given = [*map(str, files), "--config", str(configuration), "--json", str(result)]
    with redirect_stdout(io.StringIO()):
        diagnose.main([*given, *options])
    found: dict[str, object] = json.loads(result.read_text(encoding="utf-8"))
    return found


def _said(found: dict[str, object]) -> str:
    """The verdict, and the effects that were accepted."""
    every: list[dict[str, object]] = found["hypotheses"]  # type: ignore[assignment]
    names = [f"`{h['effect']}`" for h in every if h["accepted"]]
    return ", ".join([str(found["verdict"]), *names])


def _errors(files: Sequence[Path], configuration: Path) -> dict[str, tuple[float, float]]:
    """Of each channel the root mean square error of `gritd compare`, and the noise."""
    traces = compare(files, config.load(configuration), fitted=False).traces
    return {channel: _of([t for t in traces if t.channel == channel]) for channel in CHANNELS}


def _of(traces: Sequence[Trace]) -> tuple[float, float]:
    off = [np.subtract(t.measured, t.before)[np.array(t.used, bool)] for t in traces]
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2))), traces[0].sigma


if __name__ == "__main__":
    sys.exit(main())
