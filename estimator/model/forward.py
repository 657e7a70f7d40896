"""The forward model: measured motion, load, soil and effects in; sinkage, forces, current and
readings out.

    motion → soil → contact → load → vertical balance → wheel → testbed → drivetrain → sensors

Every stage starts from the paper's model and passes through the effects in turn; without effects it
is the paper's.
Arrays in, arrays out: all fields (n,), one run in order of time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from gritd.estimator.effects import in_order
from gritd.estimator.effects.base import Effect
from gritd.estimator.model import balance
from gritd.estimator.model.correction import Correction
from gritd.estimator.stages.situation import (
    Balanced,
    Complete,
    ContactLaw,
    Loaded,
    Motion,
    OnSoil,
    Powered,
    Reaction,
    Sensed,
    Situation,
    advanced,
    situation_of,
)
from gritd.estimator.terramechanics.original import OriginalForces
from gritd.estimator.terramechanics.soil import Array, Scalar, Soil, Wheel

# at most; current and torque factor depend on each other and settle in a few rounds
HEATING_ROUNDS = 30


@dataclass(frozen=True)
class Response:
    """What the testbed does, each field (n,); `sensed` is what its channels read."""

    slip: Array  # true i [-]
    theta_1: Array  # [rad]
    overloaded: balance.Bools  # the load exceeds what the soil carries: see Balance
    sinkage: Array  # of the axle [m]
    drawbar_pull: Array  # [N]
    load: Array  # [N]
    torque: Array  # at the axle [N·m]
    motor_torque: Array  # axle torque and losses [N·m], seen from the axle
    current: Array  # [A]
    sensed: Sensed


@dataclass(frozen=True)
class Carried:
    """What the soil carries, before axle, testbed, drive and sensors."""

    wheel: Wheel
    situation: OnSoil
    balance: balance.Balance


def simulate_arrays(
    wheel: Wheel,
    soil: Soil,
    motion: Motion,
    effects: Sequence[Effect] = (),
    *,
    torque_constant: float = 1.0,
    order: int = balance.ORDER,
    correction: Correction | None = None,
) -> Response:
    """The response of the testbed to a motion.

    motion:          measured, arrays (n,) of one run; a field that does not vary may be a float.
    torque_constant: as configured, torque at the axle per ampere [N·m/A].
    order:           quadrature nodes in each zone of the contact.
    correction:      the discrepancy of form as it was learnt; its mean is added.
    """
    solved = carried(wheel, soil, motion, effects, order=order)

    return responded(solved, effects, torque_constant=torque_constant, correction=correction)


def carried(
    wheel: Wheel,
    soil: Soil,
    motion: Motion,
    effects: Sequence[Effect],
    *,
    near: balance.Balance | None = None,
    order: int = balance.ORDER,
) -> Carried:
    """The vertical balance at every sample of a motion; see `simulate_arrays`. Of the effects only
    those matter that bear on the soil.

    near: of an earlier call with nearby parameters: the balance starts there.
    """
    effects = in_order(effects)
    wheel, situation, soil, law = touched(wheel, soil, motion, effects)

    solved = _balance(wheel, soil, law, situation, effects, near, order)
    return Carried(wheel, situation, solved)


def carried_at(
    wheel: Wheel, soil: Soil, motion: Motion, effects: Sequence[Effect], theta_1: Array
) -> Carried:
    """As `carried`, but at measured entry angles θ₁ (n,) [rad] in the place of predicted ones, with
    the sinkage modulus that carries the load of the motion there.

    effects: sensors' effects on θ₁ and the load are undone already.
    """
    wheel, situation, soil, law = touched(wheel, soil, motion, in_order(effects))
    bare, stated = (
        balance.rim_forces(
            wheel,
            balance.Contact(replace(soil, modulus=modulus), law, situation.slip, situation.load),
            theta_1,
        )
        for modulus in (0.0, soil.modulus)
    )

    share = (situation.load - bare.load) / (stated.load - bare.load)  # forces are linear in it
    forces = OriginalForces(
        *(low + share * (high - low) for low, high in zip(bare, stated, strict=True))
    )
    none = np.zeros(theta_1.shape)
    return Carried(wheel, situation, balance.Balance(theta_1, forces, none > 0.0, none))


def touched(
    wheel: Wheel, soil: Soil, motion: Motion, effects: Sequence[Effect]
) -> tuple[Wheel, OnSoil, Soil, ContactLaw]:
    """The true wheel, its situation, the soil under it and the contact, effects in order."""
    wheel, moving = prepare(wheel, motion, effects)
    soil = reduce(lambda soil, e: e.soil(soil, moving), effects, soil)
    situation = advanced(
        OnSoil,
        moving,
        cohesion=soil.cohesion,
        tan_phi=soil.tan_phi,
        shear_modulus=soil.shear_modulus,
    )
    law = reduce(lambda law, e: e.contact(law, situation), effects, paper_contact(wheel, situation))
    return wheel, situation, soil, law


def responded(
    solved: Carried,
    effects: Sequence[Effect],
    *,
    torque_constant: float = 1.0,
    correction: Correction | None = None,
) -> Response:
    """What axle, testbed, drive and sensors make of what the soil carries; see
    `simulate_arrays`.
    """
    effects = in_order(effects)
    situation, reaction = felt(solved, effects, correction)
    driven, motor_torque = drive(
        replace(situation, torque=reaction.torque), effects, torque_constant
    )

    return _response(driven, solved.balance, reaction, motor_torque, effects)


def felt(
    solved: Carried, effects: Sequence[Effect], correction: Correction | None = None
) -> tuple[Balanced, Reaction]:
    """The situation under the balance, and what axle and testbed make of it, before drive and
    sensors.
    """
    situation = balanced(solved.situation, solved.wheel, solved.balance)
    return situation, corrected_form(react(situation, in_order(effects)), situation, correction)


def _response(
    situation: Complete,
    solved: balance.Balance,
    reaction: Reaction,
    motor_torque: Scalar,
    effects: Sequence[Effect],
) -> Response:
    sensed = Sensed(
        reaction.sinkage,
        situation.current,
        reaction.drawbar_pull,
        reaction.load,
        reaction.torque,
        reaction.side_force,
    )

    n = solved.theta_1.shape
    return Response(
        slip=_full(situation.slip, n),
        theta_1=solved.theta_1,
        overloaded=solved.overloaded,
        sinkage=_full(reaction.sinkage, n),
        drawbar_pull=_full(reaction.drawbar_pull, n),
        load=_full(reaction.load, n),
        torque=_full(reaction.torque, n),
        motor_torque=_full(motor_torque, n),
        current=_full(situation.current, n),
        sensed=reduce(lambda sensed, e: e.sensors(sensed, situation), effects, sensed),
    )


def prepare(wheel: Wheel, motion: Motion, effects: Sequence[Effect]) -> tuple[Wheel, Situation]:
    """The true wheel, and the situation of its true motion."""
    wheel = reduce(lambda wheel, e: e.geometry(wheel), effects, wheel)
    motion = reduce(lambda motion, e: e.motion(motion, wheel), effects, motion)
    return wheel, situation_of(motion, wheel)


def paper_contact(wheel: Wheel, situation: Situation) -> ContactLaw:
    """θₘ by Eq. (5), θ₂ = 0, shear by Eq. (2)."""
    return ContactLaw(theta_m_ratio=np.clip(wheel.c1 + wheel.c2 * situation.slip, 0.0, 1.0))


def balanced(situation: OnSoil, wheel: Wheel, solved: balance.Balance) -> Balanced:
    """The situation once the rim stresses are known; in reverse drawbar pull and torque change
    sign.
    """
    forces = solved.forces
    return advanced(
        Balanced,
        situation,
        theta_1=solved.theta_1,
        sinkage=2.0 * wheel.radius * np.sin(0.5 * solved.theta_1) ** 2,
        carried=forces.load,
        torque=forces.torque * situation.direction,
        drawbar_pull=forces.drawbar_pull * situation.direction,
        side_force=forces.side_force * situation.direction,
    )


def react(situation: Balanced, effects: Sequence[Effect]) -> Reaction:
    """What the axle and then the testbed's sensors feel."""
    reaction = Reaction(
        situation.drawbar_pull,
        situation.carried,
        situation.torque,
        situation.sinkage,
        situation.side_force,
    )
    reaction = reduce(lambda reaction, e: e.wheel(reaction, situation), effects, reaction)
    return reduce(lambda reaction, e: e.testbed(reaction, situation), effects, reaction)


