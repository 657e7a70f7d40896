"""`gritd export`: a table a topic, with every number as it was recorded."""

from __future__ import annotations

import csv
import importlib.util
from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.recording.salvage import read
from gritd.tools import main as cli
from tests.estimator.recording.samples import write_sample


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    write_sample(tmp_path / "a.mcap")
    return tmp_path / "a.mcap"


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_message_is_a_row_and_every_number_is_kept(recorded, tmp_path, capsys):
    assert cli.main(["export", str(recorded), "--csv", "-o", str(tmp_path / "out")]) == 0
    recording = read(recorded)

    for topic, count in recording.counts.items():
        if topic == "/checkpoint":
            continue
        rows = rows_of(tmp_path / "out" / f"{topic[1:].replace('/', '_')}.csv")
        assert len(rows) == count, topic

    shunt = recording.arrays("/raw/motor_shunt")
    rows = rows_of(tmp_path / "out" / "raw_motor_shunt.csv")
    assert [float(row["volts"]) for row in rows] == shunt["volts"].tolist()
    assert [int(row["stamp"]) for row in rows] == shunt["stamp"].tolist()

    meanings = rows_of(tmp_path / "out" / "columns.csv")
    assert {
        "file": "raw_motor_shunt.csv",
        "column": "volts",
        "meaning": "as read by the ADC [V]",
    } in meanings
    assert str(tmp_path / "out" / "columns.csv") in capsys.readouterr().out


def test_one_topic_by_its_name(recorded, tmp_path, capsys):
    out = tmp_path / "out"
    command = ["export", str(recorded), "--csv", "-o", str(out), "--topic"]
    assert cli.main([*command, "/raw/motor_shunts"]) == 2
    assert "did you mean /raw/motor_shunt?" in capsys.readouterr().err
    assert not out.exists()

    assert cli.main([*command, "/raw/motor_shunt"]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["columns.csv", "raw_motor_shunt.csv"]


def test_nothing_is_overwritten(recorded, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.csv").write_text("mine")
    assert cli.main(["export", str(recorded), "--csv", "-o", str(tmp_path / "out")]) == 2
    assert "holds files already" in capsys.readouterr().err


def test_a_damaged_recording_is_exported_as_far_as_it_goes(recorded, tmp_path, capsys):
    data = bytearray(recorded.read_bytes())
    data[data.index(b"\x28\xb5\x2f\xfd") + 30] ^= 1  # inside a zstd frame
    recorded.write_bytes(data)
    assert cli.main(["export", str(recorded), "--csv", "-o", str(tmp_path / "out")]) == 3
    assert (tmp_path / "out" / "columns.csv").exists()
    assert capsys.readouterr().err.startswith(f"gritd: {recorded}: ")


def test_parquet(recorded, tmp_path, capsys):
    command = ["export", str(recorded), "--parquet", "-o", str(tmp_path / "out")]
    if importlib.util.find_spec("pyarrow") is None:
        assert cli.main(command) == 2
        assert "pip install 'gritd[parquet]'" in capsys.readouterr().err
        return

    parquet = pytest.importorskip("pyarrow.parquet")
    assert cli.main(command) == 0
    table = parquet.read_table(tmp_path / "out" / "raw_motor_shunt.parquet")
    assert table["volts"].to_pylist() == read(recorded).arrays("/raw/motor_shunt")["volts"].tolist()


def test_nested_messages_become_columns_and_the_rest_is_named(tmp_path, capsys):
    rosbags = pytest.importorskip("rosbags.typesys")
    from mcap.writer import Writer

    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    types = store.types
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        text, _ = store.generate_msgdef("sensor_msgs/msg/JointState", ros_version=2)
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", text.encode())
        joints = writer.register_channel("/joints", "cdr", schema)
        proto = writer.register_channel("/camera", "protobuf", 0)
        scan = writer.register_channel("/scan", "json", 0)
        for at in range(20):
            header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](at, 5), "a")
            values = np.array([at, 0.1 * at])
            message = types["sensor_msgs/msg/JointState"](
                header, ["arm", "wheel"], values, values[:0], values
            )
            data = bytes(store.serialize_cdr(message, message.__msgtype__))
            writer.add_message(joints, 10**18 + at, data, 0)
        writer.add_message(proto, 10**18, b"\x08\x01", 0)
        ranges = b'{"angle": 0.5, "ranges": [' + b",".join([b"1"] * 500) + b"]}"
        writer.add_message(scan, 10**18, ranges, 0)
        writer.finish()

    command = ["export", str(tmp_path / "a.mcap"), "--csv", "-o", str(tmp_path / "out")]
    assert cli.main(command) == 3
    reported = capsys.readouterr().err
    assert (
        "/camera" in reported
        and "protobuf" in reported
        and "/scan.ranges, an array of 500" in reported
    )

    rows = rows_of(tmp_path / "out" / "joints.csv")
    assert [float(row["position[wheel]"]) for row in rows] == [0.1 * at for at in range(20)]
    assert rows[3]["header.stamp"] == "3000000005" and rows[3]["header.frame_id"] == "a"
    assert rows_of(tmp_path / "out" / "scan.csv")[0]["angle"] == "0.5"
    assert not (tmp_path / "out" / "camera.csv").exists()
