"""The measurement of one window, linearised at an estimate: innovation, Jacobians, noise, σ of what is predicted."""

from __future__ import annotations

from math import exp, isnan, sqrt
from operator import mul

from estimator.filter import KPA, Estimate, Matrix, Update, Vector, dot, variance
from estimator.model import Prediction, Quantity, WheelModel
from estimator.nuisance import Sensitivity, nuisances
from estimator.settings import Settings
from estimator.wheel_state import WheelState

COMPONENTS = ("torque", "drawbar_pull")  # what the filter is offered, in this order


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
        torque, pull = prediction.torque, prediction.drawbar_pull
        sensitivity = _sensitivity(now, prediction)
        update = Update(
            innovation=(now.torque.value - torque.value, now.drawbar_pull.value - pull.value),
            H=(_state_gradient(torque), _state_gradient(pull)),
            G=self._nuisance_gradients(sensitivity),
            R=self._noise(now, sensitivity),
        )
        return selected(update, (0,)) if isnan(now.drawbar_pull.value) else update

    def _nuisance_gradients(self, s: Sensitivity) -> Matrix:
        """G (2, q)."""
        columns = [nuisance.gradient(s) for nuisance in self.nuisances]
        return tuple([column[0] for column in columns]), tuple([column[1] for column in columns])

    def _noise(self, now: WheelState, s: Sensitivity) -> Matrix:
        """R (2, 2): each component's own noise, and that of z, i and W through the Jacobians, which T and DP share."""
        sigmas = (now.sinkage.sigma, now.slip.sigma, now.load.sigma)
        by_torque, by_pull = zip(s.by_sinkage, s.by_slip, s.by_load, strict=True)
        torque, pull = tuple(map(mul, by_torque, sigmas)), tuple(map(mul, by_pull, sigmas))
        torque_model, pull_model = self.model.residual_sigma(s)
        common = dot(torque, pull)
        return (
            (dot(torque, torque) + now.torque.sigma**2 + torque_model**2, common),
            (common, dot(pull, pull) + now.drawbar_pull.sigma**2 + pull_model**2),
        )

    def sigmas(self, estimate: Estimate, now: WheelState, prediction: Prediction) -> tuple[float, float, float]:
        """σ of T, DP and resistance predicted: of the state, of the nuisances, and of this window's z, i and W."""
        torque, pull = self._nuisance_gradients(_sensitivity(now, prediction))
        return (
            self._sigma(estimate, now, prediction.torque, torque),
            self._sigma(estimate, now, prediction.drawbar_pull, pull),
            self._sigma(estimate, now, prediction.resistance, (0.0,) * len(torque)),
        )

    def _sigma(self, estimate: Estimate, now: WheelState, quantity: Quantity, nuisance: Vector) -> float:
        noise = (
            quantity.by_theta_1 * now.theta_1.d_sinkage * now.sinkage.sigma,
            quantity.by_slip * now.slip.sigma,
            quantity.by_load * now.load.sigma,
        )
        return sqrt(variance(estimate, self.variances, _state_gradient(quantity), nuisance) + dot(noise, noise))

    def largest_pull(self, estimate: Estimate, now: WheelState) -> tuple[float, float, float]:
        """Largest DP over slip at this load and sinkage [N], its σ, and its slip."""
        best = self.model.best_slip(*soil(estimate), now.theta_1.value, now.load.value)
        prediction = self.model.predict(*soil(estimate), now.theta_1.value, best, now.load.value)
        return prediction.drawbar_pull.value, self.sigmas(estimate, now, prediction)[1], best


def soil(estimate: Estimate) -> tuple[float, float, float]:
    """c [Pa], tan φ [-], k [m] of a state."""
    c, tan_phi, ln_k = estimate.x
    return c * KPA, tan_phi, exp(ln_k)


def selected(update: Update, components: tuple[int, ...]) -> Update:
    """The measurement reduced to some of its components."""
    if len(components) == len(update.innovation):
        return update
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
