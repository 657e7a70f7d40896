"""What a tick's record says of the tracker: measured, estimated and predicted quantities, the
account of the updates.

Each block is a plain tuple in the order of its names, and the blocks follow one another as in
record.TICK_FIELDS.
"""

from __future__ import annotations

from math import sqrt

from gritd.estimator.filter.estimate import KPA, LN_K, TAN_PHI, C, Estimate
from gritd.estimator.filter.measurement import COMPONENTS, Measurement, soil
from gritd.estimator.filter.pull import Pull
from gritd.estimator.filter.tracker import Account, Aid, Tracker, TrackState
from gritd.estimator.messages.record import NOT_A_NUMBER
from gritd.estimator.wheel.sync import Measured, Snapshot
from gritd.estimator.wheel.wheel_state import WheelState

Row = tuple[float, ...]

NO_AID = Aid(0.0, 0.0, 0.0, 0.0, 0.0, False)
NOTHING = Measured(NOT_A_NUMBER, NOT_A_NUMBER)


def _pairs(*names: str) -> tuple[str, ...]:
    return tuple(label for name in names for label in (name, f"{name}_sigma"))


MEASURED = (
    "wheel_angle",
    *_pairs("wheel_speed"),
    "carriage_position",
    *_pairs("carriage_speed", "slip", "sinkage", "theta_1"),
    "theta_m",
    "current",
    "temperature",
    *_pairs("torque", "load", "drawbar_pull"),
)
ESTIMATED = (
    *_pairs("cohesion", "tan_phi", "shear_modulus"),
    "cov_c_tan_phi",
    "cov_c_ln_k",
    "cov_tan_phi_ln_k",
)
PREDICTED = _pairs(
    "torque_predicted", "load_predicted", "drawbar_pull_predicted", "rolling_resistance"
)
LARGEST = (*_pairs("drawbar_pull_max"), "drawbar_pull_max_slip")
HEALTH = ("separability", "consistency", "updates", "resets")
AIDED = tuple(f"{component}_{name}" for component in COMPONENTS for name in Aid._fields)
NAMES = (*MEASURED, *ESTIMATED, *PREDICTED, *LARGEST, *HEALTH, *AIDED)


def record(tracker: Tracker, state: TrackState, account: Account, pull: Pull) -> Row:
    """Values in the order of NAMES, SI."""
    return (
        *measured(account.snapshot, account.now),
        *estimated(state.estimate),
        *predicted(tracker.measurement, state.estimate, account),
        *pull,
        *health(tracker, state),
        *aided(account.aids),
    )


def measured(snapshot: Snapshot, now: WheelState) -> Row:
    """In the order of MEASURED."""
    return (
        snapshot.wheel_angle,
        *snapshot.wheel_speed,
        snapshot.carriage_position,
        *snapshot.carriage_speed,
        *now.slip,
        *now.sinkage,
        *_angle(now),
        now.theta_m,
        snapshot.current.value,
        snapshot.temperature,
        *now.torque,
        *now.load,
        *now.drawbar_pull,
    )


def estimated(estimate: Estimate) -> Row:
    """In the order of ESTIMATED."""
    P = estimate.P
    c, tan_phi, k = soil(estimate)
    return (
        c,
        sqrt(P[C][C]) * KPA,
        tan_phi,
        sqrt(P[TAN_PHI][TAN_PHI]),
        k,
        k * sqrt(P[LN_K][LN_K]),
        P[C][TAN_PHI] * KPA,
        P[C][LN_K] * KPA,
        P[TAN_PHI][LN_K],
    )


def predicted(measurement: Measurement, estimate: Estimate, account: Account) -> Row:
    """In the order of PREDICTED: what the estimate says of this window, NaN where the wheel touches
    nothing.
    """
    torque = pull = resistance = load = NOTHING
    now = account.now
    if account.touching:
        prediction = measurement.predict(estimate, now)
        sigmas = measurement.sigmas(estimate, now, prediction)
        torque, pull, resistance = [
            Measured(q.value, sigma) for q, sigma in zip(prediction, sigmas, strict=True)
        ]
        load = measurement.model.load(*soil(estimate), _angle(now), now.theta_m, now.slip.value)
    return *torque, *load, *pull, *resistance


def health(tracker: Tracker, state: TrackState) -> Row:
    """In the order of HEALTH."""
    return tracker.separability(state.estimate), state.consistency, state.updates, state.resets


def aided(aids: tuple[Aid, ...]) -> Row:
    """In the order of AIDED: the account of each component, zeros where it was not offered."""
    return tuple(
        [value for aid in (*aids, *(NO_AID,) * (len(COMPONENTS) - len(aids))) for value in aid]
    )


def _angle(now: WheelState) -> Measured:
    return Measured(now.theta_1.value, now.theta_1.d_sinkage * now.sinkage.sigma)
