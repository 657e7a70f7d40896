"""What a tick's record says, by name: measured, estimated and predicted quantities and the account of the updates."""

from __future__ import annotations

from math import sqrt

from estimator.filter import KPA, LN_K, TAN_PHI, C, Estimate
from estimator.measurement import COMPONENTS, Measurement, soil
from estimator.record import NOT_A_NUMBER
from estimator.sync import Measured
from estimator.tracker import Account, Aid, Tracker, TrackState
from estimator.wheel_state import WheelState

Record = dict[str, float]

NO_AID = Aid(0.0, 0.0, 0.0, 0.0, 0.0, False)
NOTHING = Measured(NOT_A_NUMBER, NOT_A_NUMBER)
Pull = tuple[float, float, float]  # largest drawbar pull [N], its σ [N], its slip


def record(tracker: Tracker, state: TrackState, account: Account, pull: Pull) -> Record:
    """The fields of /tick that the tracker knows, and the largest pull; times in ns, everything else SI."""
    return {
        **_condition(tracker, state, account),
        **_measured(account),
        **_estimated(state.estimate),
        **_predicted(tracker.measurement, state.estimate, account),
        **_largest(pull),
        **_aids(account.aids),
    }


def _condition(tracker: Tracker, state: TrackState, account: Account) -> Record:
    snapshot = account.snapshot
    return {
        "evaluated": snapshot.evaluated,
        "status": int(account.status),
        "flags": int(account.flags),
        "stale": snapshot.stale,
        "stuck": snapshot.stuck,
        "separability": tracker.separability(state.estimate),
        "consistency": state.consistency,
        "updates": state.updates,
        "resets": state.resets,
    }


def _measured(account: Account) -> Record:
    snapshot, now = account.snapshot, account.now
    return {
        "wheel_angle": snapshot.wheel_angle,
        "carriage_position": snapshot.carriage_position,
        "theta_m": now.theta_m,
        "current": snapshot.current.value,
        "temperature": snapshot.temperature,
        **_pair("wheel_speed", snapshot.wheel_speed),
        **_pair("carriage_speed", snapshot.carriage_speed),
        **_pair("slip", now.slip),
        **_pair("sinkage", now.sinkage),
        **_pair("theta_1", _angle(now)),
        **_pair("torque", now.torque),
        **_pair("load", now.load),
        **_pair("drawbar_pull", now.drawbar_pull),
    }


def _estimated(estimate: Estimate) -> Record:
    P = estimate.P
    c, tan_phi, k = soil(estimate)
    return {
        **_pair("cohesion", Measured(c, sqrt(P[C][C]) * KPA)),
        **_pair("tan_phi", Measured(tan_phi, sqrt(P[TAN_PHI][TAN_PHI]))),
        **_pair("shear_modulus", Measured(k, k * sqrt(P[LN_K][LN_K]))),
        "cov_c_tan_phi": P[C][TAN_PHI] * KPA,
        "cov_c_ln_k": P[C][LN_K] * KPA,
        "cov_tan_phi_ln_k": P[TAN_PHI][LN_K],
    }


def _predicted(measurement: Measurement, estimate: Estimate, account: Account) -> Record:
    """What the estimate says of this window: NaN where the wheel touches nothing."""
    torque = pull = resistance = load = NOTHING
    now = account.now
    if account.touching:
        prediction = measurement.predict(estimate, now)
        sigmas = measurement.sigmas(estimate, now, prediction)
        torque, pull, resistance = [Measured(q.value, sigma) for q, sigma in zip(prediction, sigmas, strict=True)]
        load = measurement.model.load(*soil(estimate), _angle(now), now.theta_m, now.slip.value)
    return {
        **_pair("torque_predicted", torque),
        **_pair("drawbar_pull_predicted", pull),
        **_pair("rolling_resistance", resistance),
        **_pair("load_predicted", load),
    }


def _largest(pull: Pull) -> Record:
    return dict(zip(("drawbar_pull_max", "drawbar_pull_max_sigma", "drawbar_pull_max_slip"), pull, strict=True))


def _aids(aids: tuple[Aid, ...]) -> Record:
    padded = (*aids, *(NO_AID,) * (len(COMPONENTS) - len(aids)))
    return {
        f"{component}_{name}": value
        for component, aid in zip(COMPONENTS, padded, strict=True)
        for name, value in aid._asdict().items()
    }


def _angle(now: WheelState) -> Measured:
    return Measured(now.theta_1.value, now.theta_1.d_sinkage * now.sinkage.sigma)


def _pair(name: str, quantity: Measured) -> Record:
    return {name: quantity.value, f"{name}_sigma": quantity.sigma}
