"""A rig, a soil and a run that the tests of the plant share."""

import numpy as np

from gritd.tools.proof.blind.plant.contact import PlantSoil
from gritd.tools.proof.blind.plant.effect import Facts
from gritd.tools.proof.blind.plant.respond import Commanded, World
from gritd.tools.proof.blind.plant.scene import TrueRig
from gritd.tools.proof.blind.plant.servo import Servo

RIG = TrueRig(0.072, 0.071, 2.0, Servo(8e-4, 100.0, 0.05), Servo(5.0, 2e4, 0.1), 0.1)
GROUND = PlantSoil(1000.0, 0.577, 0.025, 1.1, 1.536e6)
WORLD = World(RIG, GROUND)
FACTS = Facts(
    duration=16.0,
    length=0.3,
    radius=0.072,
    weight=65.0,
    omega=0.3,
    torque=1.5,
    current=0.75,
    sinkage=0.008,
)


def run(rate: float = 50.0, passes: int = 2) -> Commanded:
    """Rest, four slips at 65 N and two speeds, backward at the end."""
    time = np.arange(int(16 * rate)) / rate
    edges = (0, 2, 2.5, 5.5, 6, 9.5, 10, 12.5, 13, 16)
    slip = np.interp(time, edges, (0.1, 0.1, 0.1, 0.1, 0.4, 0.4, 0.2, 0.2, 0.2, 0.2))
    omega = np.interp(time, edges, (0, 0, 0.3, 0.3, 0.3, 0.3, 0.6, 0.6, -0.3, -0.3))
    return Commanded(
        time, omega, omega * RIG.radius * (1 - slip), np.full(time.size, 65.0), passes, 0.0
    )
