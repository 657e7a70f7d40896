"""docs/reliability.md from what the scenarios measure: `python -m gritd.tools.dev.reliability
[--quick] [--jobs J]`.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from gritd.tools.cli.command import DONE, FAILED, Parser, whole
from gritd.tools.dev.attack import ROOT, Figure, above, modules_of, read, run
from gritd.tools.dev.faults import FAULTS

PAGE = ROOT / "docs" / "reliability.md"
BEGIN = "<!-- from here on written by `python -m gritd.tools.dev.reliability` -->\n"


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
        modules = modules_of(ROOT, FAULTS)
        if run(figures, modules, sys.executable, ROOT, arguments.quick, arguments.jobs):
            return FAILED

        print(f"all scenarios in {time.monotonic() - began:.0f} s")
        return _write(figures)


def _write(path: Path) -> int:
    """The page from collected figures; the exit code."""
    figures = read(path)
    measured = {figure["row"] for figure in figures}
    missing = [fault.name for fault in FAULTS if fault.name not in measured]
    if missing:
        print(
            f"no figure for: {'; '.join(missing)}. Skipped? The page is left as it is.",
            file=sys.stderr,
        )
        return FAILED

    PAGE.write_text(page(figures), encoding="utf-8")
    above = [figure for figure in figures if above(figure)]
    for f in above:
        print(
            f"{f['row']}: {f['name']}: {f['value']:.3g} {f['unit']}, limit {f['limit']:g}",
            file=sys.stderr,
        )

    return FAILED if above else DONE


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

        shown = f"**{shown}**" if any(map(above, runs)) else shown
        yield f"| {row} | {name} | {shown} | {bound} | {len(runs)} | {level} |".replace("  ", " ")


if __name__ == "__main__":
    sys.exit(main())
