"""What in_guest_player.py plays: a simulated run as bytes for both wires, thinned for an emulated
processor.

python -m tests.boot.record FILE
"""

from __future__ import annotations

import struct
import sys
from collections import Counter
from pathlib import Path

from gritd.drivers.wire import CanWire, SerialWire
from gritd.estimator.messages.readings import ENCODERS
from gritd.tools.testbed.wires import messages
from tests.scenarios.rig import TESTBED, driven

LAP, LAPS = 60.0, 15  # [s], and how often it is driven: encoders and sequence numbers go on
THIN = 25  # of 250 readings a second ten are left
HEAD = struct.Struct("<qBIB")  # due [ns], 0 serial or 1 CAN, CAN id, length


def recorded():
    """Packets in the order they are due."""
    settings = TESTBED.settings
    serial, can = SerialWire(settings.devices["encoders"]), CanWire(settings.devices["bus"])
    sources = {**settings.channels, "wrench": settings.wrench}
    lap = thinned(driven(LAP, 1, 2.0))
    turned = {name: [r.value for r in lap if r.channel == name][-1] for name in ENCODERS}

    for number in range(LAPS):
        for reading in lap:
            due, value = reading.received + round(number * LAP * 1e9), reading.value
            if reading.channel in turned:
                value = (value + number * turned[reading.channel]) % (1 << 32)
            values, source = (
                value if isinstance(value, tuple) else (value,),
                sources[reading.channel],
            )
            if source.device == "encoders":
                yield due, 0, 0, serial.encode(source.signal, values, due // 1000)
            else:
                for message in messages(can, source.signal, values, due // 1000):
                    yield due, 1, message.arbitration_id, bytes(message.data)


def thinned(readings):
    seen = Counter()
    kept = []
    for reading in readings:
        seen[reading.channel] += 1
        if seen[reading.channel] % THIN == 0 or reading.channel == "motor_temperature":
            kept.append(reading)
    return kept


if __name__ == "__main__":
    packets = [
        HEAD.pack(due, kind, ident, len(data)) + data for due, kind, ident, data in recorded()
    ]
    Path(sys.argv[1]).write_bytes(b"".join(packets))
    print(f"{len(packets)} packets")
