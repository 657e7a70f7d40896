"""What is read of each format, written by the format's own library."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import CommandError
from gritd.tools.commands.import_rig import main
from tests.tools.importers.formats import writers

WHEEL = "wheel: {radius: 72 mm, width: 71 mm}\nload: 50 N\n"
GROUPS = "drive.t drive.wheel drive.cart cell.t cell.pull"
TOPICS = "- /drive.drive.angle /drive.travel[1] - /cell.effort[cell]"
# ending -> who writes it, what its columns are called (- for a clock of the file's own), its needs
FORMATS: dict[str, tuple[Callable[[Path], None], str, str]] = {
    "parquet": (writers.parquet, "t drive.wheel drive.cart - cell[0]", "pyarrow"),
    "npz": (writers.npz, "drive.t wheel drive.cart cell[0] cell[1]", "numpy"),
    "5.mat": (writers.mat, GROUPS, "scipy"),
    "7.mat": (writers.mat_73, GROUPS, "h5py"),
    "h5": (writers.hdf5, GROUPS, "h5py"),
    "tdms": (writers.tdms, "- wheel drive.cart - pull", "nptdms"),
    "xlsx": (writers.xlsx, "drive.t wheel drive.cart cell.t pull", "python_calamine"),
    "lvm": (writers.lvm, "- wheel cart - pull", "numpy"),
    "ulg": (writers.ulog, "- drive.q[0] q[1] - cell.pull", "pyulog"),
    "mf4": (writers.mdf, "- wheel drive.cart - cell.pull", "asammdf"),
    "bag": (writers.bag, TOPICS, "rosbags"),
    "db3": (writers.db3, TOPICS, "rosbags"),
    "folder": (writers.ros2, TOPICS, "rosbags"),
    "mcap": (writers.mcap, TOPICS, "rosbags"),
    "mcap_folder": (writers.mcap_folder, TOPICS, "rosbags"),
    "json.mcap": (writers.mcap_json, TOPICS, "rosbags"),
    "protobuf.mcap": (writers.mcap_protobuf, TOPICS, "google.protobuf"),
}
CHANNELS = ("time", "wheel_angle, unit: rad", "carriage_position, unit: m")
CHANNELS = (*CHANNELS, "time", "drawbar_pull, unit: N")


def map_of(names: str, unit: str = "s") -> str:
    """A map of the five columns."""
    lines = [
        f'  "{name}": {{channel: {channel}{f", unit: {unit}" if channel == "time" else ""}}}'
        for name, channel in zip(names.split(), CHANNELS, strict=True)
        if name != "-"
    ]
    return "\n".join(["columns:", *lines, WHEEL])


def imported(path: Path, text: str) -> Path:
    (path.parent / "map.yaml").write_text(text)
    output = path.parent / "out"
    assert main(["csv", str(path), "--map", str(path.parent / "map.yaml"), "-o", str(output)]) == 0
    return output


def written(folder: Path, ending: str) -> Path:
    write, _, package = FORMATS[ending]
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed")
    path = folder / (f"run.{ending}" if "folder" not in ending else ending)
    write(path)
    return path


@pytest.mark.parametrize("ending", FORMATS)
def test_a_file_of_each_format_is_read(tmp_path: Path, ending: str) -> None:
    """Each sensor at its own rate, every number as it was written."""
    path = written(tmp_path, ending)
    output = imported(path, map_of(FORMATS[ending][1], "ns" if ending == "parquet" else "s"))

    settings = config.load(output / "csv.yaml").settings
    (made,) = output.glob("*.mcap")
    recording = read(made)
    wheel, cart = (recording.arrays(f"/raw/{n}_encoder") for n in ("wheel", "carriage"))
    pull = recording.arrays("/raw/wrench")

    times = (wheel["stamp"] - wheel["stamp"][0]) * 1e-9
    np.testing.assert_allclose(times, writers.TIME, atol=1e-6)
    own = pull if ending != "lvm" else pull[::2]
    np.testing.assert_allclose(
        (own["stamp"] - wheel["stamp"][0]) * 1e-9, writers.TIME[::2], atol=1e-6
    )
    np.testing.assert_allclose(own["fx"], writers.PULL, rtol=1e-6)
    for rows, truth, channel in ((wheel, writers.WHEEL, "wheel"), (cart, writers.CART, "carriage")):
        scale = settings.channels[f"{channel}_encoder"].calibration.scale.value
        factor = settings.pulley_radius if channel == "carriage" else 1.0
        travelled = (rows["count"] - rows["count"][0]) * scale * factor
        np.testing.assert_allclose(travelled, truth, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("ending", [name for name in FORMATS if name not in ("lvm",)])
def test_a_damaged_file_is_one_line(tmp_path: Path, ending: str) -> None:
    path = written(tmp_path, ending)
    if path.is_dir():
        path = next(file for file in path.iterdir() if file.suffix != ".yaml")
    whole = path.read_bytes()
    (tmp_path / "map.yaml").write_text(map_of(FORMATS[ending][1]))

    for keep in (0, 60, len(whole) // 3):
        bad = path.with_name(f"bad{path.suffix}")
        bad.write_bytes(whole[:keep] + bytes(40))
        command = ["csv", str(bad), "--map", str(tmp_path / "map.yaml"), "-o", str(tmp_path / "o")]
        try:
            main(command)
        except CommandError as error:
            line = str(error)
            assert "\n" not in line and str(bad) in line and error.code in (2, 3), line


@pytest.mark.parametrize("ending", [name for name in FORMATS if name != "mf4"])
def test_more_than_can_be_kept_is_one_line(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, ending)
    monkeypatch.setenv("GRITD_LIMITS", "series=20, values=20")
    with pytest.raises(CommandError) as error:
        imported(path, map_of(FORMATS[ending][1], "ns" if ending == "parquet" else "s"))
    line = str(error.value)
    assert str(path) in line and "values" in line and "raises the limit" in line


@pytest.mark.parametrize("ending", ["7.mat", "tdms", "xlsx", "ulg", "bag", "mf4"])
def test_a_missing_library_is_named(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"run.{ending}"
    path.write_bytes(b"MATLAB 7.3 MAT-file" if ending == "7.mat" else b"x" * 100)
    monkeypatch.setattr("gritd.tools.cli.optional.find_spec", lambda package: None)
    with pytest.raises(CommandError) as error:
        main(["csv", str(path), "--guess"])
    extra = "mdf" if ending == "mf4" else "formats"
    assert str(path) in str(error.value) and f"pip install 'gritd[{extra}]'" in str(error.value)
    assert error.value.code == 2


def test_a_bag_without_definitions_takes_the_package_beside_it(tmp_path: Path) -> None:
    """As ROS 2 wrote bags before it wrote definitions into them."""
    import sqlite3

    pytest.importorskip("rosbags")
    path, own = tmp_path / "run.db3", tmp_path / "bench_msgs" / "msg"
    writers.db3(path)
    with sqlite3.connect(path) as database:
        database.execute("DROP TABLE message_definitions")
        database.execute("UPDATE schema SET schema_version = 3")
    database.close()

    text = map_of(TOPICS)
    with pytest.raises(CommandError) as error:
        imported(path, text)
    assert "/drive" in str(error.value) and "bench_msgs/msg/WheelState.msg" in str(error.value)

    own.mkdir(parents=True)
    state, drive = writers.WHEEL_STATE.split("=" * 80 + "\nMSG: bench_msgs/Drive\n")
    (own / "WheelState.msg").write_text(state)
    (own / "Drive.msg").write_text(drive)
    recording = read(imported(path, text) / "run.mcap")
    assert len(recording.arrays("/raw/wheel_encoder")) == writers.ROWS


def test_a_field_that_is_not_there_is_named_with_the_nearest(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    writers.mcap(tmp_path / "run.mcap")
    with pytest.raises(CommandError) as error:
        imported(tmp_path / "run.mcap", map_of(TOPICS).replace("travel[1]", "travl[1]"))
    line = str(error.value)
    assert "/drive.travl[1]" in line and "did you mean /drive.travel" in line and len(line) < 300


@pytest.mark.parametrize("stamped", [True, False])
def test_log_times_of_zero_are_no_times(
    tmp_path: Path, stamped: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    """Headers, or the time of publishing, tell when a message was measured; the import says so."""
    pytest.importorskip("rosbags")
    path = tmp_path / "run.mcap"
    writers.mcap_json(path, logged=False, stamped=stamped)
    recording = read(imported(path, map_of(TOPICS)) / "run.mcap")
    stamps = recording.arrays("/raw/wheel_encoder")["stamp"]
    assert stamps[0] == writers.START and len(stamps) == writers.ROWS
    assert "log times are no times" in capsys.readouterr().out


def test_without_protobuf_one_line_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("google.protobuf")
    writers.mcap_protobuf(tmp_path / "run.mcap")
    monkeypatch.setitem(sys.modules, "google.protobuf.descriptor_pb2", None)
    with pytest.raises(CommandError) as error:
        imported(tmp_path / "run.mcap", map_of(TOPICS))
    assert "protobuf" in str(error.value) and "pip install 'gritd[formats]'" in str(error.value)
