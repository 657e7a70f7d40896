"""`gritd monitor`: the running daemon in a terminal, through its status socket."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import degrees
from typing import Any

from tools.command import DONE, Parser
from tools.status import Report, add_socket, connected, reports

EVERY = 0.2  # [s] between pictures
HOME, CLEAR_BELOW, CLEAR_LINE = "\033[H", "\033[J", "\033[K"

# what is shown of a tick: label, value, sigma, factor, unit, decimals
SHOWN = (
    ("c", "cohesion", "cohesion_sigma", 1.0, "Pa", 0),
    ("tan φ", "tan_phi", "tan_phi_sigma", 1.0, "", 4),
    ("k", "shear_modulus", "shear_modulus_sigma", 1e3, "mm", 1),
    ("slip", "slip", "slip_sigma", 100.0, "%", 1),
    ("sinkage", "sinkage", "sinkage_sigma", 1e3, "mm", 2),
    ("θ₁", "theta_1", "theta_1_sigma", degrees(1.0), "°", 2),
    ("load", "load", "load_sigma", 1.0, "N", 2),
    ("torque", "torque", "torque_sigma", 1.0, "N·m", 3),
    ("pull", "drawbar_pull", "drawbar_pull_sigma", 1.0, "N", 2),
)


def main(argv: Sequence[str]) -> int:
    """Show the daemon until Ctrl-C, or once; raises CommandError where none answers."""
    parser = Parser(prog="gritd monitor", description="Watch the running daemon; Ctrl-C ends it.")
    add_socket(parser)
    parser.add_argument("--once", action="store_true", help="one picture, without control characters")
    arguments = parser.parse_args(argv)
    with connected(arguments.socket) as connection:
        if arguments.once or not sys.stdout.isatty():
            print("\n".join(lines(next(reports(connection)))))
            return DONE
        with screen() as show:
            shown = 0.0
            for report in reports(connection):
                if time.monotonic() - shown >= EVERY:
                    shown = time.monotonic()
                    show(report)
    return DONE


@contextmanager
def screen() -> Iterator[Callable[[Report], None]]:
    """A picture that is redrawn in place: by rich where it is installed, by plain control characters otherwise."""
    try:
        from rich.live import Live
        from rich.text import Text
    except ImportError:
        print(HOME + CLEAR_BELOW, end="")
        yield _redraw
        return
    with Live(screen=True, auto_refresh=False) as live:
        yield lambda report: live.update(Text("\n".join(lines(report))), refresh=True)


def _redraw(report: Report) -> None:
    size = os.get_terminal_size()
    kept = [line[: size.columns - 1] for line in lines(report)][: size.lines - 1]
    print(HOME + "".join(f"{line}{CLEAR_LINE}\n" for line in kept) + CLEAR_BELOW, end="", flush=True)


def lines(report: Report) -> Iterator[str]:
    """The picture: estimates with σ, how far to believe them, channels, devices, loop and log."""
    tick, loop, log = report["tick"], report["loop"], report["log"]
    yield f"gritd {report['pid']}  up {report['uptime']:.0f} s  {report['configuration']}"
    yield f"{report['status']}  {' '.join(report['flags'])}".rstrip()
    yield ""
    yield from (_quantity(tick, *shown) for shown in SHOWN) if tick else ()
    yield ""
    if tick:
        yield (
            f"separability  {_number(tick['separability'], 1.0, 3)}  (1: nothing learnt of the weakest direction yet)"
            f"   consistency {_number(tick['consistency'], 1.0, 2)}  (1 when honest)"
        )
        yield f"filter        {tick['updates']} updates, {tick['resets']} resets"
        yield (
            f"readings      {tick['late']} late, {tick['duplicates']} duplicates, {tick['invalid']} invalid,"
            f" {tick['jumps']} encoder jumps"
        )
    yield "channels      " + "  ".join(f"{name} {state}" for name, state in report["channels"].items())
    yield from (_device(name, stats) for name, stats in report["devices"].items())
    yield f"loop          {loop['ticks']} ticks, {loop.get('missed', 0)} missed, late {_lateness(loop)}"
    yield (
        f"queue         {report['queue']['queued']} waiting, {report['queue']['dropped']} dropped"
        f"   real time: {report['real_time']}"
    )
    yield f"log           {log['state']}, {log['queued']} waiting, {log['dropped']} dropped, part {log['files']}"
    yield f"              {log['file']}  {log['error']}".rstrip()
    if report["hanging"]:
        yield f"HANGING       {report['hanging']}"


def _quantity(tick: Report, label: str, name: str, sigma: str, factor: float, unit: str, decimals: int) -> str:
    value, spread = (_number(tick.get(key), factor, decimals) for key in (name, sigma))
    return f"{label:10}{value:>12} ± {spread:<10} {unit}".rstrip()


def _number(value: Any, factor: float, decimals: int) -> str:
    return "–" if value is None else f"{value * factor:.{decimals}f}"


def _device(name: str, stats: Report) -> str:
    line = (
        f"{name:13} {stats['state']}, {stats['rate']:.0f} readings/s, {stats['bad']} bad, {stats['lost']} lost,"
        f" {stats['errors']} bus errors, reopened {stats['reopened']}"
    )
    return line if stats["state"] == "OPEN" else f"{line}  {stats['last_error']}"


def _lateness(loop: Report) -> str:
    names = (("late_50", "50 %"), ("late_99", "99 %"), ("late_999", "99.9 %"), ("late_max", "max"))
    return ", ".join(f"{loop[key] * 1e3:.2f} ms ({label})" for key, label in names if key in loop)
