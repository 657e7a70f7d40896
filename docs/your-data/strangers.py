"""Files of five laboratories, each as its own programs write them: a spreadsheet, LabVIEW, ROS,
MATLAB, and a motor alone.

None of them knows of recordings or channels. Four have the same wheel and the same soil, simulated
by Eqs. (1)-(10), and each has other sensors on it.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from nptdms import ChannelObject, TdmsWriter
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

import gritd

SOIL = {"cohesion": 1200.0, "tan_phi": 0.55, "shear_modulus": 0.022, "modulus_factor": 3.0}
LOADS = (40.0, 70.0, 100.0)  # [N], one a run
SLIPS = (0.1, 0.25, 0.4, 0.6)
EVERY = 5  # of 250 rows a second one in five is written
START = 1_795_000_000_000_000_000  # [ns since 1970]
NOISE = {  # of a reading: rad/s, m/s, m, A, N, N, N·m
    "wheel": 1e-3,
    "cart": 5e-5,
    "sinkage": 5e-5,
    "current": 4e-3,
    "pull": 0.3,
    "load": 0.3,
    "torque": 0.01,
}
LOSS, DAMPING = 0.3, 0.05  # [N·m], [N·m·s/rad] of the motor alone
TORQUE_CONSTANT = 2.0  # [N·m/A]

Columns = Mapping[str, np.ndarray]


def run(load: float, seed: int) -> Columns:
    """Each column (n,) of a run in SI: four slips, four seconds each, after a second at rest."""
    rest = {"duration": 1.0, "load": load, "slip": SLIPS[0], "speed": 0.0}
    driven = [{"duration": 4.0, "load": load, "slip": slip, "speed": 0.02} for slip in SLIPS]
    made = gritd.simulate(None, [rest, *driven], soil=SOIL)

    motion, felt = made.motion, made.truth.sensed
    true = {
        "wheel": motion.wheel_speed,
        "cart": motion.carriage_speed,
        "sinkage": felt.sinkage,
        "current": felt.current,
        "pull": felt.drawbar_pull,
        "load": felt.load,
        "torque": felt.torque,
    }
    rng = np.random.default_rng(seed)
    columns = {name: np.asarray(values)[::EVERY] for name, values in true.items()}
    read = {name: x + rng.normal(0.0, NOISE[name], x.size) for name, x in columns.items()}
    return {"time": np.asarray(motion.time)[::EVERY], **read}


def spreadsheet(path: Path, of: Columns) -> None:
    """German: date and time, semicolons, decimal commas, Windows-1252."""
    head = "Zeit;Raddrehzahl [U/min];Schlitten [mm/s];Einsinkung [mm];Motorstrom [A]"
    rows = ["Prüfstand 3", f"{head};Zugkraft [N];Normalkraft [N]"]
    units = (30.0 / np.pi, 1e3, 1e3, 1.0, 1.0, 1.0)
    names = ("wheel", "cart", "sinkage", "current", "pull", "load")
    numbers = np.column_stack([of[name] * unit for name, unit in zip(names, units, strict=True)])
    for ms, row in zip(np.round(of["time"] * 1e3).astype(int), numbers, strict=True):
        clock = np.datetime64("2026-11-26T14:03:05") + np.timedelta64(ms, "ms")
        cells = ";".join(f"{number:.4f}".replace(".", ",") for number in row)
        rows.append(f"{clock.item():%d.%m.%Y %H:%M:%S},{ms % 1000:03d};{cells}")
    path.write_text("\r\n".join(rows) + "\r\n", encoding="cp1252")


def labview(path: Path, of: Columns) -> None:
    """TDMS: waveforms without a column of time; a torque sensor at the axle; no load cell."""
    timing = {"wf_increment": EVERY / 250.0, "wf_start_time": np.datetime64(START, "ns")}
    channels = [
        ("Wheel speed", of["wheel"], "rad/s"),
        ("Carriage speed", of["cart"] * 1e3, "mm/s"),
        ("Sinkage", of["sinkage"] * 1e3, "mm"),
        ("Axle torque", of["torque"], "N.m"),
    ]
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("Bench", name, x, {**timing, "unit_string": u})
                for name, x, u in channels
            ]
        )


def ros(path: Path, of: Columns) -> None:
    """A bag of ROS 2: joints with their effort, a force sensor, the depth without a header."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    make = store.types
    travelled = [np.cumsum(of[name]) * EVERY / 250.0 for name in ("wheel", "cart")]  # rad, m

    def header(ns: int) -> object:
        stamp = make["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
        return make["std_msgs/msg/Header"](stamp, "bench")

    def vector(x: float, z: float) -> object:
        return make["geometry_msgs/msg/Vector3"](x, 0.0, z)

    with Writer(path, version=9) as writer:
        topics = {
            topic: (writer.add_connection(topic, kind, typestore=store), kind)
            for topic, kind in (
                ("/joint_states", "sensor_msgs/msg/JointState"),
                ("/ft_sensor", "geometry_msgs/msg/WrenchStamped"),
                ("/sinkage", "std_msgs/msg/Float64"),
            )
        }
        for i, time in enumerate(of["time"]):
            ns = START + round(time * 1e9)
            position = np.array([travel[i] for travel in travelled])
            effort = np.array([of["current"][i] * TORQUE_CONSTANT, 0.0])
            wrench = make["geometry_msgs/msg/Wrench"](
                vector(of["pull"][i], of["load"][i]), vector(0.0, 0.0)
            )
            joints = make["sensor_msgs/msg/JointState"]
            messages = (
                joints(header(ns), ["wheel", "carriage"], position, np.zeros(0), effort),
                make["geometry_msgs/msg/WrenchStamped"](header(ns), wrench),
                make["std_msgs/msg/Float64"](of["sinkage"][i] * 1e3),
            )
            for (connection, kind), message in zip(topics.values(), messages, strict=True):
                writer.write(connection, ns, store.serialize_cdr(message, kind))


def matlab(path: Path, runs: list[Columns]) -> None:
    """One file: a structure of vectors, with the number of the trial; forces, but no torque."""
    trial = np.concatenate([np.full(of["time"].size, n) for n, of in enumerate(runs, 1)])
    columns = {name: np.concatenate([of[name] for of in runs]) for name in runs[0]}
    names = {
        "t": "time",
        "omega": "wheel",
        "v": "cart",
        "z": "sinkage",
        "Fx": "pull",
        "Fz": "load",
    }
    data = {short: columns[name] for short, name in names.items()}
    savemat(path, {"data": {**data, "trial": trial}})


def motor(path: Path) -> None:
    """A motor that turns nothing, at three speeds both ways: time, angle, current."""
    time = np.arange(0.0, 40.0, 0.02)
    levels = np.array([0.0, 1.0, 2.0, 3.0, 0.0, -1.0, -2.0, -3.0])
    knots = np.repeat(5.0 * np.arange(8), 2) + np.tile([0.3, 4.7], 8)
    speed = np.interp(time, knots, np.repeat(levels, 2))
    torque = LOSS * np.sign(speed) + DAMPING * speed
    current = torque / TORQUE_CONSTANT + np.random.default_rng(4).normal(0.0, 3e-3, time.size)
    turns = np.cumsum(speed) * 0.02 / (2.0 * np.pi)
    table = np.column_stack([time, turns, current])
    head = "Time [s],Angle [turn],Current [A]"
    np.savetxt(path, table, "%.2f,%.5f,%.4f", header=head, comments="")


def main() -> None:
    for folder in ("spreadsheet", "labview", "ros", "matlab", "motor"):
        Path(folder).mkdir(exist_ok=True)

    for place, write, seed in (
        ("spreadsheet/versuch-{:.0f}N.csv", spreadsheet, 10),
        ("labview/run-{:.0f}N.tdms", labview, 20),
        ("ros/run_{:.0f}N", ros, 30),
    ):
        for number, load in enumerate(LOADS):
            write(Path(place.format(load)), run(load, seed + number))

    matlab(Path("matlab/trials.mat"), [run(load, 40 + at) for at, load in enumerate(LOADS)])
    motor(Path("motor/spin.csv"))


if __name__ == "__main__":
    main()
