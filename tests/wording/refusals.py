"""What a user reads whose configuration is refused, and what `--guess` proposes and asks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.tools.importers.series import csv_text
from gritd.tools.importers.series.guess import guessed
from gritd.tools.importers.series.sources import read
from tests.estimator.config.rig import MINIMAL, changed, message
from tests.wording.rig import output

REPLACED = (
    ("radius: 72 mm", "radius: -72 mm"),
    ("radius: 72 mm", "radius: 72"),
    ("radius: 72 mm", "radius: 72 N"),
    ("radius: 72 mm", "radius: .nan"),
    ("radius: 72 mm", "radius: .inf m"),
    ("radius: 72 mm", "radius: [72 mm]"),
    ("radius: 72 mm", "radius: "),
    ("radius: 72 mm", "raduis: 72 mm"),
    ("radius: 72 mm", "radius: 72 mm, radius: 73 mm"),
    ("width: 71 mm", "width: 0 mm"),
    ("tan_phi: 0.6", "tan_phi: [0.6]"),
    ("scale: 25 mm/V", "scale: 0 mm/V"),
    ("scale: 25 mm/V", "scale: {value: 25 mm/V, sigma: 26 mm/V}"),
    ("radius: 72 mm", 'radius: ""'),
    ("pulley_radius: 20 mm\n", ""),
    ("sigma: 300 Pa", "sigma: -300 Pa"),
    ("sigma: 300 Pa", "sigma: 300 N"),
    (", sigma: 300 Pa", ""),
    ("tan_phi: 0.6", "tan_phi: 30 deg"),
    ("tan_phi: 0.6", "tan_phi: 6e1"),
    ("tan_phi: 0.6", "tan_phi: '0.6'"),
    ("tan_phi: 0.6", "tan_phi: 2.0"),
    ("tan_phi: 0.6", "tan_phi: no"),
    ("tan_phi: 0.6", "tan_phi: 1:30"),
    ("  k1: 0 kPa\n", ""),
    ("  k1: 0 kPa\n  k2: 1500 kN/m^3\n", ""),
    ("  k1: 0 kPa\n", "  k1: 0 kPa\n  k_c: 0 kN/m^(n+1)\n"),
    ("k2: 1500 kN/m^3", "k2: -1500 kN/m^3"),
    ("load: {nominal: 70 N}", "load: {nominal: 4 N}"),
    ("kind: serial", "kind: serail"),
    ("kind: serial, ", ""),
    ("port: /dev/ttyACM0", "port: 3"),
    ("port: /dev/ttyACM0", "port: /dev/ttyACM0, baud: 12.5"),
    ("kind: serial, port: /dev/ttyACM0", "kind: can"),
    ("device: rig, signal: wheel", "device: rigg, signal: wheel"),
    ("scale: 25 mm/V", "scale: 25 A/V"),
    (
        "z, scale: 25 mm/V, noise: 2 mV, range: [0 V, 5 V]",
        "z, scale: 25 mm/V, noise: 2 mV, range: [5 V, 0 V]",
    ),
    ("scale: 2 A/V, noise: 2 mV", "scale: 2 A/V, noise: 2 mV, latency: 60 ms"),
    ("25 mm/V, noise: 2 mV", "25 mm/V, noise: 0 mV"),
    ("25 mm/V, noise: 2 mV", "25 mm/V, noise: 1e-200 V"),
    ("0.1 mrad/count, noise: 0.3 count", "0.1 mrad/count, noise: 0 count"),
    ("0.1 mrad/count, noise", "0.1 mrad/count, range: [0 count, 9 count], noise"),
    ("25 mm/V, noise", "25 mm/V, max_rate: 3 V/s, noise"),
    (
        "drive: {torque_constant: 2 N*m/A}",
        "drive: {torque_constant: 2 N*m/A, torque_source: wrench}",
    ),
    ("testbed: bench", "testbed: off"),
    ("testbed: bench", "testbed: *x"),
    ("testbed: bench", "testbed: &x bench"),
    ("testbed: bench", "testbed: !!python/object/apply:os.system [echo]"),
    ("testbed: bench", "testbed: !x bench"),
    ("testbed: bench", "testbed: 'bench"),
    ("testbed: bench", "testbed: bench\n<<: {wheel: 1}"),
    ("testbed: bench", "? [a]\n: b"),
)
APPENDED = (
    "rates: {tick: 250 Hz, update: 12 Hz}",
    "rates: {tick: 10 Hz, update: 10 Hz}",
    "rates: {horizon: 5 s}",
    "rates: {horizon: 0 s}",
    "filter: {cohesion_bounds: [9 kPa, 1 kPa]}",
    "filter: {cohesion_bounds: [9 kPa]}",
    "filter: {engine: plane}",
    "logging: {compression: off}",
    "logging: {directory: }",
    "effects: {bulldozing: [1]}",
    "effects: {bulldozing: {share: 1 parsec}}",
    "effects: {stress_linearisation: {share: 7}}",
    "effects: {stress_linearisation: {share: {value: -1, sigma: 0}}}",
    "efects: {}",
    "run: {pass: 0}",
    "---\na: 1",
    "\u0007",
)
NO_NOISE = (
    ("force_noise: 0.3 N", "force_noise: 0 N"),
    ("torque_noise: 20 mN*m", "torque_noise: 0 mN*m"),
)
REQUIRED = ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt")


@output
def refused_configurations(folder: Path) -> Iterator[str]:
    for old, new in REPLACED:
        yield from (f"# {old!r} -> {new!r}", message(changed(old, new)))
    for tail in APPENDED:
        yield from (f"# and {tail!r}", message(f"{MINIMAL}{tail}\n"))
    for name in REQUIRED:
        lines = [line for line in MINIMAL.splitlines(True) if not line.startswith(f"  {name}")]
        yield from (f"# without {name}", message("".join(lines)))
    testbed = packaged().read_text(encoding="utf-8")
    for old, exact in NO_NOISE:
        yield from (f"# {old!r} -> {exact!r}", message(changed(old, exact, testbed)))
    yield from ("# a beginning without an end", message(f"---\n{MINIMAL}"))


RISING = [0.02 * x for x in range(50)]
NOISE = [3.0 + 0.1 * (x * 7 % 5) for x in range(50)]
DAYS = [f"{739_580.5 + x / 86_400 / 50:.11f}" for x in range(50)]
TABLES: dict[str, dict[str, list[float] | list[str]]] = {
    "a column that rises evenly": {"qx": RISING, "wheel": NOISE},
    "the number of a row": {"qx": [float(x) for x in range(50)], "wheel": NOISE},
    "times of no unit": {"t": [float(x) for x in range(50)], "wheel": NOISE},
    "times by 20": {"t": [20.0 * x for x in range(50)], "wheel": NOISE},
    "seconds since 1970": {"stamp": [f"{1.795e9 + 0.02 * x:.6f}" for x in range(50)], "v": NOISE},
    "milliseconds since 1970": {
        "stamp": [f"{1.795e12 + 20 * x:.3f}" for x in range(50)],
        "v": NOISE,
    },
    "days of MATLAB": {"t": DAYS, "wheel rpm": NOISE, "cart mm/s": NOISE},
    "dates": {"time": [f"2026/11/26/14:03:{x / 50 + 5:09.6f}" for x in range(50)], "v": NOISE},
    "day or month": {
        "time": [f"03/04/2026 14:03:{x / 50 + 5:09.6f}" for x in range(50)],
        "v": NOISE,
    },
    "no dates": {"time": [f"kw 47 tag {x}" for x in range(50)], "v": NOISE},
    "constants": {
        "t": RISING,
        "wheel rpm": [12.0] * 50,
        "cart mm/s": [60.0] * 50,
        "load [N]": [60.0] * 50,
    },
    "negative": {
        "t": RISING,
        **{n: [-x for x in NOISE] for n in ("Fz [N]", "sinkage [mm]", "motor current [A]")},
    },
    "other units": {"t": RISING, "load [kg]": NOISE, "x [in]": NOISE},
    "two torques": {
        "time_s": RISING,
        "wheel rpm": NOISE,
        "cart mm/s": NOISE,
        "axle torque [Nm]": NOISE,
        "torque [lbf-in]": NOISE,
    },
    "what wraps, and a height": {
        "t [s]": [at / 50 for at in range(500)],
        "wheel [deg]": [(3.0 * at) % 360.0 for at in range(500)],
        "cart counts": [float(97 * at % 4096) for at in range(500)],
        "laser [mm]": NOISE * 10,
    },
}


@output
def guesses(folder: Path) -> Iterator[str]:
    for title, columns in TABLES.items():
        yield from _proposed(title, _table(folder / "run.csv", columns))

    one = _table(folder / "one.csv", {"Zeit [s]": RISING, "Zugkraft [N]": NOISE})
    two = _table(folder / "two.csv", {"Zeit [s]": RISING, "Einsinkung [mm]": NOISE})
    yield from _proposed("a column that another file lacks", one, two)

    arrays = {"/drive/state.velocity": np.array(NOISE), "/odom.x": np.array(RISING)}
    arrays |= {f"/odom.covariance[{at}]": np.zeros(50) for at in range(36)}
    np.savez(folder / "run.npz", **arrays)
    yield from _proposed("topics", *read(folder / "run.npz"))


def _table(path: Path, columns: dict[str, list[float] | list[str]]) -> csv_text.SeriesTable:
    shown = [[x if isinstance(x, str) else f"{x:g}" for x in c] for c in columns.values()]
    rows = [",".join(columns), *map(",".join, zip(*shown, strict=True))]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return csv_text.read(path)


def _proposed(title: str, *tables: csv_text.SeriesTable) -> Iterator[str]:
    """The lines of the columns, and what is asked."""
    text = guessed(tables).partition("columns:\n")[2].partition("\n# Without --config")[0]
    yield from (f"--- {title} ---", text)
