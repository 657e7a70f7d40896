"""What the daemon does and why, in words: the first thing that the page says."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from gritd.estimator.messages.status import Status
from gritd.tools.cli.wording import listed
from gritd.tools.service.client import Report
from gritd.tools.service.wording import disagreement

GOOD, WAIT, BAD = "good", "wait", "bad"  # how the page colours it

SENTENCES = {
    Status.STARTING: (
        WAIT,
        "Starting",
        "Not every channel that is needed has filled a window yet.",
    ),
    Status.TRACKING: (GOOD, "Tracking the soil", "Every window updates c and tan φ."),
    Status.STALE: (BAD, "A channel is silent", "The filter waits for it and keeps its estimate."),
    Status.STUCK: (BAD, "A channel is stuck", "It stands still while the others move."),
    Status.IN_AIR: (WAIT, "Wheel in the air", "No load or no sinkage: nothing touches the soil."),
    Status.STANDSTILL: (WAIT, "Standstill", "Neither wheel nor carriage moves."),
    Status.STALL: (WAIT, "Stalled", "The wheel digs without travel, or is blocked under current."),
    Status.REVERSE: (WAIT, "Reverse", "The wheel goes back over soil that it has compacted."),
    Status.BRAKING: (WAIT, "Braking", "The carriage pushes the wheel: the equations do not hold."),
    Status.UNCERTAIN: (
        WAIT,
        "Not certain enough",
        "Slip or entry angle are not known well enough to be worth an update.",
    ),
    Status.UNSTEADY: (
        WAIT,
        "Unsteady motion",
        "Speed, load or sinkage changes between windows; the equations hold in steady motion.",
    ),
    Status.AT_BOUND: (
        BAD,
        "Estimate not believed",
        "It stands at a bound that the prior calls improbable.",
    ),
    Status.DIVERGED: (
        BAD,
        "Estimate not believed",
        "Its σ was set back again and again, or is wider than the prior's.",
    ),
    Status.MISMATCH: (
        BAD,
        "Estimate not believed",
        "Neither one soil nor a change of it explains what is measured.",
    ),
}


class Headline(NamedTuple):
    """State, reason, and what else must be known."""

    tone: str
    title: str
    reason: str
    notes: tuple[str, ...]


def headline(report: Report) -> Headline:
    """Of a report; one that is not the daemon's raises as Python does."""
    tone, title, reason = SENTENCES[Status[report["status"]]]
    if report["hanging"]:
        tone, title, reason = BAD, "A thread hangs", f"It is {report['hanging']}."
    elif report.get("unfed"):
        tone, title = BAD, "The filter is not fed"
        reason = f"For more than a second: {report['unfed']}."

    return Headline(tone, title, reason, tuple(_notes(report)))


def _notes(report: Report) -> Iterator[str]:
    flags = report["flags"]
    silent = [name.replace("_", " ") for name, state in report["channels"].items() if state != "ok"]
    if silent:
        yield f"Silent or stuck: {listed(silent)}."

    for name, device in report["devices"].items():
        if device["state"] != "OPEN":
            yield f"Device {name} is {device['state'].lower()}: {device['last_error']}"
    if report["log"]["state"] != "writing":
        yield f"The log is {report['log']['state']}: {report['log']['error']}"

    if found := report.get("disagreement"):
        yield f"The model {disagreement(found)}."
    yield from _of_the_estimate(flags)


def _of_the_estimate(flags: list[str]) -> Iterator[str]:
    if "PRIOR" in flags:
        yield "c, tan φ and k are the stated prior: the filter's own estimate is not believed."
    elif "NOT_SEPARABLE" in flags:
        yield "c and tan φ cannot be distinguished yet, only their joint effect: vary the load."
    if "CHANGED" in flags:
        yield "The soil changed in the last seconds: σ was widened, c and tan φ move."
    if "LOAD_ASSUMED" in flags:
        yield "The load is the configured one, not a measurement."