def corrected_form(
    reaction: Reaction, situation: Situation, correction: Correction | None
) -> Reaction:
    """The reaction with the mean of δ: torque, drawbar pull and sinkage, each (n,)."""
    if correction is None:
        return reaction

    torque, pull, sinkage = correction.of(situation).T
    return replace(
        reaction,
        torque=reaction.torque + torque,
        drawbar_pull=reaction.drawbar_pull + pull,
        sinkage=reaction.sinkage + sinkage,
    )


def drive(
    situation: Balanced, effects: Sequence[Effect], torque_constant: float
) -> tuple[Complete, Scalar]:
    """Motor current for the axle torque of the situation, and motor torque behind it (n,) [N·m].

    The factor on the torque constant may depend on the current itself (heating), hence the rounds.
    """
    motor_torque = reduce(
        lambda torque, e: torque + e.torque_loss(situation), effects, situation.torque
    )

    driven = advanced(Complete, situation, current=motor_torque / torque_constant)
    for _ in range(HEATING_ROUNDS):
        current = motor_torque / (torque_constant * torque_factor(driven, effects))
        settled = np.allclose(current, driven.current, rtol=1e-9, atol=1e-12)
        driven = replace(driven, current=current)
        if settled:
            break
    return driven, motor_torque


def torque_factor(situation: Powered, effects: Sequence[Effect]) -> Scalar:
    """True over configured torque constant (n,), all effects together."""
    factor: Scalar = 1.0
    for effect in effects:
        factor = factor * effect.torque_factor(situation)
    return factor


