"""`gritd bench`: what a tick, a replay, a force, a filter update, a message and a start cost here,
compared with what others take for the same.
"""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gritd.estimator.compiled import arithmetic
from gritd.estimator.config.settings import ENGINES
from gritd.tools.bench.compare import comparison, loaded, ratios
from gritd.tools.bench.measure import LONG, BenchSizes, Figures, measure
from gritd.tools.cli.command import DONE, FAILED, Parser


def main(argv: Sequence[str]) -> int:
    """Measure and print. Exit 0; 1 where a ratio is worse by a fifth than in an earlier run."""
    arguments = build_parser().parse_args(argv)
    before = loaded(arguments.compare) if arguments.compare else {}
    with TemporaryDirectory(prefix="gritd-bench-") as folder:
        figures = measure(LONG if arguments.long else BenchSizes(), Path(folder))

    if arguments.json:
        print(json.dumps({"machine": machine(), **figures}, indent=2))
    else:
        print(report(figures))

    lines, failed = comparison(before, ratios(figures))
    for line in lines:
        print(line, file=sys.stderr if arguments.json else sys.stdout)
    return FAILED if failed else DONE


def machine() -> dict[str, str | int | float]:
    """What this was measured on, and how busy it was."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "load_average": round(os.getloadavg()[0], 2),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "arithmetic": "compiled" if arithmetic.BUILT else "in Python",
    }


def _processor() -> str:
    """The model by /proc/cpuinfo; the architecture where there is none."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    return next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")),
        platform.machine(),
    )


def report(figures: dict[str, Figures]) -> str:
    """One line a figure, in units for people."""
    on, t, r, f = machine(), figures["tick"], figures["replay"], figures["forces"]
    u, m, w = figures["update"], figures["recording"], figures["forward_model"]
    s = figures["start"]

    return "\n".join(
        [
            f"machine    {on['processor']}, {on['cores']} cores, load {on['load_average']}, "
            f"{on['system']}, Python {on['python']}, numpy {on['numpy']}, "
            f"arithmetic {on['arithmetic']}",
            f"tick       {_µs(t['median'])} at 50 %, {_µs(t['at_99_percent'])} at 99 %: "
            f"{t['share_of_budget']:.1%} of its period; {_µs(t['at_99.9_percent'])} at 99.9 %, "
            f"worst {_µs(t['worst'])}",
            f"           20,000 products and sums of floats take {_µs(t['plain_loop'])}, "
            f"{t['over_plain_loop']:.1f} median ticks",
            *(
                f"replay     {name}: {r[f'{name}_speed']:.0f} times real time from file to "
                f"estimates, best {r[f'{name}_best']:.0f}"
                for name in (*ENGINES, "with_ticks")
            ),
            *_long_replay(figures.get("long_replay", {})),
            f"forces     closed forms with gradients {_µs(f['closed_form'])}, "
            f"quadrature {_µs(f['quadrature'])}: ratio {f['ratio']:.1f}",
            f"           one sample of a batch, forces only: {_µs(f['closed_form_in_batch'])}, "
            f"quadrature {_µs(f['quadrature_in_batch'])}: "
            f"ratio {f['ratio_in_batch']:.1f}",
            f"update     filterpy {_µs(u['filterpy'])}, plain {_µs(u['plain'])}: "
            f"ratio {u['ratio']:.1f} ({u['nuisances']:.0f} errors and the soil); filterpy alone "
            f"{_µs(u['filterpy_alone'])}: ratio {u['over_filterpy_alone']:.1f}",
            f"recording  a message: write {_µs(m['write'])}, "
            f"read as arrays {_µs(m['read_as_arrays'])}, "
            f"one by one {_µs(m['read_one_by_one'])}, {m['bytes']:.0f} bytes",
            *_side_by_side("reading", figures["reading"]),
            *_side_by_side("writing", figures["writing"]),
            *(
                f"start      {name}: {s[f'{name}_seconds']:.2f} s of processor time to the first "
                f"tick, {s[f'{name}_memory'] / 1e6:.0f} MB"
                for name in ENGINES
            ),
            *_live("live", figures["live"]),
            *_side_by_side("its file", figures["reading_live"]),
            *_live("live 1 kHz", figures.get("live_at_1_khz", {})),
            f"simulator  {w['speed']:.0f} times real time, "
            f"with six effects {w['speed_with_six_effects']:.0f}",
            f"balance    a sample {_µs(w['balance'])}, brentq on adaptive quadrature "
            f"{_µs(w['balance_by_brentq'])}: ratio {w['balance_ratio']:.0f}; on 8 nodes a zone "
            f"{_µs(w['balance_by_brentq_on_8_nodes'])}: "
            f"ratio {w['balance_ratio_to_8_nodes']:.0f}",
            *_diagnosis(figures.get("diagnosis", {})),
            "processor time, medians where not said otherwise; live is by the wall clock",
        ]
    )


