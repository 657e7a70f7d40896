"""What the wheel is doing: slip, entry angle and the reason, if any, why this window teaches
nothing about the soil.
"""

from __future__ import annotations

from dataclasses import replace
from math import hypot, isnan, pi, sqrt
from typing import NamedTuple

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.readings import ENCODERS, MOTION, NS
from gritd.estimator.messages.replacing import quickly_replaced
from gritd.estimator.messages.status import CHANNEL_BITS, Flag, Status
from gritd.estimator.stages.situation import Complete
from gritd.estimator.terramechanics.soil import Wheel
from gritd.estimator.wheel.chain import Added, Chain, Context, Here
from gritd.estimator.wheel.form import NAME, FormHere, FormOnLine, Wheeling
from gritd.estimator.wheel.geometry import (
    EntryAngle,
    entry_angle,
    max_stress_angle,
    slip,
    slip_sigma,
)
from gritd.estimator.wheel.odometry import Odometry, of_window
from gritd.estimator.wheel.sync import NOTHING, Measured, Snapshot

# the linearised shear displacement changes sign along the contact below about this slip
BRAKING_SLIP = -0.05
STALL_SLIP = 0.95
LOAD_SIGMA_MAX = 0.1  # likewise, relative error of the load
SLIP_SIGMA_MAX = 0.1  # a window that knows slip worse than this is not worth an update
ANGLE_SIGMA_MAX = 0.2  # likewise, relative error of θ₁
# relative change of speed, load or sinkage in steady motion, in which Eqs. 1–22 hold
STEADY = 0.05
SAME_SLIP = 0.02  # change of slip that is none
SCATTER = 3.0  # [σ] by which two windows of one condition may differ besides
# share of the contact angle θ₁ by which the wheel turns in steady motion before a window counts:
# most of the soil under the rim, and what lags in a force sensor's mounting, has then seen no other
SETTLED = 0.5
LAGGING = 1.0  # [s] of steady motion in which forces have caught up: three times a filter of 0.3 s
HALF = 0.5  # counts
BLOCKED_TORQUE = 0.1  # share of r W tan φ above which a standing motor is pushing, not resting


def required(settings: Settings) -> tuple[str, ...]:
    """The channels without which there is no update: motion, torque where it is measured, and the
    wrench where there is one.
    """
    shunt = ("motor_shunt",) if settings.drive.torque_source == "motor_shunt" else ()
    wrench = ("wrench",) if settings.wrench is not None else ()
    return (*MOTION, *shunt, *wrench)


def required_bits(settings: Settings) -> int:
    """Their CHANNEL_BITS."""
    return integer_sum([CHANNEL_BITS[name] for name in required(settings)])


@quickly_replaced
class WheelState(NamedTuple):
    """One window in the wheel's own terms, SI; `_sigma` is noise, not calibration error."""

    rim_speed: Measured  # rω [m/s]
    travel_speed: Measured  # v [m/s]
    slip: Measured  # i [-]
    sinkage: Measured  # z [m]
    theta_1: EntryAngle  # with ∂θ₁/∂z
    theta_m: float  # [rad]
    torque: Measured  # T at the axle [N·m]
    load: Measured  # W [N]
    drawbar_pull: Measured  # [N], NaN ± 0 without the sensor
    flags: Flag
    added: Added | None = None  # what wheel and testbed effects add to the closed forms
    # the soil under this window from the estimated one; None where it is the same
    here: Here | None = None
    situation: Complete | None = None
    read: tuple[float, float] = (0.0, 0.0)  # wheel speed [rad/s] and sinkage [m] as read
    grain: float = 0.0  # σ of slip by the encoders' counts: see `grain`
    doubts: tuple[float, float] = (0.0, 0.0)  # σ of slip and load [N] by what lags: no noise
    form: FormHere | None = None  # the learnt discrepancy of form; None where there is none
    odometry: Odometry | None = None  # of a window that is offered to the filter


