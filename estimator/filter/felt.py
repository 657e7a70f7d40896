"""What effects make of a prediction under one window, along the estimate."""

from __future__ import annotations

from gritd.estimator.filter.estimate import Estimate, Vector, dot, soil
from gritd.estimator.filter.model import ForcePrediction, PredictedQuantity
from gritd.estimator.wheel.chain import Added, Chain, Here
from gritd.estimator.wheel.wheel_state import WheelState

ADDED_STEP = 1e-3  # relative, for the slope of what effects add


def soil_here(estimate: Estimate, here: Here) -> tuple[float, float, float]:
    """c [Pa], tan φ [-], k [m] under this window."""
    c, tan_phi, k = soil(estimate)
    return (
        here.c_slope * c + here.c_offset,
        here.tan_phi_slope * tan_phi + here.tan_phi_offset,
        here.k_slope * k + here.k_offset,
    )


def effects_added(
    chain: Chain, now: WheelState, rim: ForcePrediction, x: tuple[float, float, float]
) -> Added:
    """What the effects add to the rim's torque and pull, with its slope along x = (c, tan φ, k)."""

    def added(x: tuple[float, float, float], torque: float, pull: float) -> tuple[float, float]:
        assert now.situation is not None
        felt = chain.felt(now.situation, torque, pull, x)
        return felt[0] - torque, felt[1] - pull

    torque, pull = rim.torque, rim.drawbar_pull
    here = added(x, torque.value, pull.value)
    slopes = []
    for place, name in enumerate(("by_c", "by_tan_phi", "by_ln_k")):
        step = ADDED_STEP * x[place] or ADDED_STEP
        scale = step / x[place] if name == "by_ln_k" else step
        c, tan_phi, k = (value + step if at == place else value for at, value in enumerate(x))
        there = added(
            (c, tan_phi, k),
            torque.value + scale * getattr(torque, name),
            pull.value + scale * getattr(pull, name),
        )
        slopes.append(((there[0] - here[0]) / step, (there[1] - here[1]) / step))
    by_torque, by_pull = zip(*slopes, strict=True)
    return Added._make(
        (here[0] - dot(by_torque, x), *by_torque, here[1] - dot(by_pull, x), *by_pull)
    )


def with_added(prediction: ForcePrediction, added: Added, estimate: Estimate) -> ForcePrediction:
    x = soil(estimate)
    return prediction._replace(
        torque=_plus(prediction.torque, added[:4], x),
        drawbar_pull=_plus(prediction.drawbar_pull, added[4:], x),
    )


def _plus(quantity: PredictedQuantity, added: Vector, x: Vector) -> PredictedQuantity:
    """A quantity of the rim with what effects add, linear in x = (c, tan φ, k)."""
    offset, *slopes = added
    return quantity._replace(
        value=quantity.value + offset + dot(tuple(slopes), x),
        by_c=quantity.by_c + slopes[0],
        by_tan_phi=quantity.by_tan_phi + slopes[1],
        by_ln_k=quantity.by_ln_k + slopes[2] * x[2],
    )


def raised(quantity: PredictedQuantity, value: float) -> PredictedQuantity:
    return quantity._replace(value=quantity.value + value)


def by_estimate(quantity: PredictedQuantity, estimate: Estimate, here: Here) -> PredictedQuantity:
    """Gradient with respect to the estimated soil, from that with respect to the soil under this
    window.
    """
    k, k_here = soil(estimate)[2], soil_here(estimate, here)[2]
    return quantity._replace(
        by_c=quantity.by_c * here.c_slope,
        by_tan_phi=quantity.by_tan_phi * here.tan_phi_slope,
        by_ln_k=quantity.by_ln_k * here.k_slope * k / k_here,
    )
