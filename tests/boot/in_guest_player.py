"""In the guest: plays play.bin in real time on ttyS2, which is wired to ttyS1, and on vcan0."""

import os
import socket
import struct
import time
import tty
from contextlib import suppress
from pathlib import Path

HEAD = struct.Struct("<qBIB")  # as in record.py

port = os.open("/dev/ttyS2", os.O_RDWR | os.O_NOCTTY)
tty.setraw(port)
os.system("stty -F /dev/ttyS2 921600 raw -echo")
bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
bus.bind(("vcan0",))
data = Path("/root/play.bin").read_bytes()
print("playing", flush=True)
place, start = 0, time.monotonic_ns()
while place < len(data):
    due, kind, ident, length = HEAD.unpack_from(data, place)
    body = data[place + HEAD.size : place + HEAD.size + length]
    place += HEAD.size + length
    time.sleep(max(start + due - time.monotonic_ns(), 0) / 1e9)
    with suppress(OSError):  # the interface is down for a while
        if kind:
            bus.send(struct.pack("<IB3x8s", ident, length, body))
        else:
            os.write(port, body)
