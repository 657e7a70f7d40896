"""What is read of each format, written by the format's own library."""

from __future__ import annotations

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
