"""The measurement of one window, linearised at an estimate: innovation, Jacobians, noise, σ of what is predicted."""

from __future__ import annotations

from math import exp, isnan, sqrt
from typing import Literal

from estimator.filter import KPA, Estimate, Matrix, Update, Vector, variance
from estimator.model import Prediction, Quantity, WheelModel
from estimator.nuisance import Sensitivity, nuisances
from estimator.settings import Settings
from estimator.wheel_state import WheelState

COMPONENTS = ("torque", "drawbar_pull")  # what the filter is offered, in this order

Predicted = Literal["torque", "drawbar_pull", "resistance"]


class Measurement:
    """Settings turned into h(x), its Jacobians and R. The state is [c/kPa, tan φ, ln k]."""

    def __init__(self, settings: Settings) -> None:
        self.model = WheelModel(settings)
        self.nuisances = nuisances(settings)
        self.variances = tuple(nuisance.sigma**2 for nuisance in self.nuisances)

    def predict(self, estimate: Estimate, now: WheelState) -> Prediction:
        """T, DP and resistance at the estimate, in this window's geometry."""
        return self.model.predict(*soil(estimate), now.theta_1.value, now.slip.value, now.load.value)

    def linearise(self, now: WheelState, prediction: Prediction) -> Update:
        """Innovation, H, G and R of the components that are measured: T always, DP where there is a sensor."""
        sensed = [(now.torque, prediction.torque)]
        if not isnan(now.drawbar_pull.value):
            sensed.append((now.drawbar_pull, prediction.drawbar_pull))
        sensitivity = _sensitivity(now, prediction)
        columns = [nuisance.gradient(sensitivity) for nuisance in self.nuisances]
        return Update(
            innovation=tuple([measured.value - quantity.value for measured, quantity in sensed]),
            H=tuple([_state_gradient(quantity) for _, quantity in sensed]),
            G=tuple([tuple([column[row] for column in columns]) for row in range(len(sensed))]),
            R=self._noise(now, sensitivity, [measured.sigma for measured, _ in sensed]),
        )

    def _noise(self, now: WheelState, s: Sensitivity, own: list[float]) -> Matrix:
        """Each component's own noise, and that of z, i and W through the Jacobians, which T and DP share."""
        shared = ((s.by_sinkage, now.sinkage.sigma), (s.by_slip, now.slip.sigma), (s.by_load, now.load.sigma))
        model = self.model.residual_sigma(s)

        def entry(a: int, b: int) -> float:
            common = sum([gradient[a] * gradient[b] * sigma * sigma for gradient, sigma in shared])
            return common + own[a] ** 2 + model[a] ** 2 if a == b else common

        size = range(len(own))
        return tuple([tuple([entry(a, b) for b in size]) for a in size])

    def sigma(self, estimate: Estimate, now: WheelState, prediction: Prediction, which: Predicted) -> float:
        """σ of a predicted quantity: of the state, of the nuisances, and of this window's z, i and W."""
        quantity: Quantity = getattr(prediction, which)
        sensitivity = _sensitivity(now, prediction)
        if which in COMPONENTS:
            row = COMPONENTS.index(which)
            nuisance = tuple([nuisance.gradient(sensitivity)[row] for nuisance in self.nuisances])
        else:
            nuisance = (0.0,) * len(self.nuisances)
        noise = (
            quantity.by_theta_1 * now.theta_1.d_sinkage * now.sinkage.sigma,
            quantity.by_slip * now.slip.sigma,
            quantity.by_load * now.load.sigma,
        )
        state = variance(estimate, self.variances, _state_gradient(quantity), nuisance)
        return sqrt(state + sum([part * part for part in noise]))

    def largest_pull(self, estimate: Estimate, now: WheelState) -> tuple[float, float, float]:
        """Largest DP over slip at this load and sinkage [N], its σ, and its slip."""
        best = self.model.best_slip(*soil(estimate), now.theta_1.value, now.load.value)
        prediction = self.model.predict(*soil(estimate), now.theta_1.value, best, now.load.value)
        return prediction.drawbar_pull.value, self.sigma(estimate, now, prediction, "drawbar_pull"), best


def soil(estimate: Estimate) -> tuple[float, float, float]:
    """c [Pa], tan φ [-], k [m] of a state."""
    c, tan_phi, ln_k = estimate.x
    return c * KPA, tan_phi, exp(ln_k)


def selected(update: Update, components: tuple[int, ...]) -> Update:
    """The measurement reduced to some of its components."""
    return Update(
        tuple([update.innovation[a] for a in components]),
        tuple([update.H[a] for a in components]),
        tuple([update.G[a] for a in components]),
        tuple([tuple([update.R[a][b] for b in components]) for a in components]),
    )


def _sensitivity(now: WheelState, prediction: Prediction) -> Sensitivity:
    torque, pull = prediction.torque, prediction.drawbar_pull
    by_z = now.theta_1.d_sinkage
    return Sensitivity(
        torque=torque.value,
        drawbar_pull=pull.value,
        sinkage=now.sinkage.value,
        slip=now.slip.value,
        load=now.load.value,
        by_sinkage=(torque.by_theta_1 * by_z, pull.by_theta_1 * by_z),
        by_slip=(torque.by_slip, pull.by_slip),
        by_load=(torque.by_load, pull.by_load),
    )


def _state_gradient(quantity: Quantity) -> Vector:
    """Gradient with respect to the scaled state [c/kPa, tan φ, ln k]."""
    return quantity.by_c * KPA, quantity.by_tan_phi, quantity.by_ln_k