def axle_torque(situation: Powered, effects: Sequence[Effect], torque_constant: float) -> Scalar:
    """Axle torque (n,) [N·m] behind the situation's true current: the exact inverse of `drive`."""
    torque = torque_constant * torque_factor(situation, effects) * situation.current
    return reduce(lambda torque, e: torque - e.torque_loss(situation), effects, torque)


def corrected(sensed: Sensed, situation: Loaded, effects: Sequence[Effect]) -> Sensed:
    """True values behind the readings: sensor effects undone in reverse order."""
    return reduce(
        lambda sensed, e: e.correct(sensed, situation), reversed(in_order(effects)), sensed
    )


def _balance(
    wheel: Wheel,
    soil: Soil,
    law: ContactLaw,
    situation: OnSoil,
    effects: Sequence[Effect],
    near: balance.Balance | None,
    order: int,
) -> balance.Balance:
    n = np.broadcast_shapes(
        np.shape(situation.time), np.shape(situation.load), np.shape(situation.slip)
    )

    def solve(load: Scalar, start: balance.Balance | None) -> balance.Balance:
        contact = balance.Contact(soil, law, situation.slip, _full(load, n))
        return balance.solve(wheel, contact, start, order)

    def felt(situation: OnSoil) -> Scalar:
        return reduce(lambda load, e: e.load(load, situation), effects, situation.load)

    if situation.sinkage is not None or not any(e.needs_sinkage for e in effects):
        return solve(felt(situation), near)

    predicted = solve(situation.load, near)
    load = felt(balanced(situation, wheel, predicted))
    return predicted if np.all(load == situation.load) else solve(load, predicted)


def _full(value: Scalar, shape: tuple[int, ...]) -> Array:
    values = np.asarray(value, dtype=float)
    return values if values.shape == shape else np.broadcast_to(values, shape)