def wheel_state(
    settings: Settings, snapshot: Snapshot, chain: Chain, context: Context
) -> WheelState:
    """Slip, θ₁, θₘ, T, W and DP of one snapshot, with the effects of a chain and the learnt
    discrepancy accounted for.
    """
    if not snapshot.ready:
        return _as_read(settings, snapshot)

    if chain.acting:
        now = _without_effects(settings, snapshot, chain, context)
    else:
        now = _as_read(settings, snapshot)

    if chain.form is None:
        return now
    return _without_form(now, snapshot.wheel_angle, chain.wheel, chain.form, context)


def wheeling(now: WheelState, wheel_angle: float) -> Wheeling:
    """What the conditions of the discrepancy are made of."""
    return Wheeling(
        now.slip.value, now.load.value, now.rim_speed.value, now.travel_speed.value, wheel_angle
    )


def _without_form(
    now: WheelState, wheel_angle: float, wheel: Wheel, form: FormOnLine, context: Context
) -> WheelState:
    """The sinkage that the equations would give, and θ₁ of it: the measured one less δ's mean."""
    here = form.at(wheeling(now, wheel_angle), context.memory.get(NAME, ()))
    sinkage = now.sinkage._replace(value=now.sinkage.value - here.mean[2])
    angle = entry_angle(wheel.radius, sinkage.value)
    theta_m = max_stress_angle(wheel.c1, wheel.c2, now.slip.value, angle.value)
    return now._replace(sinkage=sinkage, theta_1=angle, theta_m=theta_m, form=here)


def _without_effects(
    settings: Settings, snapshot: Snapshot, chain: Chain, context: Context
) -> WheelState:
    """The window once `Chain.undo` has taken out what effects do to it."""
    undone = chain.undo(snapshot, _load(settings, snapshot)[0].value, context)
    situation = undone.situation
    true = snapshot._replace(
        wheel_speed=snapshot.wheel_speed._replace(value=float(situation.wheel_speed)),
        carriage_speed=_doubted(snapshot.carriage_speed, undone.travel_speed, undone.travel_doubt),
        sinkage=snapshot.sinkage._replace(value=undone.sinkage),
        drawbar_pull=snapshot.drawbar_pull._replace(value=float(situation.drawbar_pull)),
    )
    now = _as_read(replace(settings, wheel=chain.wheel), true)

    return now._replace(
        torque=now.torque._replace(value=float(situation.torque)),
        load=_doubted(now.load, undone.load, undone.load_doubt),
        here=undone.here,
        situation=situation,
        doubts=(_slip_doubt(now, undone.travel_doubt), undone.load_doubt),
        read=(snapshot.wheel_speed.value, snapshot.sinkage.value),
    )


def _slip_doubt(now: WheelState, travel_doubt: float) -> float:
    """σ of slip by that of the travel speed [m/s]."""
    return slip_sigma(slip(now.rim_speed.value, now.travel_speed.value), 0.0, travel_doubt)


def _doubted(measured: Measured, value: float, doubt: float) -> Measured:
    """A measurement that effects have changed."""
    return (
        Measured(value, hypot(measured.sigma, doubt)) if doubt else measured._replace(value=value)
    )


def _as_read(settings: Settings, snapshot: Snapshot) -> WheelState:
    """The window as the calibrated sensors have it."""
    radius = settings.wheel.radius
    rim = Measured(snapshot.wheel_speed.value * radius, snapshot.wheel_speed.sigma * radius)
    travel = snapshot.carriage_speed
    i = (
        slip(rim.value, travel.value)
        if rim.value > 0.0 or travel.value > 0.0
        else slip(-rim.value, -travel.value)
    )
    angle = entry_angle(radius, snapshot.sinkage.value) if snapshot.ready else EntryAngle(0.0, 0.0)
    load, flags = _load(settings, snapshot)

    return WheelState(
        rim_speed=rim,
        travel_speed=travel,
        slip=Measured(i.value, slip_sigma(i, rim.sigma, travel.sigma)),
        sinkage=snapshot.sinkage,
        theta_1=angle,
        theta_m=max_stress_angle(settings.wheel.c1, settings.wheel.c2, i.value, angle.value),
        torque=_torque(settings, snapshot),
        load=load,
        drawbar_pull=snapshot.drawbar_pull,
        flags=flags,
        read=(snapshot.wheel_speed.value, snapshot.sinkage.value),
    )


