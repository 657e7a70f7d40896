"""docs/reliability.md from what the scenarios measure: `python -m gritd.tools.dev.reliability
[--quick] [--jobs J]`.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from gritd.tools.cli.command import DONE, FAILED, Parser, whole

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reliability.md"
BEGIN = "<!-- from here on written by `python -m gritd.tools.dev.reliability` -->\n"
FIGURES = "GRITD_FIGURES"  # as in tests/scenarios/conftest.py

# The list of faults, each of which must leave a figure.
ROWS = (
    "device unplugged and back",
    "serial garbage, bad CRC, truncated frame",
    "encoder rollover",
    "encoder counter jump",
    "stuck sensor",
    "NaN, Inf, out of range",
    "wall-clock step",
    "duplicate, late or reordered stamps",
    "CAN error frame or failing bus",
    "hostile CAN or UDP datagram",
    "bus flood",
    "queue overflow",
    "disk full",
    "log folder read-only",
    "kill -9 while logging",
    "power cut while logging",
    "SIGTERM",
    "SIGHUP with bad YAML",
    "YAML bomb, unsafe tag, duplicate key, 1e3 as text, no as false, NaN",
    "hostile or huge recording",
    "recording with flipped bits",
    "wheel in the air",
    "zero slip",
    "negative slip, reverse driving",
    "stall (100 % slip)",
    "θ₁ → 0, f → 0",
    "filter divergence",
    "CPU starvation",
    "a thread dies",
    "garbage-collector pause",
    "second instance",
    "unprivileged user",
    "one wrong stamp of a device clock",
    "step of a device clock",
    "random histories of a device clock",
    "wall clock in 1901, 1970, 2040, 2200, 2603",
    "message that cannot be written",
    "recording that unpacks to a thousand times its size",
    "last reading a day, fifty years later",
    "sparse file of 9 GB, 4 GB of memory",
    "import of packed text",
    "hostile checkpoints",
    "empty attachments, tiny chunks",
    "300 and 500 MB of address space",
    "hostile worker behind --scheduler",
    "terminal escapes in names",
    "names that lead out of the folder",
    "symlinked lock, FIFO, killed parent",
    "world-writable configuration, readable recordings",
    "links and folders named like recordings",
    "chunks swapped or duplicated",
    "file of 8 bytes",
    "metadata and configuration of impossible numbers",
    "YAML cut at every byte",
    "step, ramp or patch of the soil",
    "a filter out of its depth",
    "second daemon on a socket, too many readers",
    "silence, garbage, counter jumps, a stopped process",
    "ten crashes in a minute",
    "every allocation of the hot path fails once",
    "encoder silent while its counter wraps",
    "random counter of the wheel",
    "sensor frozen but for its last digit",
    "second daemon on a port of the first",
    "chunks in reverse order",
    "names and notes that are no UTF-8",
    "JSON nested 100,000 deep",
    "wire logs of impossible times",
    "DBC with impossible numbers, a pipe, a device",
    "a file that is no DBC",
    "recover of a cut recording",
    "bed file that cannot be, or of another time",
    "write error in the middle of a part",
    "log folder removed during a run",
    "recovery of the log",
)

Figure = dict[str, Any]


def main(argv: Sequence[str] | None = None) -> int:
    """Run every scenario and write the page. Exit 1 if one fails or a fault is missing, without a
    page, or if a figure is above its limit.
    """
    parser = Parser(
        prog="python -m gritd.tools.dev.reliability",
        description="Run the scenarios and write docs/reliability.md.",
    )
    parser.add_argument("--quick", action="store_true", help="without the long ones")
    parser.add_argument(
        "--jobs", type=whole(1, 64), default=1, metavar="J", help="scenarios side by side"
    )
    parser.add_argument(
        "--figures", metavar="FILE", help="write the page from figures measured before"
    )

    arguments = parser.parse_args(argv)
    if arguments.figures:
        return _write(Path(arguments.figures))

    with tempfile.TemporaryDirectory() as folder:
        figures = Path(folder) / "figures.jsonl"
        began = time.monotonic()
        if _run(figures, arguments.quick, arguments.jobs):
            return FAILED

        print(f"all scenarios in {time.monotonic() - began:.0f} s")
        return _write(figures)


def _write(path: Path) -> int:
    """The page from collected figures; the exit code."""
    figures = _read(path)
    missing = [row for row in ROWS if row not in {figure["row"] for figure in figures}]
    if missing:
        print(
            f"no figure for: {'; '.join(missing)}. Skipped? The page is left as it is.",
            file=sys.stderr,
        )
        return FAILED

    PAGE.write_text(page(figures), encoding="utf-8")
    above = [figure for figure in figures if _above(figure)]
    for f in above:
        print(
            f"{f['row']}: {f['name']}: {f['value']:.3g} {f['unit']}, limit {f['limit']:g}",
            file=sys.stderr,
        )

    return FAILED if above else DONE


def _run(figures: Path, quick: bool, jobs: int) -> int:
    chosen = "not slow" if quick else "slow or not slow"
    side_by_side = ["-n", str(jobs), "--dist", "worksteal"] if jobs > 1 else []
    command = [
        sys.executable,
        "-m",
        "pytest",
        "--quiet",
        "-rs",
        "-m",
        chosen,
        *side_by_side,
        str(ROOT / "tests" / "scenarios"),
    ]

    return subprocess.run(
        command, env={**os.environ, FIGURES: str(figures)}, cwd=ROOT, check=False
    ).returncode


def _read(path: Path) -> list[Figure]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def page(figures: Sequence[Figure]) -> str:
    """The page: its hand-written head, then one row for each fault and thing measured."""
    head = PAGE.read_text(encoding="utf-8").partition(BEGIN)[0]
    return head + BEGIN + "\n".join(["", *_circumstances(figures), "", *_table(figures)]) + "\n"


def _circumstances(figures: Sequence[Figure]) -> Iterator[str]:
    loads = [figure["load"] for figure in figures]
    yield (
        f"Measured on {os.cpu_count()} cores with a load average of "
        f"{statistics.median(loads):.1f} (median; largest"
        f" {max(loads):.1f}); what is above its limit stands in bold."
    )


def _above(figure: Figure) -> bool:
    return figure["limit"] is not None and figure["value"] > figure["limit"]


def _table(figures: Sequence[Figure]) -> Iterator[str]:
    yield "| fault | measured | worst | limit | runs | on |"
    yield "|---|---|---|---|---|---|"
    groups: dict[tuple[str, str, str], list[Figure]] = {}
    for figure in figures:
        groups.setdefault((figure["row"], figure["name"], figure["level"]), []).append(figure)

    for row, name, level in sorted(groups, key=lambda key: key[0].lower()):
        runs = groups[row, name, level]
        worst, limit, unit = max(f["value"] for f in runs), runs[0]["limit"], runs[0]["unit"]
        bound, shown = (
            "" if limit is None else f"{limit:g} {unit}".strip(),
            f"{worst:.3g} {unit}".strip(),
        )

        shown = f"**{shown}**" if any(map(_above, runs)) else shown
        yield f"| {row} | {name} | {shown} | {bound} | {len(runs)} | {level} |".replace("  ", " ")


if __name__ == "__main__":
    sys.exit(main())
