"""`gritd bench`: what a tick, a replay, a force, a filter update and a message cost here."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gritd.estimator.config.settings import ENGINES
from gritd.tools.bench.measure import Figures, Sizes, measure
from gritd.tools.cli.command import DONE, Parser


def main(argv: Sequence[str]) -> int:
    """Measure and print. Exit 0."""
    parser = Parser(
        prog="gritd bench",
        description="What everything costs on this machine; about half a minute.",
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON, SI units")

    arguments = parser.parse_args(argv)
    with TemporaryDirectory(prefix="gritd-bench-") as folder:
        figures = measure(Sizes(), Path(folder))

    if arguments.json:
        print(json.dumps({"machine": machine(), **figures}, indent=2))
    else:
        print(report(figures))

    return DONE


def machine() -> dict[str, str | int | float]:
    """What this was measured on, and how busy it was."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "load_average": round(os.getloadavg()[0], 2),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
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

    return "\n".join(
        [
            f"machine    {on['processor']}, {on['cores']} cores, load {on['load_average']}, "
            f"{on['system']}, Python {on['python']}, numpy {on['numpy']}",
            f"tick       {_µs(t['median'])} at 50 %, {_µs(t['at_99_percent'])} at 99 %: "
            f"{t['share_of_budget']:.1%} of its period",
            *(
                f"replay     {name}: {r[f'{name}_speed']:.0f} times real time from file to "
                f"estimates, best {r[f'{name}_best']:.0f}"
                for name in ENGINES
            ),
            f"forces     closed forms with gradients {_µs(f['closed_form'])}, "
            f"quadrature {_µs(f['quadrature'])}: ratio {f['ratio']:.1f}",
            f"           one sample of a batch, forces only: {_µs(f['closed_form_in_batch'])}, "
            f"quadrature {_µs(f['quadrature_in_batch'])}: "
            f"ratio {f['ratio_in_batch']:.1f}",
            f"update     filterpy {_µs(u['filterpy'])}, plain {_µs(u['plain'])}: "
            f"ratio {u['ratio']:.1f} ({u['nuisances']:.0f} nuisances)",
            f"recording  a message: write {_µs(m['write'])}, "
            f"read as arrays {_µs(m['read_as_arrays'])}, "
            f"one by one {_µs(m['read_one_by_one'])}, {m['bytes']:.0f} bytes",
            f"simulator  {w['speed']:.0f} times real time, "
            f"with six effects {w['speed_with_six_effects']:.0f}",
            f"balance    a sample {_µs(w['balance'])}, brentq on adaptive quadrature "
            f"{_µs(w['balance_by_brentq'])}: ratio {w['balance_ratio']:.0f}",
            "processor time, medians where not said otherwise",
        ]
    )


def _µs(seconds: float) -> str:
    return f"{seconds * 1e6:.3g} µs"