def _load(settings: Settings, snapshot: Snapshot) -> tuple[Measured, Flag]:
    """W measured where there is a sensor and it speaks; the configured load otherwise."""
    if settings.wrench is not None and not isnan(snapshot.load.value):
        return snapshot.load, Flag.NONE
    return Measured(settings.load.nominal.value, 0.0), Flag.LOAD_ASSUMED


def _torque(settings: Settings, snapshot: Snapshot) -> Measured:
    if settings.drive.torque_source == "none":
        return NOTHING
    if settings.drive.torque_source == "wrench":
        return snapshot.axle_torque
    constant = settings.drive.torque_constant.value
    return Measured(snapshot.current.value * constant, snapshot.current.sigma * abs(constant))


def classify(
    settings: Settings,
    snapshot: Snapshot,
    now: WheelState,
    since: Steady | None,
    needed: int,
    started: bool = True,
) -> Status:
    """TRACKING, or the first reason that applies why the window is not used.

    since: since when the motion is steady; needed: CHANNEL_BITS; started: whether every required
    channel has filled a window once.
    """
    if snapshot.stale & needed or not snapshot.ready or _unread(settings, now):
        return Status.STALE if started else Status.STARTING
    if snapshot.stuck & needed:
        return Status.STUCK

    return _contact(settings, now) or _travel(settings, now) or _steadiness(now, since, snapshot)


def _unread(settings: Settings, now: WheelState) -> bool:
    """Whether the wrench, where there is one, sends nothing usable of what is needed of it."""
    assumed = int(now.flags) & Flag.LOAD_ASSUMED.value  # numbers: a flag is made anew each time
    sought = now.drawbar_pull if settings.drive.torque_source == "none" else now.torque
    return isnan(sought.value) or (settings.wrench is not None and assumed > 0)


def _contact(settings: Settings, now: WheelState) -> Status | None:
    if now.load.value < settings.load.minimum or now.theta_1.value <= 0.0:
        return Status.IN_AIR
    return None


def _travel(settings: Settings, now: WheelState) -> Status | None:
    turning, travelling = moves(now.rim_speed), moves(now.travel_speed)
    if not turning and not travelling:
        pushing = (
            BLOCKED_TORQUE * settings.wheel.radius * now.load.value * settings.soil.tan_phi.value
        )
        return Status.STALL if abs(now.torque.value) > pushing else Status.STANDSTILL
    if (turning and now.rim_speed.value < 0.0) or (travelling and now.travel_speed.value < 0.0):
        return Status.REVERSE
    if not travelling or now.slip.value > STALL_SLIP:
        return Status.STALL
    if now.slip.value < BRAKING_SLIP:
        return Status.BRAKING

    return None


def _steadiness(now: WheelState, since: Steady | None, snapshot: Snapshot) -> Status:
    # a wheel that is in as deep as its axle, or deeper, has no entry angle
    if now.theta_1.value >= pi / 2.0:
        return Status.UNCERTAIN
    if now.slip.sigma > SLIP_SIGMA_MAX:
        return Status.UNCERTAIN
    if now.load.sigma > LOAD_SIGMA_MAX * now.load.value:
        return Status.UNCERTAIN
    if now.theta_1.d_sinkage * now.sinkage.sigma > ANGLE_SIGMA_MAX * now.theta_1.value:
        return Status.UNCERTAIN

    if since is None or not alike(now, since.state):
        return Status.UNSTEADY
    turned = abs(snapshot.wheel_angle - since.wheel_angle) >= SETTLED * now.theta_1.value
    passed = (snapshot.evaluated - since.evaluated) / NS >= LAGGING
    return Status.TRACKING if turned and passed else Status.UNSTEADY


class Steady(NamedTuple):
    """Since when the wheel has been in steady motion."""

    state: WheelState  # the first window of it, with the slip of all but the last
    wheel_angle: float  # [rad]
    evaluated: int  # [ns]
    last: WheelState | None = None  # the last window, where there are two or more


