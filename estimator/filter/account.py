"""What a tick says of the tracker: measured, estimated and predicted quantities, the filter's
health, its updates. Each function makes one block of `messages.tick.Tick`.
"""

from __future__ import annotations

from math import isnan, nan, sqrt
from typing import NamedTuple

from gritd.estimator.filter.estimate import KPA, LN_K, TAN_PHI, C, Estimate, soil
from gritd.estimator.filter.measurement import COMPONENTS, Measurement
from gritd.estimator.filter.track import TrackState
from gritd.estimator.messages.status import Status
from gritd.estimator.messages.tick import (
    Aid,
    FilterHealth,
    Measurements,
    Predictions,
    SoilEstimate,
)
from gritd.estimator.wheel.sync import Measured, Snapshot
from gritd.estimator.wheel.wheel_state import WheelState

NO_AIDS = (Aid(0.0, 0.0, 0.0, 0.0, 0.0, False),) * len(COMPONENTS)
NO_PREDICTIONS = Predictions(*(nan,) * len(Predictions._fields))


class Account(NamedTuple):
    """Result of one tick."""

    snapshot: Snapshot
    now: WheelState
    status: Status
    flags: int  # of Flag
    aids: tuple[Aid, ...]  # empty where nothing was offered to the filter
    estimate: Estimate  # what is published: the filter's, or the prior where that is not believed
    separability: float  # of what is published

    @property
    def touching(self) -> bool:
        """Whether the wheel is in the soil, so that there is something to predict."""
        return self.snapshot.ready and self.now.theta_1.value > 0.0


def measurements(snapshot: Snapshot, now: WheelState) -> Measurements:
    """The window as measured, effects accounted for."""
    theta_1 = _with_sigma(now)

    return Measurements(
        wheel_angle=snapshot.wheel_angle,
        wheel_speed=snapshot.wheel_speed.value,
        wheel_speed_sigma=snapshot.wheel_speed.sigma,
        carriage_position=snapshot.carriage_position,
        carriage_speed=snapshot.carriage_speed.value,
        carriage_speed_sigma=snapshot.carriage_speed.sigma,
        slip=now.slip.value,
        slip_sigma=now.slip.sigma,
        sinkage=now.sinkage.value,
        sinkage_sigma=now.sinkage.sigma,
        theta_1=theta_1.value,
        theta_1_sigma=theta_1.sigma,
        theta_m=now.theta_m,
        current=snapshot.current.value,
        temperature=snapshot.temperature,
        torque=now.torque.value,
        torque_sigma=now.torque.sigma,
        load=now.load.value,
        load_sigma=now.load.sigma,
        drawbar_pull=now.drawbar_pull.value,
        drawbar_pull_sigma=now.drawbar_pull.sigma,
    )


def soil_estimate(estimate: Estimate) -> SoilEstimate:
    """The estimate in SI: the state is [c/kPa, tan φ, ln k]."""
    P = estimate.soil_P
    c, tan_phi, k = soil(estimate)

    return SoilEstimate(
        cohesion=c,
        cohesion_sigma=sqrt(P[C][C]) * KPA,
        tan_phi=tan_phi,
        tan_phi_sigma=sqrt(P[TAN_PHI][TAN_PHI]),
        shear_modulus=k,
        shear_modulus_sigma=k * sqrt(P[LN_K][LN_K]),
        cov_c_tan_phi=P[C][TAN_PHI] * KPA,
        cov_c_ln_k=P[C][LN_K] * KPA,
        cov_tan_phi_ln_k=P[TAN_PHI][LN_K],
    )


def predictions(measurement: Measurement, state: TrackState, account: Account) -> Predictions:
    """What the estimate says of this window; NaN where the wheel touches nothing."""
    if not account.touching:
        return NO_PREDICTIONS

    now, estimate = account.now, account.estimate
    prediction = measurement.predict(estimate, now)
    shared = measurement.shared(now, prediction, state.by_parameters)
    torque, pull = measurement.expected(estimate, prediction, shared)
    torque_sigma, pull_sigma, resistance_sigma = measurement.sigmas(
        estimate, now, prediction, shared
    )
    load = measurement.model.load(
        *soil(estimate),
        _with_sigma(now),
        now.theta_m,
        now.slip.value,
        measurement.form_of(estimate),
    )
    return Predictions(
        torque_predicted=torque,
        torque_predicted_sigma=torque_sigma,
        load_predicted=load.value,
        load_predicted_sigma=load.sigma,
        drawbar_pull_predicted=pull,
        drawbar_pull_predicted_sigma=pull_sigma,
        rolling_resistance=prediction.resistance.value,
        rolling_resistance_sigma=resistance_sigma,
    )


def health(state: TrackState, account: Account) -> FilterHealth:
    """Whether the estimate can be trusted."""
    return FilterHealth(
        separability=account.separability,
        consistency=state.trust.consistency,
        updates=state.updates,
        resets=state.resets,
    )


def aids(account: Account) -> tuple[Aid, Aid]:
    """The account of torque and of drawbar pull; zeros where one was not offered."""
    before = NO_AIDS[:1] if isnan(account.now.torque.value) else ()
    torque, drawbar_pull = (before + account.aids + NO_AIDS)[: len(COMPONENTS)]
    return torque, drawbar_pull


def _with_sigma(now: WheelState) -> Measured:
    """θ₁ with its standard deviation [rad]."""
    return Measured(now.theta_1.value, now.theta_1.d_sinkage * now.sinkage.sigma)
