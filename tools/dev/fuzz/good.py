"""A good file of every kind that a command reads."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import struct
from collections.abc import Iterable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np

from gritd.__main__ import main
from gritd.config import packaged
from gritd.drivers.build import used_devices
from gritd.drivers.wire import SerialWire
from gritd.drivers.wire_log import MAGIC, wire_path
from gritd.estimator.config.configuration import load
from gritd.tools.dev.fuzz.case import START

SCHEDULE = """ramp: 300 ms
segments:
  - {duration: 1 s, load: 60 N, slip: 0.2, speed: 0 mm/s}
  - {duration: 6 s, load: 60 N, slip: 0.2, speed: 20 mm/s}
"""
CSV = """time [s],wheel speed [rad/s],carriage speed [m/s],load [N],drawbar pull [N],torque [N·m]
"""
TABLE = """source,wheel_radius_m,wheel_width_m,soil_simulant,soil_shear_modulus_k_m,\
vertical_load_n,slip,meas_drawbar_pull_n,meas_sinkage_m
a,0.1,0.1,sand,0.01,100,0.1,10,0.01
a,0.1,0.1,sand,0.01,100,0.3,20,0.02
a,0.1,0.1,sand,0.01,150,0.3,30,0.02
"""
SOILS = """simulant,n,k_c_kN_per_m_n_plus_1,k_phi_kN_per_m_n_plus_2,cohesion_kPa,\
friction_angle_deg
sand,1.1,1.0,1500,0.5,30
"""
MAP = """columns:
  'time [s]': {channel: time, unit: s}
  'wheel speed [rad/s]': {channel: wheel_speed, unit: rad/s}
  'carriage speed [m/s]': {channel: carriage_speed, unit: m/s}
  'load [N]': {channel: load, unit: N}
  'drawbar pull [N]': {channel: drawbar_pull, unit: N}
  'torque [N·m]': {channel: torque, unit: N*m}
wheel: {radius: 72 mm, width: 71 mm}
"""

PLATES = "plate,force [N],depth [mm]\n"
PRESS = """plate: 60 mm
columns:
  'force [N]': {channel: load, unit: N}
  'depth [mm]': {channel: sinkage, unit: mm}
"""
SUFFIXES = {kind: "yaml" for kind in ("schedule", "map", "press")}
SUFFIXES |= {"bed": "json", "table": "csv", "plates": "csv"}


def suffix(kind: str) -> str:
    return SUFFIXES.get(kind, kind)


def good_files(folder: Path, kinds: Iterable[str]) -> dict[str, Path]:
    """A good file of every kind, made by the commands themselves where one makes it."""
    folder.mkdir(exist_ok=True)
    paths = {kind: folder / f"good-{kind}.{suffix(kind)}" for kind in kinds}
    paths["other"] = folder / "good-other.mcap"
    paths |= {"bed": folder / "bed.json", "wire": wire_path(folder, "encoders")}
    if paths["npz"].exists():  # of another target
        return paths

    shutil.copy(packaged("testbed.dbc"), folder)
    (folder / "soils.csv").write_text(SOILS, encoding="utf-8")
    texts = {"yaml": _configuration(), "schedule": SCHEDULE, "table": TABLE, "map": MAP}
    presses = [f"{p},{p * p * 0.5},{p * 0.3}\n" for p in range(100)]
    texts |= {"press": PRESS, "plates": PLATES + "".join(presses)}
    for kind, text in {**texts, "csv": CSV + "".join(_rows())}.items():
        paths[kind].write_text(text, encoding="utf-8")

    for seed, kind in enumerate(("mcap", "other")):
        driven = folder / f"{kind}.new"
        _made("simulate", "--schedule", paths["schedule"], "--seed", seed, "-o", driven)
        _made("replay", driven, "-o", paths[kind])
    _made("bed", "new", "box", "--directory", folder)
    paths["json"].write_text(json.dumps(_diagnosis(paths["mcap"])), encoding="utf-8")
    _write_wires(paths["wire"].parent)
    np.savez(paths["npz"], time=np.arange(400) * 0.02, force=np.arange(400) % 5)
    return paths


def _configuration() -> str:
    return Path(packaged()).read_text(encoding="utf-8").replace("directory: runs", "directory: .")


def _rows() -> Iterator[str]:
    for n in range(400):
        speed, load, pull, torque = 0.02 + 1e-4 * (n % 3), 60 + n % 2, 5 + n % 4, 1.5 + n % 3 / 10
        yield f"{n * 0.02:.2f},0.4,{speed:.4f},{load},{pull},{torque:.1f}\n"


def _diagnosis(recording: Path) -> dict[str, object]:
    """What of an earlier diagnosis is read again."""
    redo = {
        "files": {str(recording): hashlib.sha256(recording.read_bytes()).hexdigest()},
        "configuration": _configuration(),
        "seed": 1,
        "versions": {"gritd": "0"},
    }
    accepted = {"effect": "coulomb_friction", "probability": 0.9, "accepted": True}
    return {"verdict": "explained", "hypotheses": [accepted], "redo": redo}


def _write_wires(folder: Path) -> None:
    """Half a second of one encoder; nothing came from the others."""
    settings = load(packaged()).settings
    for device in used_devices(settings):
        wire_path(folder, device.name).write_bytes(MAGIC)
    wire = SerialWire(settings.devices["encoders"])
    with wire_path(folder, "encoders").open("ab") as log:
        for n in range(125):
            data = wire.encode("wheel_encoder", [40 * n], 4000 * n)
            log.write(struct.pack("<qI", START + n * 4_000_000, len(data)) + data)


def _made(*arguments: object) -> None:
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as error:
        code = main(list(map(str, arguments)))
    assert code == 0, error.getvalue()
