"""A package with entry points of gritd, some of them wrong."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
EFFECT = '''
from dataclasses import dataclass

from gritd.estimator.effects.base import Effect
from gritd.estimator.effects.bulldozing import Bulldozing


@dataclass(frozen=True)
class Second(Bulldozing, Effect):
    """Soil pushed ahead, once more."""
'''
IMPORTER = """
NAME, SUMMARY = "mylab", "the logs of my own laboratory, as its program writes them"


def add_arguments(parser):
    parser.add_argument("--fast", action="store_true")


def run(args, tell):
    tell(f"mylab was here, {args.fast}")
    return []
"""
SENSOR = '''
from gritd.drivers.sensor import Analog


class Laser(Analog):
    """Volts of a laser."""

    channel = "sinkage_pot"
'''
ENDS = "import sys\n\nsys.exit(0)\n"
HANGS = """
import time

while True:
    try:
        time.sleep(60.0)
    except ValueError:
        pass
"""
BADARG = IMPORTER.replace('"mylab"', '"badarg"').replace("parser.add", "raise KeyError; parser.add")
FAILS = """
NAME, SUMMARY = "fails", "fails"


def add_arguments(parser):
    pass


def run(args, tell):
    if str(args.paths[0]) == "exit":
        raise SystemExit(0)
    raise KeyError(7)
"""
READING = """
from gritd.config import packaged
from gritd.drivers.decoder import Decoder
from gritd.drivers.framing import Frame
from gritd.drivers.guarded import made
from gritd.drivers.sensor import sensor_kinds
from gritd.estimator.config.configuration import load

settings = load(packaged()).settings
sensors = [made(sensor_kinds()[n], settings.channels[n]) for n in ("sinkage_pot", "motor_shunt")]


class Once:
    clock_modulus = staticmethod(lambda key: 2**32)
    decode = staticmethod(lambda data: [Frame(s.keys[0], None, None, (2.0,)) for s in sensors])


for reading in Decoder(Once(), sensors).decode(10**18, b"x"):
    print(reading.channel)
print(sensors[0].failed)
"""


def made(folder: Path) -> Path:
    """A folder like site-packages with one distribution, my-rig."""
    (folder / "my_rig").mkdir()
    files = {"__init__": "", "second": EFFECT, "mylab": IMPORTER, "laser": SENSOR}
    files |= {"ends": ENDS, "hangs": HANGS, "badarg": BADARG, "fails": FAILS}
    files |= {"prints": "print('hello')\n" + IMPORTER}
    for name, text in files.items():
        (folder / "my_rig" / f"{name}.py").write_text(text)
    (folder / "my_rig-1.dist-info").mkdir()
    (folder / "my_rig-1.dist-info" / "METADATA").write_text("Name: my-rig\nVersion: 1\n")
    return folder


def offer(package: Path, text: str) -> None:
    (package / "my_rig-1.dist-info" / "entry_points.txt").write_text(text)


def python(package: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(package), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