def _long_replay(figures: Figures) -> list[str]:
    if not figures:
        return []
    return [
        f"           {figures['seconds']:.0f} s with ticks: {figures['speed']:.0f} times real "
        f"time; reading {figures['reading']:.2f} s, filter {figures['filter']:.2f} s"
    ]


def _live(title: str, figures: Figures) -> list[str]:
    """When it is there, what it takes, how punctual it is."""
    if not figures:
        return []

    spans = [
        f"{name} {_µs(figures[f'{name}_median'])} at 50 %, {_µs(figures[f'{name}_at_99_percent'])} "
        f"at 99 %, worst {_µs(figures[f'{name}_worst'])}"
        for name in ("lateness", "duration")
    ]

    return [
        f"{title:11}first tick {figures['first_tick']:.2f} s, first estimate "
        f"{figures['first_estimate']:.2f} s after the command; "
        f"{figures['share_of_a_core']:.0%} of a core, {figures['share_at_work']:.0%} once started, "
        f"{figures['memory'] / 1e6:.0f} MB",
        f"           a tick's {'; '.join(spans)}",
        f"           {figures['missed']:.0f} missed of "
        f"{figures['ticks'] + figures['missed']:.0f}, "
        f"{figures['missed_at_work']:.0f} of them once started",
        f"           a loop that only sleeps beside it: late {_µs(figures['control_median'])} at "
        f"50 %, {_µs(figures['control_at_99_percent'])} at 99 %, worst "
        f"{_µs(figures['control_worst'])}; of the missed {figures['missed_by_both']:.0f} when it, "
        "too, was late by a period",
    ]


def _diagnosis(figures: Figures) -> list[str]:
    """A line for each size, and the exponents."""
    if not figures:
        return []

    sizes = [name.removesuffix("_seconds") for name in figures if name.endswith("_seconds")]
    return [
        *(
            f"diagnosis  {size.replace('_', ' ')}: {figures[f'{size}_seconds']:.1f} s, "
            f"{figures[f'{size}_memory'] / 1e6:.0f} MB"
            for size in sizes
        ),
        *(
            f"diagnosis  {name.removesuffix('_elapsed').replace('_', ' ')}: {seconds:.1f} s by the "
            "wall clock"
            for name, seconds in figures.items()
            if name.endswith("_elapsed")
        ),
        f"           time goes with runs^{figures['exponent_of_runs']:.2f}, "
        f"length^{figures['exponent_of_length']:.2f}",
    ]


def _side_by_side(title: str, figures: Figures) -> list[str]:
    """A line for each program: median, span, ratio to gritd."""
    lines = []
    for name in (key.removesuffix("_best") for key in figures if key.endswith("_best")):
        over = figures.get(f"over_{name}")
        ratio = f": ratio {over:.1f}" if over else ""
        span = f"{_µs(figures[f'{name}_best'])} to {_µs(figures[f'{name}_worst'])}"
        lines.append(f"{title:11}{name}: a message {_µs(figures[name])} ({span}){ratio}")
    return lines


def _µs(seconds: float) -> str:
    return f"{seconds * 1e6:.3g} µs"


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd bench",
        description="What everything costs on this machine, and what others take for the same; "
        "two or three minutes.",
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON, SI units")

    parser.add_argument(
        "--compare",
        type=Path,
        metavar="OLD.json",
        help="fail where a ratio is worse by a fifth than in this output of --json",
    )

    parser.add_argument(
        "--long",
        action="store_true",
        help="also a minute at 1 kHz, an hour's replay, and diagnoses of several runs and of long "
        "ones: a quarter of an hour",
    )

    return parser
