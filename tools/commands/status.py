"""`gritd status`: one report of the running daemon, for people, for scripts (--json) or for
Prometheus.
"""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Iterator, Sequence
from typing import Any

from gritd.tools.cli.command import DONE, FAILED, Parser
from gritd.tools.service.client import Report, add_socket, connected, in_lines, reports
from gritd.tools.service.wording import disagreement

# metric -> (type, help, path in the report)
METRICS = {
    "gritd_ticks_total": ("counter", "ticks of the loop", "loop.ticks"),
    "gritd_ticks_missed_total": ("counter", "ticks missed", "loop.missed"),
    "gritd_tick_lateness_seconds": ("gauge", "lateness of the last tick", "loop.lateness"),
    "gritd_readings_total": ("counter", "readings received by the queue", "queue.received"),
    "gritd_readings_dropped_total": ("counter", "readings the queue dropped", "queue.dropped"),
    "gritd_log_written_total": ("counter", "messages written", "log.written"),
    "gritd_log_dropped_total": ("counter", "messages the log dropped", "log.dropped"),
    "gritd_log_queued": ("gauge", "messages waiting for the disk", "log.queued"),
    "gritd_healthy": ("gauge", "1 while the filter is fed and no thread hangs", "healthy"),
    "gritd_cohesion_pascals": ("gauge", "cohesion c", "tick.cohesion"),
    "gritd_cohesion_sigma_pascals": ("gauge", "its standard deviation", "tick.cohesion_sigma"),
    "gritd_tan_phi": ("gauge", "tangent of the internal friction angle", "tick.tan_phi"),
    "gritd_tan_phi_sigma": ("gauge", "its standard deviation", "tick.tan_phi_sigma"),
    "gritd_filter_updates_total": ("counter", "filter updates applied", "tick.updates"),
    "gritd_filter_consistency": (
        "gauge",
        "mean normalised innovation squared, 1 when honest",
        "tick.consistency",
    ),
    "gritd_model_disagrees_sigmas": (
        "gauge",
        "size of the innovations while model and measurement disagree",
        "disagreement.sigmas",
    ),
    "gritd_filter_resets_total": ("counter", "covariance resets", "tick.resets"),
    "gritd_late_total": ("counter", "readings older than the horizon", "tick.late"),
    "gritd_duplicates_total": ("counter", "readings that came twice", "tick.duplicates"),
    "gritd_jumps_total": ("counter", "encoder jumps", "tick.jumps"),
    "gritd_invalid_total": ("counter", "readings out of range", "tick.invalid"),
}
PER_DEVICE = ("readings", "frames", "bad", "lost", "errors", "quarantined", "reopened")


def main(argv: Sequence[str]) -> int:
    """Exit 0 where a healthy daemon answers; 1 where none does, one of its threads hangs, or the
    filter has not been fed for a second.
    """
    arguments = build_parser().parse_args(argv)
    with connected(arguments.socket) as connection:
        report = next(reports(connection))
    print(_text(arguments, report), flush=True)
    return DONE if report["healthy"] else FAILED


def build_parser() -> Parser:
    parser = Parser(prog="gritd status", description="One report of the running daemon.")
    add_socket(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        "--json", action="store_true", help="everything, as one JSON object in SI units"
    )
    form.add_argument(
        "--prometheus", action="store_true", help="counters and estimates in Prometheus text form"
    )
    return parser


def _text(arguments: Namespace, report: Report) -> str:
    if arguments.json:
        return json.dumps(report, indent=2)
    return "\n".join(in_lines(prometheus if arguments.prometheus else summary, report))


# --- the forms ---


def looked_up(report: Report, path: str) -> Any:
    """A value of the report by its dotted path; None where there is none."""
    value: Any = report
    for key in path.split("."):
        value = value.get(key) if isinstance(value, dict) else None
    return value


def prometheus(report: Report) -> Iterator[str]:
    """Text exposition format 0.0.4."""
    for name, (kind, text, path) in METRICS.items():
        value = looked_up(report, path)
        if value is not None:
            yield from (f"# HELP {name} {text}", f"# TYPE {name} {kind}", f"{name} {_value(value)}")
    for counter in PER_DEVICE:
        name = f"gritd_device_{counter}_total"
        yield from (f"# HELP {name} {counter} of a device", f"# TYPE {name} counter")
        for device, stats in report["devices"].items():
            yield f'{name}{{device="{_label(device)}"}} {_value(stats[counter])}'


def _value(value: float) -> str:
    """The shortest digits that read back as the same number."""
    return repr(float(value)).removesuffix(".0")


def _label(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def prior_note(report: Report) -> str:
    """That the soil shown is the stated one, where the filter's own is not believed."""
    return "  (the prior: the filter's estimate is not believed)" * ("PRIOR" in report["flags"])


def summary(report: Report) -> Iterator[str]:
    """A few lines for people."""
    tick, loop, log = report["tick"], report["loop"], report["log"]
    yield f"gritd {report['pid']}: {report['status']} {' '.join(report['flags'])}".rstrip()

    if tick:
        note = prior_note(report)
        yield f"  c        {tick['cohesion']:.0f} ± {tick['cohesion_sigma']:.0f} Pa{note}"
        yield f"  tan φ    {tick['tan_phi']:.4f} ± {tick['tan_phi_sigma']:.4f}"
    if unfed := report.get("unfed"):
        yield f"  filter   has not been fed for a second: {unfed}"
    if disagreeing := report.get("disagreement"):
        yield f"  model    {disagreement(disagreeing)}"

    yield (
        f"  loop     {loop['ticks']} ticks, {loop.get('missed', 0)} missed, real time: "
        f"{report['real_time']}"
    )
    if (arithmetic := report.get("arithmetic", "compiled")) != "compiled":
        yield f"  compute  {arithmetic}"
    if notice := report.get("wall_clock"):
        yield f"  clock    {notice}"

    for name, stats in report["devices"].items():
        yield (
            f"  {name:8} {stats['state']}, {stats['rate']:.0f} readings/s, {stats['bad']} bad, "
            f"{stats['lost']} lost"
        )

    yield (
        f"  log      {log['state']}, {log['dropped']} dropped, {log['file']} {log['error']}"
    ).rstrip()
    if report["hanging"]:
        yield f"  hanging  {report['hanging']}"
