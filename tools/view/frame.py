"""What the page shows of one moment: words, values with σ, two pictures, and the daemon's state."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import degrees, isfinite
from typing import Any

import numpy as np

from gritd.estimator.terramechanics.soil import Wheel
from gritd.estimator.visible import visible
from gritd.tools.cli.wording import NOTHING, fixed, honesty
from gritd.tools.service.client import Report
from gritd.tools.service.wording import SHOWN, ShownValue, age
from gritd.tools.view.charts import BAND
from gritd.tools.view.rim import rim
from gritd.tools.view.words import headline

# what a channel is called, and the σ of its window's mean: field, factor, unit, decimals
CHANNELS = {
    "wheel_encoder": ("wheel encoder", "wheel_speed_sigma", degrees(1.0), "°/s", 3),
    "carriage_encoder": ("carriage encoder", "carriage_speed_sigma", 1e3, "mm/s", 3),
    "sinkage_pot": ("sinkage potentiometer", "sinkage_sigma", 1e3, "mm", 3),
    "motor_shunt": ("motor current", "torque_sigma", 1.0, "N·m", 3),
    "wrench": ("force/torque sensor", "drawbar_pull_sigma", 1.0, "N", 2),
    "motor_temperature": ("motor temperature", "", 1.0, "°C", 1),
}
PULL = ShownValue("largest pull", "drawbar_pull_max", "drawbar_pull_max_sigma", 1.0, "N", 2)
SOIL = 3  # of SHOWN, what is learnt


@dataclass(frozen=True)
class Setup:
    """What does not change from tick to tick."""

    wheel: Wheel | None = None
    prior: Mapping[str, tuple[float, float]] | None = None  # value, σ [SI]
    run: str = ""
    testbed: str = ""

    @classmethod
    def of_report(cls, report: Report) -> Setup:
        """Of a daemon; an older one tells nothing."""
        setup = report.get("setup")
        if not setup:
            return cls()
        prior = {name: (known["value"], known["sigma"]) for name, known in setup["prior"].items()}
        wheel = Wheel(**{name: float(value) for name, value in setup["wheel"].items()})
        return cls(wheel, prior, visible(setup["run"]), visible(setup["testbed"]))


def moment(tick: Mapping[str, Any], setup: Setup) -> dict[str, Any]:
    """Of a tick: values in words and both pictures."""
    return {
        "values": [_value(tick, shown) for shown in (*SHOWN[:SOIL], PULL, *SHOWN[SOIL:])]
        if tick
        else [],
        "trust": _trust(tick) if tick else [],
        "ellipse": _ellipse(tick),
        "rim": rim(setup.wheel, tick) if setup.wheel else None,
    }


def frame(report: Report, setup: Setup) -> dict[str, Any]:
    """Of a report of the daemon; one that is not the daemon's raises as Python does."""
    words = headline(report)
    return {
        **moment(report["tick"], setup),
        "headline": {**words._asdict(), "notes": [visible(note) for note in words.notes]},
        "status": report["status"],
        "flags": report["flags"],
        "sequence": report["tick"].get("sequence"),
        "about": _about(report, setup),
        "channels": list(_channels(report)),
        "devices": [_device(name, stats) for name, stats in report["devices"].items()],
        "loop": list(_loop(report)),
        "log": list(_log(report["log"])),
    }


def _value(tick: Mapping[str, Any], shown: ShownValue) -> dict[str, str]:
    return {
        "label": shown.label,
        "value": _number(tick.get(shown.value), shown.factor, shown.decimals),
        "sigma": _number(tick.get(shown.sigma), shown.factor, shown.decimals),
        "unit": shown.unit,
    }


def _number(value: object, factor: float, decimals: int) -> str:
    if not isinstance(value, int | float) or not isfinite(value):
        return NOTHING
    return fixed(value * factor, decimals)


def _trust(tick: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        ("innovations", f"{_number(tick['consistency'], 1.0, 2)}, {honesty(tick['consistency'])}"),
        (
            "separability",
            f"{_number(tick['separability'], 1.0, 3)} (1: as unknown as at the start)",
        ),
        ("updates", f"{tick['updates']}, {tick['resets']} resets"),
    ]


def _ellipse(tick: Mapping[str, Any]) -> dict[str, float] | None:
    """Centre and half axes of 2σ of (c, tan φ) as two vectors: (a, b) of c [Pa], (d, e) of tan φ.
    Their sum turned round by an angle draws the ellipse.
    """
    names = ("cohesion", "tan_phi", "cohesion_sigma", "tan_phi_sigma", "cov_c_tan_phi")
    values = [tick.get(name) for name in names]
    if not all(isinstance(v, int | float) and isfinite(v) for v in values):
        return None
    c, tan_phi, sigma_c, sigma_t, together = (float(v) for v in values if v is not None)
    rho = float(np.clip(together / max(sigma_c * sigma_t, 1e-300), -1.0, 1.0))

    return {
        "c": c,
        "tan_phi": tan_phi,
        "ax": BAND * sigma_c,
        "ay": BAND * sigma_t * rho,
        "by": BAND * sigma_t * (1.0 - rho * rho) ** 0.5,
    }


def _about(report: Report, setup: Setup) -> str:
    """Testbed and run in a line."""
    heads = (setup.testbed, setup.run and f"run {setup.run}", f"up {age(report['uptime'])}")
    return " · ".join(filter(None, heads))


def _channels(report: Report) -> Iterable[dict[str, Any]]:
    sensors, tick = report.get("sensors", {}), report["tick"]
    for name, state in report["channels"].items():
        label, sigma, factor, unit, decimals = CHANNELS.get(name, (name, "", 1.0, "", 1))
        seen = sensors.get(name, {})
        noise = _number(tick.get(sigma), factor, decimals)

        yield {
            "name": label,
            "state": state,
            "rate": _with_unit(_number(seen.get("rate"), 1.0, 0), "/s"),
            "age": _with_unit(_number(seen.get("age"), 1e3, 0), "ms"),
            "noise": _with_unit(noise, unit),
        }


def _with_unit(number: str, unit: str) -> str:
    return number if number == NOTHING else f"{number} {unit}"


def _device(name: str, stats: Mapping[str, Any]) -> dict[str, str]:
    return {
        "name": visible(name),
        "state": stats["state"].lower(),
        "rate": f"{stats['rate']:.0f} /s",
        "faults": f"{stats['bad']} bad, {stats['lost']} lost, {stats['errors']} bus errors",
        "error": visible(stats["last_error"]),
    }


def _loop(report: Report) -> Iterable[tuple[str, str]]:
    loop, queue = report["loop"], report["queue"]
    yield "ticks", f"{loop['ticks']}, {loop.get('missed', 0)} missed"
    if "late_50" in loop:
        late = [f"{loop[key] * 1e3:.2f}" for key in ("late_50", "late_99", "late_max")]
        yield "late by", f"{late[0]} ms (half), {late[1]} ms (99 %), {late[2]} ms (most) in 10 s"

    yield "real time", report["real_time"]
    yield "queue", f"{queue['queued']} waiting, {queue['dropped']} dropped"
    if notice := report.get("wall_clock"):
        yield "clock", visible(notice)


def _log(log: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    yield "recording", visible(log["file"])
    size = f", {_bytes(log['size'])}" if "size" in log else ""
    yield "state", f"{log['state']}, part {log['files']}{size}"
    yield "messages", f"{log['written']} written, {log['queued']} waiting, {log['dropped']} dropped"
    if "free" in log:
        yield "disk left", _bytes(log["free"])


def _bytes(count: float) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"
