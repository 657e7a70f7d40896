"""The vertical balance: the entry angle θ₁ at which the soil of Eqs. (1)-(9) carries the load."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.compiled import balancing
from gritd.estimator.stages.situation import ContactLaw
from gritd.estimator.terramechanics.original import (
    OriginalForces,
    forces,
    janosi,
    nodes,
    velocity_ratio,
)
from gritd.estimator.terramechanics.soil import Array, Scalar, Soil, Wheel

# nodes a zone: W, DP and T/r within 3e-7 of W when driving, 2e-5 down to 10 % braking
# (test_forward.py)
ORDER = 8
TOLERANCE = 1e-9  # relative difference of W from the load at which θ₁ is accepted
FINE = 1e-11  # the same from a solution near by: differences between the two mean something
CHUNK = 1024  # samples solved together: their nodes stay in the processor's cache
DEEPEST = 1.5  # [rad] a wheel sunk to its axle is bogged; θ₁ stops here and the sample is flagged
TOP = np.log(DEEPEST)
SHALLOWEST = 1e-5  # [rad] a lighter touch is no contact
ROUNDS = 60


Index = NDArray[np.intp]
Bools = NDArray[np.bool_]


class Contact(NamedTuple):
    """One set of samples: each field a float or an array (n,)."""

    soil: Soil
    law: ContactLaw
    slip: Scalar
    load: Scalar


class Balance(NamedTuple):
    theta_1: Array  # [rad]
    forces: OriginalForces  # at θ₁, each (n,)
    overloaded: Bools  # the load exceeds what the soil carries; forces are those at DEEPEST
    slope: Array  # d ln W / d ln θ₁ as the steps to θ₁ saw it


def rim_forces(
    wheel: Wheel, contact: Contact, theta_1: Array, order: int = ORDER
) -> OriginalForces:
    """Forces of Eqs. (8)-(10) under the contact law at θ₁ (n,) [rad]; θₘ and θ₂ keep their ratio
    to θ₁.
    """
    soil, law = contact.soil, contact.law
    cohesion = soil.cohesion * law.strength * law.adhesion
    tan_phi = soil.tan_phi * law.strength * law.friction

    return forces(
        wheel,
        replace(soil, cohesion=cohesion, tan_phi=tan_phi),
        theta_1,
        contact.slip,
        theta_m=np.clip(law.theta_m_ratio, 0.0, 1.0) * theta_1,
        theta_2=-law.theta_2_ratio * theta_1,
        mobilisation=law.mobilisation,
        side_slip=law.side_slip,
        by_sliding=law.by_sliding,
        across=law.across,
        order=order,
    )


def solve(
    wheel: Wheel, contact: Contact, near: Balance | None = None, order: int = ORDER
) -> Balance:
    """θ₁ with W(θ₁) = load at every sample, and the forces there.

    near: a solution for nearby parameters, to start from. Then the last step may be a secant's:
    forces by a straight line through the last two that were integrated.
    """
    load = np.asarray(contact.load, dtype=float)
    parts = [slice(start, start + CHUNK) for start in range(0, load.size, CHUNK)]
    solved = [
        _solve_chunk(wheel, _take(contact, s), near and part_of(near, s), order) for s in parts
    ]

    return Balance(
        np.concatenate([part.theta_1 for part in solved]),
        OriginalForces(*map(np.concatenate, zip(*(part.forces for part in solved), strict=True))),
        np.concatenate([part.overloaded for part in solved]),
        np.concatenate([part.slope for part in solved]),
    )


def part_of(near: Balance, at: slice) -> Balance:
    """Some of the samples of a solution."""
    forces = OriginalForces(*(force[at] for force in near.forces))
    return Balance(near.theta_1[at], forces, near.overloaded[at], near.slope[at])


def _solve_chunk(wheel: Wheel, contact: Contact, near: Balance | None, order: int) -> Balance:
    load = np.asarray(contact.load, dtype=float)
    if near is None:
        theta_1 = bekker_entry_angle(wheel, contact.soil, load)
        slope = 2.0 * np.asarray(contact.soil.exponent) + 1.0
    else:
        theta_1, slope = near.theta_1, near.slope

    out = np.zeros((3 + len(OriginalForces._fields), load.size))
    out[-1] = 1.0
    touching = np.flatnonzero(load > 0.0)
    if touching.size:
        guess, steep = (np.broadcast_to(a, load.shape)[touching] for a in (theta_1, slope))
        ways = _compiled if balancing.BUILT and _is_original(contact.law) else _iterate
        solved = ways(wheel, _take(contact, touching), guess, steep, order, near is not None)
        out[:, touching] = np.vstack(
            (solved.theta_1, *solved.forces, solved.overloaded, solved.slope)
        )
    return Balance(out[0], OriginalForces(*out[1:-2]), out[-2] > 0.0, out[-1])


def _is_original(law: ContactLaw) -> bool:
    """Whether the stress is that of the paper, under a wheel that points where it goes."""
    return law.mobilisation is janosi and not np.any(law.side_slip)


def _compiled(
    wheel: Wheel, contact: Contact, guess: Array, slope: Array, order: int, near: bool
) -> Balance:
    """What `_iterate` finds, by C: estimator/compiled/balance.c."""
    soil, law = contact.soil, contact.law
    of_samples = (
        soil.cohesion * law.strength * law.adhesion,
        soil.tan_phi * law.strength * law.friction,
        soil.shear_modulus,
        soil.exponent,
        soil.modulus,
        np.clip(law.theta_m_ratio, 0.0, 1.0),
        law.theta_2_ratio,
        velocity_ratio(contact.slip),
        contact.load,
        guess,
        slope,
    )
    given = np.stack(np.broadcast_arrays(*of_samples))

    found, fine = np.empty((7, guess.size)), FINE if near else 0.0
    ends = SHALLOWEST, DEEPEST, TOLERANCE, fine, ROUNDS
    balancing.solve(given, found, nodes(order), guess.size, order, wheel.radius, wheel.width, *ends)
    theta_1, pull, load, torque, resistance, overloaded, steepness = found
    forces = OriginalForces(pull, load, torque, resistance, np.zeros(guess.size))
    return Balance(theta_1, forces, overloaded > 0.0, steepness)


def _iterate(
    wheel: Wheel, contact: Contact, guess: Array, slope: Array, order: int, near: bool
) -> Balance:
    """Secant steps on ln W against ln θ₁, which is nearly straight with slope 2n + 1, kept inside a
    bracket.

    near: the last step may be taken without integrating again.
    """
    solution, steepness = np.empty(guess.size), np.empty(guess.size)
    kept, overloaded = (
        np.empty((len(OriginalForces._fields), guess.size)),
        np.zeros(guess.size, dtype=bool),
    )
    left = np.arange(guess.size)  # samples not yet solved
    x = np.log(np.clip(guess, 10.0 * SHALLOWEST, DEEPEST))

    low, high = np.full(x.size, np.log(SHALLOWEST)), np.full(x.size, np.inf)
    before = np.full((2 + len(kept), x.size), np.nan)  # the last x, its miss and its forces
    for _ in range(ROUNDS):
        forces = rim_forces(wheel, contact, np.exp(x), order)
        miss = _miss(forces, contact)
        change = x - before[0]
        slope = _slope(slope, change, miss - before[1])
        low, high = np.where(miss < 0.0, x, low), np.where(miss > 0.0, x, high)
        bogged = low >= TOP

        here, done = np.vstack((x, miss, *forces)), np.abs(miss) <= (FINE if near else TOLERANCE)
        if near:
            here, straight = _extrapolated(here, before, slope)
            done |= straight
        solution[left], kept[:, left], steepness[left] = here[0], here[2:], slope
        overloaded[left] = bogged & (miss < -TOLERANCE)

        rest = np.flatnonzero(~done & (high - low > 1e-15) & ~bogged)
        if not rest.size:
            break
        before = here[:, rest]
        x = _ahead(before[0] - before[1] / slope[rest], low[rest], high[rest])
        left, contact, slope, low, high = (
            left[rest],
            _take(contact, rest),
            slope[rest],
            low[rest],
            high[rest],
        )

    return Balance(np.exp(solution), OriginalForces(*kept), overloaded, steepness)


def _extrapolated(here: Array, before: Array, slope: Array) -> tuple[Array, Bools]:
    """x, miss and forces (k, n) a secant's step on, where that is off by less than FINE; and where
    that is.

    A straight line through two points is off beyond them by half the curvature times the product of
    the distances; ln W has a curvature of about 1.
    """
    change, step = here[0] - before[0], -here[1] / slope
    done = (np.abs(step) < np.abs(change)) & (np.abs(step * change) < FINE)
    ratio = np.where(done, step / np.where(done, change, 1.0), 0.0)
    return here + np.where(done, ratio * (here - before), 0.0), done


def _ahead(step: Array, low: Array, high: Array) -> Array:
    """The step, no deeper than TOP; where it leaves the bracket, the middle of the bracket."""
    step = np.minimum(step, TOP)
    return np.where((step > low) & (step < high), step, 0.5 * (low + np.minimum(high, TOP)))


def _miss(forces: OriginalForces, contact: Contact) -> Array:
    """ln(W/load); where the soil would pull the wheel down, a large negative number."""
    miss: Array = np.log(np.maximum(forces.load / contact.load, 1e-30))
    return miss


def _slope(slope: Array, step: Array, change: Array) -> Array:
    """Secant slope where it is defined and plausible, else the one before."""
    with np.errstate(divide="ignore", invalid="ignore"):
        secant = change / step
    return np.where((secant > 0.2) & (secant < 20.0), secant, slope)


def bekker_entry_angle(wheel: Wheel, soil: Soil, load: Array) -> Array:
    """First guess of θ₁ (n,) [rad] under a load (n,) [N], without shear: z = [3W/((3 − n) b K
    √(2r))]^(2/(2n + 1)), Bekker (1969).
    """
    n = np.minimum(soil.exponent, 2.5)
    carried = (3.0 - n) * wheel.width * np.asarray(soil.modulus) * np.sqrt(2.0 * wheel.radius)
    sinkage = (3.0 * np.maximum(load, 0.0) / carried) ** (2.0 / (2.0 * n + 1.0))
    angle: Array = np.arccos(np.clip(1.0 - sinkage / wheel.radius, np.cos(DEEPEST), 1.0))
    return angle


def _take(contact: Contact, index: slice | Index) -> Contact:
    """The same contact at some of its samples; what is one float for all stays so."""
    soil, law = contact.soil, contact.law

    return Contact(
        Soil(
            *(
                _at(v, index)
                for v in (
                    soil.cohesion,
                    soil.tan_phi,
                    soil.shear_modulus,
                    soil.exponent,
                    soil.modulus,
                )
            )
        ),
        ContactLaw(
            _at(law.theta_m_ratio, index),
            _at(law.theta_2_ratio, index),
            _at(law.strength, index),
            _at(law.adhesion, index),
            _at(law.friction, index),
            _at(law.side_slip, index),
            law.by_sliding,
            law.across,
            law.mobilisation,
        ),
        _at(contact.slip, index),
        _at(contact.load, index),
    )


def _at(value: Scalar, index: slice | Index) -> Scalar:
    return value[index] if isinstance(value, np.ndarray) and value.ndim else value
