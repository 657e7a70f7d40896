"""A session of the library: its wires, its configuration, and its outcome."""

from __future__ import annotations

import heapq
import json
import lzma
import math
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import yaml

from gritd.config import packaged
from gritd.drivers.build import build_decoder, used_devices
from gritd.drivers.recorded import decoded
from gritd.drivers.wire_log import read_wire, wire_path
from gritd.estimator.config.configuration import load, loads
from gritd.estimator.config.yamltree import dumped
from gritd.estimator.messages.status import CHANNEL_BITS, Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.offline.playback import ticks_at
from gritd.estimator.online.pipeline import Pipeline

FOLDER = Path(__file__).parent / "sessions"
DIGITS = 6  # of numbers that are no integers
COUNTERS = ("late", "duplicates", "jumps", "invalid", "updates", "resets")
ESTIMATE = ("cohesion", "cohesion_sigma", "tan_phi", "tan_phi_sigma", "wheel_angle")


class Session(NamedTuple):
    """A folder of the library.

    about: what happened. changes: of the packaged configuration, section by section, name by name.
    """

    name: str
    about: str
    changes: dict
    outcome: dict

    @property
    def folder(self):
        return FOLDER / self.name

    def configuration(self):
        """The packaged configuration with the changes, for the plant without linearisation."""
        return configuration(self.changes)

    def unpack(self, folder):
        """Its wire logs as `gritd run --tap` wrote them."""
        for packed in self.folder.glob("*.wire.xz"):
            (folder / packed.stem).write_bytes(lzma.decompress(packed.read_bytes()))


def sessions():
    return [session(path.parent.name) for path in sorted(FOLDER.glob("*/session.json"))]


def session(name):
    return Session(name, **json.loads((FOLDER / name / "session.json").read_text("utf-8")))


def keep(session):
    """Write what is said of a session into its folder."""
    document = session._asdict()
    del document["name"]
    text = json.dumps(document, indent=1, ensure_ascii=False)
    (session.folder / "session.json").write_text(f"{text}\n", encoding="utf-8")


def configuration(changes):
    document = yaml.safe_load(load(packaged()).text)
    document["effects"]["stress_linearisation"] = {"share": 0.0}
    for section, entries in changes.items():
        for name, values in entries.items():
            document[section][name].update(values)
    return loads(dumped(document), "session", packaged().parent)


def outcome(session, folder):
    """What comes of the session's wire logs in a folder: of each device what was counted, of each
    channel what was read, of the filter what it did.
    """
    settings = session.configuration().settings
    decoders = {device.name: build_decoder(settings, device) for device in used_devices(settings)}
    streams = [
        decoded(read_wire(wire_path(folder, name)), decoder) for name, decoder in decoders.items()
    ]
    readings = list(heapq.merge(*streams, key=lambda reading: reading.received))

    pipeline = Pipeline(settings, "plain")
    state, ticks = pipeline.start(), []
    for tick in ticks_at(readings, settings.rates.tick):
        state, row = pipeline.step(state, tick.readings, tick.stamp)
        ticks.append(dict(zip(TICK_NAMES, row, strict=True)))

    return {
        "devices": {name: _counted(decoder) for name, decoder in decoders.items()},
        "channels": _channels(readings),
        "ticks": len(ticks),
        "status": _tally(Status(int(tick["status"])).name for tick in ticks),
        "flags": _tally(f.name for tick in ticks for f in Flag if f and int(tick["flags"]) & f),
        "stale": _tally(name for tick in ticks for name in _named(int(tick["stale"]))),
        "stuck": _tally(name for tick in ticks for name in _named(int(tick["stuck"]))),
        "last": {name: int(ticks[-1][name]) for name in COUNTERS},
        "estimate": {name: _digits(ticks[-1][name]) for name in ESTIMATE},
    }


def _named(bits):
    return [name for name, bit in CHANNEL_BITS.items() if bits & bit]


def _tally(names):
    return dict(sorted(Counter(names).items()))


def _digits(value):
    return None if math.isnan(value) else float(f"{value:.{DIGITS}g}")


def _counted(decoder):
    """Everything that is counted, but what is zero."""
    sensors, (steps, step) = decoder.sensors, decoder.step
    counts = asdict(decoder.framing.counts) | {
        "duplicates": decoder.duplicates,
        "unknown": decoder.unknown,
        "quarantined": sum(sensor.quarantined for sensor in sensors),
        "incomplete": sum(sensor.incomplete for sensor in sensors),
        "turns_unknown": sum(sensor.turns_unknown for sensor in sensors),
        "mistimed": decoder.mistimed,
        "clock_steps": steps,
        "clock_step": round(step, 4),
    }
    return {name: count for name, count in counts.items() if count}


def _channels(readings):
    found = {}
    for name in sorted({reading.channel for reading in readings}):
        own = [reading for reading in readings if reading.channel == name]
        stamps = [reading.stamp for reading in own]
        value = own[-1].value
        found[name] = {
            "readings": len(own),
            "milliseconds": round((max(stamps) - min(stamps)) * 1e-6, 3),
            "longest_gap": round(max(map(int.__sub__, stamps[1:], stamps), default=0) * 1e-6, 3),
            "last": list(map(_digits, value)) if isinstance(value, tuple) else _last(value),
        }
    return found


def _last(value):
    return value if isinstance(value, int) else _digits(value)


def differences(want, have, where=""):
    """One line for each thing that is not as wanted; numbers that are no integers to their
    digits.
    """
    if isinstance(want, dict) and isinstance(have, dict):
        for name in sorted(want.keys() | have.keys()):
            yield from differences(want.get(name, 0), have.get(name, 0), f"{where} {name}".strip())
    elif isinstance(want, list) and isinstance(have, list) and len(want) == len(have):
        for number, pair in enumerate(zip(want, have, strict=True)):
            yield from differences(*pair, f"{where}[{number}]")
    elif isinstance(want, float) and isinstance(have, int | float):
        if not math.isclose(want, have, rel_tol=2.0 * 10.0**-DIGITS, abs_tol=1e-9):
            yield f"{where}: {have}, was {want}"
    elif want != have:
        yield f"{where}: {have}, was {want}"