def steady_since(before: Steady | None, now: WheelState, snapshot: Snapshot) -> Steady:
    """The same after one more window. Two windows together know slip better than each."""
    begun = Steady(now, snapshot.wheel_angle, snapshot.evaluated)
    if before is None or not alike(now, before.state):
        return begun
    if before.last is None:
        return before._replace(last=now)

    if not alike(before.last, before.state, _slip_of_both(before.last, now)):
        return begun
    return before._replace(state=with_slip_of(before.state, before.last), last=now)


def begun_anew(before: Steady | None, after: Steady | None) -> bool:
    """Whether one steady motion has ended and another begun."""
    return before is not None and after is not None and after.evaluated != before.evaluated


def with_slip_of(state: WheelState, after: WheelState) -> WheelState:
    """A window with the slip of it and a later one together."""
    if state.odometry is None or after.odometry is None:
        return state
    both = state.odometry.joined(after.odometry)
    return state._replace(odometry=both, slip=_own_slip(both, after))


def _slip_of_both(state: WheelState, after: WheelState) -> Measured:
    """Slip of a window and a later one together."""
    if state.odometry is None or after.odometry is None:
        return state.slip
    return _own_slip(state.odometry.joined(after.odometry), after)


def _own_slip(odometry: Odometry, now: WheelState) -> Measured:
    """Slip over several windows, each as noisy as `now`."""
    slip = slip_over(odometry, now)
    return Measured(slip.value, slip.sigma / sqrt(odometry.windows))


def alike(now: WheelState, before: WheelState, own: Measured | None = None) -> bool:
    """Whether slip, speed, load and sinkage of two windows agree; own: the slip of `now`, where
    more is known of it.
    """
    slip = now.slip if own is None else own
    pairs = (
        (now.rim_speed, before.rim_speed),
        (now.load, before.load),
        (now.sinkage, before.sinkage),
    )
    slips = abs(slip.value - before.slip.value)
    noise = hypot(slip.sigma, before.slip.sigma)
    return slips <= SAME_SLIP + SCATTER * noise and all([_steady(a, b) for a, b in pairs])


def grain(settings: Settings, now: WheelState, window: float) -> float:
    """σ of slip because encoders count, in a window of so many seconds.

    Sampled at even steps, rounding errors of a count are no noise: they beat against the steps, and
    the slope keeps an error of about half a count over the window for many windows.
    """
    encoders = [settings.channels[name].calibration.scale.value for name in ENCODERS]
    steps = (encoders[0] * settings.wheel.radius, encoders[1] * settings.pulley_radius)
    speeds = (now.rim_speed.value, now.travel_speed.value)
    shares = [HALF * a / max(abs(v) * window, a) for a, v in zip(steps, speeds, strict=True)]
    return (1.0 - abs(now.slip.value)) * hypot(*shares)


def odometry(now: WheelState, snapshot: Snapshot, radius: float, window: float) -> Odometry:
    """What the encoders say of a window of so many seconds; radius [m] of the rim."""
    read = (snapshot.wheel_speed.value * radius, snapshot.carriage_speed.value)
    undone = (now.rim_speed.value - read[0], now.travel_speed.value - read[1])
    ways = (snapshot.wheel_angle * radius, snapshot.carriage_position)
    return of_window(snapshot.evaluated, window, ways, read, undone)


def slip_over(odometry: Odometry, now: WheelState) -> Measured:
    """Slip over several windows of one condition, each as noisy as `now`; σ as if each had that,
    independently.
    """
    *speeds, narrowing = odometry.slopes
    i = slip(*speeds)
    sigma = slip_sigma(i, now.rim_speed.sigma, now.travel_speed.sigma)
    return Measured(i.value, narrowing * sigma)


def moves(speed: Measured) -> bool:
    """Whether a speed differs from zero by more than its noise explains."""
    return abs(speed.value) > 4.0 * speed.sigma


def _steady(now: Measured, before: Measured) -> bool:
    noise = hypot(now.sigma, before.sigma)
    return abs(now.value - before.value) <= STEADY * abs(now.value) + SCATTER * noise
