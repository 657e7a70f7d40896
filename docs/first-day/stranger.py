"""Six runs of a wheel testbed, in files as the logger of another laboratory writes them.

It knows nothing of recordings, channels or SI: milliseconds, revolutions per minute, millimetres,
and a load cell that pushes upward. The wheel is simulated by Eqs. (1)-(10) in a soil that the
configuration does not know, with a Coulomb friction in the drive that gritd does not know of.
"""

from pathlib import Path

import numpy as np

import gritd

LOADS = (40.0, 55.0, 70.0, 85.0, 100.0, 115.0)  # [N], one a run
SLIPS = (0.1, 0.25, 0.4, 0.6)
SOIL = {"cohesion": 1200.0, "tan_phi": 0.55}  # [Pa], [-]
FRICTION = {"coulomb_friction": {"loss": 0.05}}  # [N·m]
EVERY = 5  # of 250 rows a second one in five is written
HEAD = "t_ms,wheel_rpm,cart_mm_s,depth_mm,motor_A,Fx_N,Fz_N"


def run(load: float, seed: int) -> np.ndarray:
    """The table of a run (n, 7): four slips, five seconds each, after two seconds at rest."""
    rest = {"duration": 2.0, "load": load, "slip": SLIPS[0], "speed": 0.0}
    driven = [{"duration": 5.0, "load": load, "slip": slip, "speed": 0.02} for slip in SLIPS]
    made = gritd.simulate("bench/testbed.yaml", [rest, *driven], soil=SOIL, effects=FRICTION)

    motion, felt = made.motion, made.truth.sensed
    columns = (  # in the units of the file, with the noise of each sensor
        (motion.time, 1e3, 0.0),
        (motion.wheel_speed, 30.0 / np.pi, 0.01),
        (motion.carriage_speed, 1e3, 0.05),
        (felt.sinkage, 1e3, 0.05),
        (felt.current, 1.0, 0.004),
        (felt.drawbar_pull, 1.0, 0.3),
        (felt.load, -1.0, 0.3),
    )
    noise = np.random.default_rng(seed)
    table = np.column_stack([np.asarray(values)[::EVERY] * unit for values, unit, _ in columns])
    return table + noise.normal(size=table.shape) * [sigma for _, _, sigma in columns]


Path("stranger").mkdir()
for seed, load in enumerate(LOADS):
    rows = run(load, seed)
    place = f"stranger/run-{load:03.0f}N.csv"
    np.savetxt(place, rows, "%.0f,%.3f,%.3f,%.3f,%.4f,%.2f,%.2f", header=HEAD, comments="")
    print(place, len(rows), "rows")
