"""`gritd monitor`: the running daemon in a terminal, through its status socket."""

from __future__ import annotations

import os
import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from gritd.tools.cli.command import DONE, Parser
from gritd.tools.cli.terminal import control
from gritd.tools.cli.wording import honesty
from gritd.tools.service.client import Report, add_socket, connected, in_lines, reports
from gritd.tools.service.wording import SHOWN, age, disagreement

EVERY = 0.2  # [s] between pictures
OPEN, CLOSE = (
    "\033[?1049h\033[?25l",
    "\033[?25h\033[?1049l",
)  # a screen of its own without a cursor, and back
HOME, CLEAR_BELOW, CLEAR_LINE = "\033[H", "\033[J", "\033[K"
BOLD, PLAIN = "\033[1m", "\033[m"
LEAVE = "q"
TROUBLE = "!"  # begins a line that is shown in bold
INDENT = " " * 14


def main(argv: Sequence[str]) -> int:
    """Show the daemon until q or Ctrl-C, or once; raises CommandError where none answers."""
    arguments = build_parser().parse_args(argv)

    with connected(arguments.socket) as connection:
        if arguments.once or not redrawable():
            print("\n".join(in_lines(lines, next(reports(connection)))))
            return DONE

        with screen() as show, keys() as pressed:
            shown = 0.0
            for report in reports(connection):
                if pressed() == LEAVE:
                    break
                if time.monotonic() - shown >= EVERY:
                    shown = time.monotonic()
                    show(report)

    return DONE


# --- the terminal ---


def redrawable() -> bool:
    """Whether standard output is a terminal that knows control characters."""
    return sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"


@contextmanager
def keys() -> Iterator[Callable[[], str]]:
    """What gives the key that was pressed last, '' for none. Where standard input is no terminal
    there is none.
    """
    if sys.stdin is None or not sys.stdin.isatty():
        yield lambda: ""
        return

    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)  # keys come at once and are not shown; Ctrl-C stays what it is
    try:
        yield _pressed
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _pressed() -> str:
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return os.read(sys.stdin.fileno(), 64).decode(errors="replace")[-1:] if ready else ""


@contextmanager
def screen() -> Iterator[Callable[[Report], None]]:
    """A picture that is redrawn in place; the terminal is left as it was found."""
    out = control(sys.stdout)
    print(OPEN, end="", file=out, flush=True)
    try:
        yield _redraw
    finally:
        print(CLOSE, end="", file=out, flush=True)


def _redraw(report: Report) -> None:
    size = os.get_terminal_size()
    kept = [_fitting(line, size.columns) for line in in_lines(lines, report)][: size.lines]
    picture = HOME + f"{CLEAR_LINE}\n".join(kept) + CLEAR_LINE + CLEAR_BELOW
    print(picture, end="", file=control(sys.stdout), flush=True)


def _fitting(line: str, columns: int) -> str:
    """Cut to the width of the terminal, and in bold where it tells of trouble."""
    cut = line if len(line) <= columns else line[: columns - 1] + "…"
    return f"{BOLD}{cut}{PLAIN}" if line.startswith(TROUBLE) else cut


# --- the picture ---


def lines(report: Report) -> Iterator[str]:
    """The picture, trouble first: estimates with σ, how far to believe them, channels, devices,
    loop and log.

    Without trouble it fits into a terminal of 80 by 24.
    """
    tick = report["tick"]
    yield (
        f"gritd {report['pid']}, up {age(report['uptime'])}: "
        f"{report['status']} {' '.join(report['flags'])}"
    ).rstrip()
    yield from _trouble(report)
    yield f"{report['configuration']}"
    yield ""

    if tick:
        yield from (_quantity(tick, *shown) for shown in SHOWN)
        yield from _belief(tick)

    yield from _channels(report["channels"])
    yield from (_device(name, stats) for name, stats in report["devices"].items())
    yield from _loop_and_log(report)


def _trouble(report: Report) -> Iterator[str]:
    if report["hanging"]:
        yield f"{TROUBLE} hanging: {report['hanging']}"
    if unfed := report.get("unfed"):
        yield f"{TROUBLE} the filter has not been fed for a second: {unfed}"

    for name, stats in report["devices"].items():
        if stats["state"] != "OPEN":
            yield f"{TROUBLE} {name} {stats['state']} {stats['last_error']}".rstrip()
        if hint := stats.get("hint"):
            yield f"{TROUBLE} {name}: {hint}"

    if report["log"]["state"] != "writing":
        yield f"{TROUBLE} log {report['log']['state']} {report['log']['error']}".rstrip()
    if disagreeing := report.get("disagreement"):
        yield f"{TROUBLE} model {disagreement(disagreeing)}"

    if "PRIOR" in report["flags"]:
        yield f"{TROUBLE} c, tan φ and k are the prior: the filter's estimate is not believed"


def _quantity(
    tick: Report, label: str, name: str, sigma: str, factor: float, unit: str, decimals: int
) -> str:
    value, spread = (_number(tick.get(key), factor, decimals) for key in (name, sigma))
    return f"{label:10}{value:>12} ± {spread:<10} {unit}".rstrip()


def _belief(tick: Report) -> Iterator[str]:
    """How far to believe the estimates."""
    separability = _number(tick["separability"], 1.0, 3)
    yield f"separability  {separability}  (1: the weakest direction is as unknown as at the start)"

    yield (
        f"consistency   {_number(tick['consistency'], 1.0, 2)}  {honesty(tick['consistency'])}"
        f"  {tick['updates']} updates, {tick['resets']} resets"
    )

    yield (
        f"readings      {tick['late']} late, {tick['duplicates']} duplicates, "
        f"{tick['invalid']} invalid, {tick['jumps']} jumps"
    )


def _channels(channels: Report) -> Iterator[str]:
    words = [f"{name} {state}" for name, state in channels.items()]
    for start in range(0, len(words), 3):
        yield f"{'' if start else 'channels':14}" + "  ".join(words[start : start + 3])


def _device(name: str, stats: Report) -> str:
    return (
        f"{name:13} {stats['state']}, {stats['rate']:.0f}/s, {stats['bad']} bad, "
        f"{stats['lost']} lost, {stats['errors']} bus errors, {stats['reopened']} reopenings"
    )


def _loop_and_log(report: Report) -> Iterator[str]:
    loop, log, queue = report["loop"], report["log"], report["queue"]
    yield (
        f"loop          {loop['ticks']} ticks, {loop.get('missed', 0)} missed, real time: "
        f"{report['real_time']}"
    )

    yield f"late, ms      {_lateness(loop)}"
    yield (
        f"queue         {queue['queued']} waiting, {queue['dropped']} dropped"
        f"   log  {log['queued']} waiting, {log['dropped']} dropped, part {log['files']}"
    )
    yield f"{INDENT}{log['file']}"


def _number(value: Any, factor: float, decimals: int) -> str:
    return "–" if value is None else f"{value * factor:.{decimals}f}"


def _lateness(loop: Report) -> str:
    names = (("late_50", "50 %"), ("late_99", "99 %"), ("late_999", "99.9 %"), ("late_max", "max"))
    return ", ".join(f"{loop[key] * 1e3:.2f} ({label})" for key, label in names if key in loop)


def build_parser() -> Parser:
    parser = Parser(prog="gritd monitor", description="Watch the running daemon; q ends it.")
    add_socket(parser)
    parser.add_argument(
        "--once", action="store_true", help="one picture, without control characters"
    )

    return parser
