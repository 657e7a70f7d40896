"""A ROS bag with a camera in it: what `gritd import` takes for it beside rosbags alone.

    python -m gritd.tools.dev.bags FOLDER [--minutes 15]

Joints, forces and sinkage at 250 Hz, an image of 300 kB a second; 330 MB in 15 minutes. As MCAP,
as database and as a bag of ROS 1. rosbags alone reads and decodes the same three topics.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

RATE, SLOW = 250, 250  # [Hz] of the sensors; messages between two images
START = 1_767_225_600 * 10**9  # [ns]
MAP = """columns:
  "/joints.position[wheel]": {channel: wheel_angle, unit: rad}
  "/joints.position[cart]": {channel: carriage_position, unit: m}
  "/joints.effort[wheel]": {channel: motor_torque, unit: N*m}
  /ft.wrench.force.x: {channel: drawbar_pull, unit: N}
  /ft.wrench.force.z: {channel: load, unit: N}
  /sinkage.data: {channel: sinkage, unit: mm}
wheel: {radius: 72 mm, width: 71 mm}
torque_constant: 2 N*m/A
"""
KINDS = {
    "/joints": "sensor_msgs/msg/JointState",
    "/ft": "geometry_msgs/msg/WrenchStamped",
    "/sinkage": "std_msgs/msg/Float64",
    "/camera": "sensor_msgs/msg/Image",
}
ALONE = """
import sys
from pathlib import Path
from rosbags.highlevel import AnyReader
with AnyReader([Path(sys.argv[1])]) as bag:
    chosen = [c for c in bag.connections if c.topic != "/camera"]
    for connection, _, raw in bag.messages(chosen):
        bag.deserialize(raw, connection.msgtype)
"""


def main(argv: list[str] | None = None) -> int:
    """Exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--minutes", type=float, default=15.0)
    arguments = parser.parse_args(argv)

    folder: Path = arguments.folder
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "map.yaml").write_text(MAP, encoding="utf-8")
    for form in ("mcap", "db3", "bag"):
        path = written(folder / f"run.{form}", form, round(arguments.minutes * 60 * RATE))
        size = sum(f.stat().st_size for f in [path, *path.glob("*")] if f.is_file()) / 1e6
        options = ["--map", folder / "map.yaml", "-o", folder / "out"]
        ours = ["-m", "gritd", "import", "csv", path, *options]
        for name, command in (("rosbags", ["-c", ALONE, path]), ("gritd", ours)):
            seconds, memory = measured([str(word) for word in command])
            print(f"{form}, {size:.0f} MB: {name} {seconds:.1f} s of CPU, {memory:.0f} MB")
    return 0


def measured(command: list[str]) -> tuple[float, float]:
    """Processor time [s] and the most memory [MB] of a Python of its own."""
    child = subprocess.Popen([sys.executable, *command], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(child.returncode)
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3


def written(path: Path, form: str, count: int) -> Path:
    """A bag of so many messages a sensor, where there is none yet."""
    if path.exists():
        return path
    types = import_module("rosbags.typesys")
    first = form == "bag"
    store = types.get_typestore(types.Stores["ROS1_NOETIC" if first else "ROS2_HUMBLE"])
    pack = store.serialize_ros1 if first else store.serialize_cdr

    with _writer(path, form) as writer:
        topics = {t: writer.add_connection(t, kind, typestore=store) for t, kind in KINDS.items()}
        for at in range(count):
            stamp = START + at * 10**9 // RATE
            for topic, message in _messages(store.types, at, stamp, first):
                writer.write(topics[topic], stamp + 300_000, pack(message, KINDS[topic]))
    return path


def _writer(path: Path, form: str) -> Any:
    if form == "bag":
        return import_module("rosbags.rosbag1").Writer(path)
    rosbag2 = import_module("rosbags.rosbag2")
    plugin = rosbag2.StoragePlugin.MCAP if form == "mcap" else rosbag2.StoragePlugin.SQLITE3
    return rosbag2.Writer(path, version=9, storage_plugin=plugin)


def _messages(made: Any, at: int, stamp: int, first: bool) -> list[tuple[str, Any]]:
    """What the sensors say at one instant; first: of ROS 1, whose headers are numbered."""
    time = made["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    header = made["std_msgs/msg/Header"](*((at,) if first else ()), time, "rig")
    vector, seconds = made["geometry_msgs/msg/Vector3"], at / RATE
    rng = np.random.default_rng(at)
    pull, load, torque = rng.normal((5.0, 60.0, 3.0), 0.05).tolist()

    forces = made["geometry_msgs/msg/Wrench"](vector(pull, 0.0, load), vector(0.0, 2.0, 0.0))
    angles, speeds = np.array([0.4, 0.02]) * seconds, np.array([0.4, 0.02])
    efforts = np.array([torque, 0.0])
    said = [
        ("/joints", made[KINDS["/joints"]](header, ["wheel", "cart"], angles, speeds, efforts)),
        ("/ft", made[KINDS["/ft"]](header, forces)),
        ("/sinkage", made[KINDS["/sinkage"]](12.0 + 0.1 * np.sin(seconds))),
    ]
    if at % SLOW == 0:
        image = rng.integers(0, 255, 300_000, dtype=np.uint8)
        said.append(("/camera", made[KINDS["/camera"]](header, 300, 1000, "mono8", 0, 1000, image)))
    return said


if __name__ == "__main__":
    sys.exit(main())
