"""What a user reads who made a mistake: one line each, with its exit code."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.io import savemat

from gritd.config import packaged
from tests.tools.calibrate import bench
from tests.wording.commands import simulated
from tests.wording.rig import output, said

MAP = """
columns:
  t: {channel: time, unit: s}
  rpm: {channel: wheel_speed, unit: rpm}
  v: {channel: carriage_speed, unit: mm/s}
  M: {channel: torque, unit: N*m}
wheel: {radius: 72 mm, width: 71 mm}
load: 50 N
"""
TIMES = np.arange(0.0, 5.0, 0.02)


def table(folder: Path) -> str:
    """A wheel at 10 rpm and a carriage at 60 mm/s, at 50 Hz, a scattering torque: the rows of
    `run.csv`.
    """
    rng = np.random.default_rng(1)
    rows = [f"{t:.2f},10.0,60.0,{3.0 + 0.1 * rng.standard_normal():.4f}" for t in TIMES]
    text = "\n".join(["t,rpm,v,M", *rows]) + "\n"
    (folder / "run.csv").write_text(text)
    return text


@output
def wrong_commands(folder: Path) -> Iterator[str]:
    for arguments in (
        ("replya", "run.mcap"),
        ("replay", "none.mcap"),
        ("info", "none.mcap"),
        ("simulate", "--soil", "moisture=3", "-o", "x.mcap"),
        ("demo", "--seconds", "1"),
        ("run", "--config", "none.yaml"),
    ):
        yield from said(folder, *arguments)


@output
def wrong_configurations(folder: Path) -> Iterator[str]:
    shutil.copy(packaged("testbed.dbc"), folder)
    good = packaged().read_text(encoding="utf-8")
    for old, new in (
        ("radius: 72 mm", "radius: 72 mN"),
        ("radius: 72 mm", "radius: -72 mm"),
        ("radius: 72 mm", "radios: 72 mm"),
        ("  sinkage_pot:", "  sinkage_post:"),
        ("testbed: single", "testbed: 'single"),
    ):
        assert old in good
        (folder / "bad.yaml").write_text(good.replace(old, new, 1), encoding="utf-8")
        yield f"# {old} -> {new}"
        yield from said(folder, "check-config", "bad.yaml")


@output
def wrong_tables(folder: Path) -> Iterator[str]:
    rows = table(folder)
    (folder / "map.yaml").write_text(MAP)
    without = "\n".join(line.rpartition(",")[0] + ",nan" for line in rows.splitlines()[1:])
    for name, content in (
        ("photo.csv", b"t,v\n\xff\x00\x01,2\n"),
        ("header.csv", b"t,rpm,v,M\n"),
        ("word.csv", rows.replace("\n0.06,10.0,60.0,", "\n0.06,10.0,60.0,broken", 1).encode()),
        ("other.csv", rows.replace("rpm", "w", 1).encode()),
        ("nan.csv", f"t,rpm,v,M\n{without}\n".encode()),
    ):
        (folder / name).write_bytes(content)
        yield from said(folder, "import", "csv", name, "--map", "map.yaml", "-o", "out")

    still = {"t": TIMES, "rpm": 10 + TIMES, "v": 60 + TIMES, "M": np.full(TIMES.size, 3.1)}
    np.savez(folder / "still.npz", **still)
    yield from said(folder, "import", "csv", "still.npz", "--map", "map.yaml", "-o", "out")


@output
def wrong_maps(folder: Path) -> Iterator[str]:
    table(folder)
    yield from said(folder, "import", "csv", "run.csv", "-o", "out")
    yield from said(folder, "import", "csv", "none.csv", "--map", "map.yaml", "-o", "out")
    for old, new in (
        ("load: 50 N", "runs: {other: {load: 3 N}}"),
        ("wheel: {radius: 72 mm, width: 71 mm}", ""),
        ("  v:", "  # v:"),
        ("unit: rpm", "unit: rmp"),
        ("channel: torque", "channel: tork"),
    ):
        (folder / "map.yaml").write_text(MAP.replace(old, new))
        yield f"# {old} -> {new}"
        yield from said(folder, "import", "csv", "run.csv", "--map", "map.yaml", "-o", "out")


@output
def import_of_a_table(folder: Path) -> Iterator[str]:
    table(folder)
    (folder / "map.yaml").write_text(MAP)
    yield from said(folder, "import", "csv", "run.csv", "--guess")
    yield from said(folder, "import", "csv", "run.csv", "--map", "map.yaml", "-o", "out")


@output
def wrong_diagnoses(folder: Path) -> Iterator[str]:
    for name in ("testbed.yaml", "testbed.dbc"):
        shutil.copy(packaged(name), folder)
    list(simulated(folder, 60.0))
    shutil.copy(folder / "run-60.mcap", folder / "copy.mcap")
    given = ("--config", "testbed.yaml")
    yield from said(folder, "diagnose", "run-60.mcap", "copy.mcap", *given)
    yield from said(folder, "diagnose", "run-60.mcap", *given, "--bed", "same")
    address = "tcp://127.0.0.1:9999"
    yield from said(folder, "diagnose", "run-60.mcap", *given, "--scheduler", address)
    yield from said(folder, "diagnose", "run-60.mcap", *given, "--json", "run-60.mcap")


@output
def wrong_rigs(folder: Path) -> Iterator[str]:
    """Files of known rigs that are not what they should be."""
    log = folder / "f-d-large-box__force-displacement_1.ft.csv"
    log.write_text("# zero offsets: 0.1,0.2,0.3,0.4,0.5,0.6\n# time,Fx,Fy,Fz,Tx,Ty,Tz\n")
    log.with_name(log.name.replace(".ft.csv", ".rig.txt")).write_text("1,2,3,4,5,6,7\n")
    yield from said(folder, "import", "cmu", ".", "-o", "out")
    log.unlink()

    values = {"t": np.arange(5.0), "qm": np.zeros(4), "gtau": 35.0, "vir": np.zeros(5)}
    for rig, name in (("emps", "DATA_EMPS.mat"), ("cmu", "all_smooth_data.mat")):
        (folder / name).write_bytes(b"no MATLAB file at all, and too short for one" * 10)
        yield from said(folder, "import", rig, ".", "-o", "out")
        savemat(folder / name, values)
        yield from said(folder, "import", rig, ".", "-o", "out")


@output
def wrong_calibrations(folder: Path) -> Iterator[str]:
    bench.rig(folder)
    time, physical = bench.staircase([0.0, 0.01, 0.02])
    volts = bench.noisy(physical / 0.025, 2e-3, 1)
    run = bench.record(folder / "r.mcap", {"sinkage_pot": (time, volts)})
    (folder / "p.txt").write_text("Force, depth\n1,2\n")
    known = ("--known", "0, 1 mm")

    for kind, *arguments in (
        ("pot", "--known", "0, 10 mm"),
        ("pot",),
        ("pot", "--step", "x"),
        ("pot", "--step", "90-95=3 mm"),
        ("shunt", "--known", "0, 1 A"),
        ("pot", *known, "--apply", "testbed.yaml"),
    ):
        given = ("--config", "testbed.yaml", "--from", run.name)
        yield from said(folder, "calibrate", kind, *given, *arguments)
    yield from said(folder, "calibrate", "soil", "p.txt", "--config", "testbed.yaml")
