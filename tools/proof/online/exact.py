"""How well a fit could know c that knows the form of the stresses exactly: the Cramér-Rao bound of
the steady parts of a bench's tables, with the plant's own equations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gritd.tools.proof.blind.plant.contact import PlantSoil, Rim, reaction
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.online.draw import Bench
from gritd.tools.proof.online.drive import CHANGING, STILL, SimulatedTable

STEP = 1e-4
PRIOR = (1000.0, 0.15, 0.5)  # σ of c [Pa], tan φ and ln k in the template of an import


class SteadyCondition(NamedTuple):
    """One condition: means over so many rows, SI."""

    theta_1: float
    slip: float
    load: float
    rows: int
    seconds: float


def sigma_of_c(bench: Bench, tables: list[SimulatedTable]) -> float:
    """[Pa]."""
    information = np.diag(np.square(1.0 / np.array(PRIOR)))
    for run, table in zip(bench.runs, tables, strict=True):
        edge = STILL + CHANGING
        for part in run.parts:
            steady = _steady(bench, table, edge + 3.0 * bench.lag, part.duration, part.slip)
            edge = edge + part.duration if edge > STILL + CHANGING else part.duration + CHANGING
            if steady is not None:
                information = information + _information(bench, steady)
    return float(np.sqrt(np.linalg.inv(information)[0, 0]))


def _steady(
    bench: Bench, table: SimulatedTable, begin: float, duration: float, slip: float
) -> SteadyCondition | None:
    end = begin + duration - CHANGING - 3.0 * bench.lag - 0.2
    inside = (table.time >= begin) & (table.time < end)
    if np.count_nonzero(inside) < 3:
        return None
    depth = float(table.sinkage[inside].mean())
    return SteadyCondition(
        float(np.arccos(1.0 - depth / bench.radius)),
        slip,
        float(table.load[inside].mean()),
        int(np.count_nonzero(inside)),
        end - begin,
    )


def _information(bench: Bench, at: SteadyCondition) -> Array:
    ground = bench.ground
    x = np.array([ground.cohesion, ground.tan_phi, np.log(ground.shear_modulus)])
    J = _slopes(lambda y: _forces(bench, y, at), x)

    # of θ₁ by z, of slip, of W
    inputs = np.array([at.theta_1, at.slip, at.load])
    by_inputs = _slopes(lambda y: _forces(bench, x, at._replace(
        theta_1=float(y[0]), slip=float(y[1]), load=float(y[2])
    )), inputs)  # fmt: skip
    noise, rows = bench.noise, at.rows
    wheel = bench.speed / (1.0 - at.slip) / bench.radius
    slope = np.sqrt(12.0 / rows) / at.seconds
    slip = (1.0 - at.slip) * slope * np.hypot(noise.angle / wheel, noise.travel / bench.speed)
    sinkage = noise.sinkage / np.sqrt(rows) / (bench.radius * np.sin(at.theta_1))
    spread = np.array([sinkage, slip, noise.force / np.sqrt(rows)])

    own = np.diag(np.square([noise.torque, noise.force])) / rows
    R = own + (by_inputs * spread**2) @ by_inputs.T
    kept = [n for n, has in enumerate((bench.stratum != "pull", bench.pull)) if has]
    J, R = J[kept], R[np.ix_(kept, kept)]
    return np.asarray(J.T @ np.linalg.solve(R, J))


def _forces(bench: Bench, x: Array, at: SteadyCondition) -> Array:
    """Torque and drawbar pull (2,) under the load: stresses are linear in c and in K."""
    c, tan_phi, k = float(x[0]), float(x[1]), float(np.exp(x[2]))
    n, rim = bench.ground.exponent, Rim(peak=bench.c1 + bench.c2 * at.slip)

    def of(cohesion: float, modulus: float) -> Array:
        felt = reaction(
            PlantSoil(cohesion, tan_phi, k, n, modulus),
            rim,
            bench.radius,
            bench.width,
            np.array([1.0 - at.slip]),
            np.array([at.theta_1]),
        )
        return np.array([felt.torque[0], felt.pull[0], felt.load[0]])

    cohesive, bearing = of(c, 0.0), of(0.0, 1.0)
    scale = (at.load - cohesive[2]) / bearing[2]
    return np.asarray((cohesive + scale * bearing)[:2])


def _slopes(function: object, x: Array) -> Array:
    """(2, n) by differences."""
    columns = []
    for n in range(x.size):
        step = np.zeros(x.size)
        step[n] = STEP * max(abs(float(x[n])), 1e-3)
        high, low = function(x + step), function(x - step)  # type: ignore[operator]
        columns.append((high - low) / (2.0 * step[n]))
    return np.array(columns).T
