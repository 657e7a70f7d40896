"""What a bench hands over: tables, their map, and what is stated of the form. Truth stays out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from gritd.config import packaged
from gritd.tools.proof.online.draw import Bench
from gritd.tools.proof.online.drive import SimulatedTable

MAP, CONFIGURATION = "map.yaml", "stated.yaml"
DIGITS = {"time": 4, "wheel": 4, "carriage": 4, "sinkage": 4, "pull": 4, "load": 4, "torque": 5}


def write(bench: Bench, tables: list[SimulatedTable], folder: Path) -> None:
    """run_1.csv …, map.yaml, and stated.yaml where something is stated, in a new folder."""
    folder.mkdir(parents=True)
    for number, table in enumerate(tables, 1):
        _write_table(bench, table, folder / f"run_{number}.csv")
    (folder / MAP).write_text(yaml.safe_dump(_map(bench), sort_keys=False), encoding="utf-8")
    if bench.stratum == "stated":
        (folder / CONFIGURATION).write_text(_stated(bench), encoding="utf-8")


def _write_table(bench: Bench, table: SimulatedTable, path: Path) -> None:
    columns = {
        "time": table.time,
        "wheel": np.degrees(table.angle),
        "carriage": 1e3 * table.travel,
        "sinkage": 1e3 * table.sinkage,
    }
    if bench.pull:
        columns["pull"] = table.pull
    if not bench.weighed:
        columns["load"] = table.load
    if bench.stratum != "pull":
        columns["torque"] = table.torque
    np.savetxt(
        path,
        np.column_stack(list(columns.values())),
        delimiter=",",
        header=",".join(columns),
        comments="",
        fmt=[f"%.{DIGITS[name]}f" for name in columns],
    )


def _map(bench: Bench) -> dict[str, Any]:
    columns = {
        "time": {"channel": "time", "unit": "s"},
        "wheel": {"channel": "wheel_angle", "unit": "deg"},
        "carriage": {"channel": "carriage_position", "unit": "mm"},
        "sinkage": {"channel": "sinkage", "unit": "mm"},
    }
    if bench.pull:
        columns["pull"] = {"channel": "drawbar_pull", "unit": "N"}
    if not bench.weighed:
        columns["load"] = {"channel": "load", "unit": "N"}
    if bench.stratum != "pull":
        torque = "motor_torque" if bench.motor else "torque"
        columns["torque"] = {"channel": torque, "unit": "N*m"}

    loads = {
        f"run_{number}.csv": {"load": f"{run.parts[0].load:.2f} N"}
        for number, run in enumerate(bench.runs, 1)
    }
    wheel = {"radius": f"{1e3 * bench.radius:.2f} mm", "width": f"{1e3 * bench.width:.2f} mm"}
    return {"columns": columns, "wheel": wheel, "runs": loads}


def _stated(bench: Bench) -> str:
    """The template of an import, with the form of the stresses as it is."""
    text = packaged("rig_csv.yaml").read_text(encoding="utf-8")
    filled = text.replace("$radius", f"{bench.radius!r}").replace("$width", f"{bench.width!r}")
    document: dict[str, Any] = yaml.safe_load(filled)
    document["wheel"] |= {"c1": bench.c1, "c2": bench.c2}
    document["soil"] |= {
        "exponent": float(bench.ground.exponent),
        "k_phi": f"{float(bench.ground.modulus)!r} N/m^(n+2)",
        "modulus_sigma": "1 %",
    }
    return yaml.safe_dump(
        document, sort_keys=False, allow_unicode=True, explicit_start=True, explicit_end=True
    )
