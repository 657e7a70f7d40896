"""One run in every format, each written by the format's own library."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

START = 1_767_225_600 * 10**9  # 2026-01-01 [ns]
ROWS = 400
rng = np.random.default_rng(5)
TIME = np.arange(ROWS) * 0.01  # [s] of the drive; the load cell reads every second time
WHEEL = 1.5 * TIME  # [rad]
CART = 0.06 * TIME  # [m]
PULL = 5.0 + rng.normal(0.0, 0.1, ROWS // 2)  # [N]

Array = NDArray[np.float64]
DRIVE = {"t": TIME, "wheel": WHEEL, "cart": CART}
CELL = {"t": TIME[::2], "pull": PULL}

TOPICS = ("/drive", "/cell")


def parquet(path: Path) -> None:
    """One table: empty where the load cell did not read."""
    pyarrow = import_module("pyarrow")
    pull = np.full(ROWS, np.nan)
    pull[::2] = PULL
    drive = pyarrow.StructArray.from_arrays(
        [pyarrow.array(WHEEL), pyarrow.array(CART)], names=["wheel", "cart"]
    )
    cell = pyarrow.array([[value] for value in pull.tolist()])
    stamps = pyarrow.array(START + (TIME * 1e9).round().astype(np.int64))
    made = pyarrow.table({"t": stamps, "drive": drive, "cell": cell})
    import_module("pyarrow.parquet").write_table(made, path)


def npz(path: Path) -> None:
    drive = np.rec.fromarrays(list(DRIVE.values()), names=list(DRIVE))
    np.savez(path, drive=drive, cell=np.column_stack(list(CELL.values())))


def mat(path: Path) -> None:
    import_module("scipy.io").savemat(path, {"drive": DRIVE, "cell": CELL})


def mat_73(path: Path) -> None:
    """As MATLAB writes it with -v7.3: HDF5 behind a header of 512 bytes, vectors as rows."""
    with import_module("h5py").File(path, "w", userblock_size=512) as file:
        for group, columns in (("drive", DRIVE), ("cell", CELL)):
            file.create_group(group).attrs["MATLAB_class"] = np.bytes_("struct")
            for name, values in columns.items():
                data = file.create_dataset(f"{group}/{name}", data=values[:, None])
                data.attrs["MATLAB_class"] = np.bytes_("double")
        text = file.create_dataset("notes", data=np.array([[100, 114, 121]], np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as raw:
        raw.write(header)


def hdf5(path: Path) -> None:
    with import_module("h5py").File(path, "w") as file:
        for group, columns in (("drive", DRIVE), ("cell", CELL)):
            for name, values in columns.items():
                file[f"{group}/{name}"] = values
        file["cell/pull"].attrs["units"] = "N"


def tdms(path: Path) -> None:
    nptdms = import_module("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        for group, columns, step in (("drive", DRIVE, 0.01), ("cell", CELL, 0.02)):
            reported = {"wf_increment": step, "wf_start_time": np.datetime64(START, "ns")}
            channels = [
                nptdms.ChannelObject(group, name, values, reported)
                for name, values in columns.items()
                if name != "t"
            ]
            writer.write_segment(channels)


def xlsx(path: Path) -> None:
    """A preamble, a row of units, and a sheet without a table."""
    book = import_module("openpyxl").Workbook()
    for sheet, columns in (("drive", DRIVE), ("cell", CELL)):
        page = book.create_sheet(sheet)
        page.append(["Bench 3, dry sand"])
        page.append(list(columns))
        page.append(["s", *("x" for _ in columns)][: len(columns)])
        for row in zip(*(values.tolist() for values in columns.values()), strict=True):
            page.append(row)
    book.save(path)


def lvm(path: Path) -> None:
    """No library writes it: the text as LabVIEW does, decimal commas, two segments."""
    common = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        "Decimal_Separator\t,\nMulti_Headings\tYes\nX_Columns\tOne\nTime_Pref\tRelative\n"
        "Operator\tsb\nDate\t2026/01/01\nTime\t00:00:00,0000000000000000000\n"
        "***End_of_Header***\t\n"
    )
    pull = np.interp(TIME, TIME[::2], PULL)
    path.write_text(common + "".join(_segment(pull, half) for half in (0, ROWS // 2)))


def _segment(pull: Array, first: int) -> str:
    head = (
        f"\t\nChannels\t3\t\t\t\nSamples\t{ROWS // 2}\t{ROWS // 2}\t{ROWS // 2}\t\n"
        "Date\t2026/01/01\t2026/01/01\t2026/01/01\t\nTime\t00:00:00,0\t00:00:00,0\t00:00:00,0\t\n"
        "Y_Unit_Label\trad\tm\tN\t\nX_Dimension\tTime\tTime\tTime\t\n"
        "X0\t0,0E+0\t0,0E+0\t0,0E+0\t\nDelta_X\t0,01\t0,01\t0,01\t\n"
        "***End_of_Header***\t\t\t\t\nX_Value\twheel\tcart\tpull\tComment\n"
    )
    rows = range(first, first + ROWS // 2)
    lines = (f"{TIME[i]:.6f}\t{WHEEL[i]:.9f}\t{CART[i]:.9f}\t{pull[i]:.9f}\t\n" for i in rows)
    return head + "".join(lines).replace(".", ",")


def ulog(path: Path) -> None:
    """pyulog writes only what it has read: the bytes by PX4's description of the format."""
    text = b"uint64_t timestamp;float"

    def record(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<Hc", len(body), kind) + body

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    out += record(b"B", bytes(40))
    out += record(b"F", b"drive:" + text + b"[2] q;")
    out += record(b"F", b"cell:" + text + b" pull;")
    out += record(b"A", struct.pack("<BH", 0, 0) + b"drive")
    out += record(b"A", struct.pack("<BH", 0, 1) + b"cell")
    for at, time in enumerate(TIME.tolist()):
        body = struct.pack("<HQff", 0, round(time * 1e6), WHEEL[at], CART[at])
        out += record(b"D", body)
        if at % 2 == 0:
            out += record(b"D", struct.pack("<HQf", 1, round(time * 1e6), PULL[at // 2]))
    path.write_bytes(out)


def mdf(path: Path) -> None:
    asammdf = import_module("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for group, columns in (("drive", DRIVE), ("cell", CELL)):
            signals = [
                asammdf.Signal(values, columns["t"], name=name)
                for name, values in columns.items()
                if name != "t"
            ]
            file.append(signals, acq_name=group)
        file.save(path, overwrite=True)


# --- messages ---

WHEEL_STATE = "std_msgs/Header header\nDrive drive\nfloat64[2] travel\n" + (
    "=" * 80 + "\nMSG: bench_msgs/Drive\nfloat64 angle\nstring mode\n"
)


def _store(version: str) -> Any:
    """The types of ROS with a message of a laboratory's own."""
    types = import_module("rosbags.typesys")
    store = types.get_typestore(types.Stores[version])
    own = types.get_types_from_msg(WHEEL_STATE, "bench_msgs/msg/WheelState")
    store.register(own)
    return store


def _messages(store: Any, first: bool) -> Iterator[tuple[str, str, int, Any]]:
    """Topic, type, time of receipt [ns] and message, in the order of time. first: of ROS 1."""
    made = store.types
    header, time = made["std_msgs/msg/Header"], made["builtin_interfaces/msg/Time"]

    for at, seconds in enumerate(TIME.tolist()):
        stamp = START + round(seconds * 1e9)
        reported = (time(stamp // 10**9, stamp % 10**9), "base")
        head = header(at, *reported) if first else header(*reported)
        state = made["bench_msgs/msg/WheelState"](
            head,
            made["bench_msgs/msg/Drive"](WHEEL[at], "slip" * (at % 3)),
            np.array([0.0, CART[at]]),
        )
        yield "/drive", "bench_msgs/msg/WheelState", stamp + 3_000_000, state
        if at % 2 == 0:
            joints = made["sensor_msgs/msg/JointState"](
                head, ["arm", "cell"], np.array([]), np.array([]), np.array([0.1, PULL[at // 2]])
            )
            yield "/cell", "sensor_msgs/msg/JointState", stamp + 4_000_000, joints


def bag(path: Path) -> None:
    store = _store("ROS1_NOETIC")
    with import_module("rosbags.rosbag1").Writer(path) as writer:
        known: dict[str, Any] = {}
        for topic, kind, time, message in _messages(store, first=True):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(known[topic], time, store.serialize_ros1(message, kind))


def ros2(path: Path, storage: str = "SQLITE3", version: int = 9) -> None:
    rosbag2, store = import_module("rosbags.rosbag2"), _store("ROS2_HUMBLE")
    plugin = rosbag2.StoragePlugin[storage]
    with rosbag2.Writer(path, version=version, storage_plugin=plugin) as writer:
        known: dict[str, Any] = {}
        for topic, kind, time, message in _messages(store, first=False):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(known[topic], time, store.serialize_cdr(message, kind))


def db3(path: Path) -> None:
    """The database of a bag's folder, alone."""
    with _beside(path) as folder:
        ros2(folder)
        next(folder.glob("*.db3")).rename(path)


def mcap(path: Path) -> None:
    with _beside(path) as folder:
        ros2(folder, "MCAP")
        next(folder.glob("*.mcap")).rename(path)


@contextmanager
def _beside(path: Path) -> Iterator[Path]:
    yield path.with_name(f"{path.stem}_folder")


def mcap_folder(path: Path) -> None:
    ros2(path, "MCAP")


def mcap_json(path: Path, logged: bool = True, stamped: bool = True) -> None:
    """As programs write MCAP without ROS; with log times of zero, or without stamps."""
    import json

    with path.open("wb") as file:
        writer = import_module("mcap.writer").Writer(file)
        writer.start()
        ids = {
            topic: writer.register_channel(topic, "json", writer.register_schema(topic, "", b""))
            for topic in TOPICS
        }
        for at, seconds in enumerate(TIME.tolist()):
            stamp = START + round(seconds * 1e9)
            head = {"header": {"stamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9}}}
            drive = {"drive": {"angle": WHEEL[at]}, "travel": [0.0, CART[at]]}
            cell = {"effort": [0.1, PULL[at // 2]], "name": ["arm", "cell"]}
            for topic, body in (("/drive", drive), ("/cell", cell))[: 1 + (at % 2 == 0)]:
                data = json.dumps((head if stamped else {}) | body).encode()
                writer.add_message(ids[topic], stamp if logged else 0, data, stamp)
        writer.finish()


def mcap_protobuf(path: Path) -> None:
    """As the tools of Foxglove write it; the definition's files are not in the order of their
    needs.
    """
    pb = import_module("google.protobuf.descriptor_pb2")
    stamps = import_module("google.protobuf.timestamp_pb2")
    files = pb.FileDescriptorSet()
    file = files.file.add(name="bench.proto", package="bench", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    stamps.DESCRIPTOR.CopyToProto(files.file.add())

    field = pb.FieldDescriptorProto
    double, text, part = field.TYPE_DOUBLE, field.TYPE_STRING, field.TYPE_MESSAGE
    one, many = field.LABEL_OPTIONAL, field.LABEL_REPEATED
    drive = file.message_type.add(name="Drive")
    drive.field.add(name="angle", number=1, type=double, label=one)
    state = file.message_type.add(name="State")
    stamp = {"type": part, "type_name": ".google.protobuf.Timestamp"}
    state.field.add(name="timestamp", number=1, label=one, **stamp)
    state.field.add(name="drive", number=2, type=part, type_name=".bench.Drive", label=one)
    state.field.add(name="travel", number=3, type=double, label=many)
    state.field.add(name="effort", number=4, type=double, label=many)
    state.field.add(name="name", number=5, type=text, label=many)

    pool = import_module("google.protobuf.descriptor_pool").DescriptorPool()
    for each in reversed(files.file):
        pool.AddSerializedFile(each.SerializeToString())
    factory = import_module("google.protobuf.message_factory")
    make = factory.GetMessageClass(pool.FindMessageTypeByName("bench.State"))

    with path.open("wb") as out:
        writer = import_module("mcap.writer").Writer(out)
        writer.start()
        schema = writer.register_schema("bench.State", "protobuf", files.SerializeToString())
        ids = {topic: writer.register_channel(topic, "protobuf", schema) for topic in TOPICS}
        for at, seconds in enumerate(TIME.tolist()):
            ns = START + round(seconds * 1e9)
            when = {"seconds": ns // 10**9, "nanos": ns % 10**9}
            moved = make(timestamp=when, drive={"angle": WHEEL[at]}, travel=[0.0, CART[at]])
            felt = make(timestamp=when, effort=[0.1, PULL[at // 2]], name=["arm", "cell"])
            for topic, message in zip(TOPICS, (moved, felt)[: 1 + (at % 2 == 0)], strict=False):
                writer.add_message(ids[topic], ns + 10**6, message.SerializeToString(), ns)
        writer.finish()
