"""Why what a run leaves is not believed, in words with figures, and what to do about it.

What stands at the end must follow from the whole run: a filter that was set back, that stood for
most of the run where its estimate was not believed, or whose record the equations do not fit, has
found nothing, whatever its last window says.
"""

from __future__ import annotations

from math import exp, inf
from typing import NamedTuple

from gritd.estimator.filter.estimate import KPA, LN_K, STATES, Estimate
from gritd.estimator.filter.measurement import COMPONENTS
from gritd.estimator.filter.track import TrackState
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.status import Status

MOSTLY = 0.5  # share of the updates in which the estimate was not believed
UNITS = ("N·m", "N")  # of COMPONENTS
NAMES = ("c", "tan φ", "k")

DIAGNOSE = "run gritd diagnose on these recordings"
DRIVE = "state what the motor loses (effect coulomb_friction), or " + DIAGNOSE
LEARN = DIAGNOSE + ", which says what the equations leave out"
PRIOR = "check the soil's prior and the units; then " + DIAGNOSE


class Reason(NamedTuple):
    """Why an estimate is withheld; empty where it is not."""

    why: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.why}: {self.remedy}" if self.remedy else self.why


def withheld(tracker: Tracker, state: TrackState) -> Reason:
    """Why what a run has left (`Tracker.concluded`) is not believed."""
    if not state.updates:
        return Reason("the filter was never updated: no window was steady and complete")

    separability = tracker.separability(state.estimate)
    standing = tracker.standing(state, separability)
    if standing == Status.AT_BOUND:
        return Reason(_at_bound(tracker, state.estimate), PRIOR)
    if state.misfit > tracker.misfit:
        return Reason(_misfit(tracker, state), _remedy(tracker))
    if state.resets:
        return Reason(f"the soil was set back to its prior {_times(state.resets)}", LEARN)
    if standing != Status.TRACKING:
        return Reason(_standing(standing, state), _remedy(tracker))
    if state.doubted > MOSTLY * state.updates:
        share = state.doubted / state.updates
        return Reason(f"the estimate was not believed in {share:.0%} of the updates", LEARN)
    return Reason()


def _remedy(tracker: Tracker) -> str:
    motor = tracker.settings.drive.torque_source == "motor_shunt"
    losses = any("friction" in effect.name for effect in tracker.settings.effects)
    return DRIVE if motor and not losses else LEARN


def _standing(standing: Status, state: TrackState) -> str:
    if standing == Status.DIVERGED:
        return "σ is wider than the prior's"
    return f"innovations are {state.trust.consistency:.0f} times their variance at the end"


def _at_bound(tracker: Tracker, estimate: Estimate) -> str:
    """Which of c, tan φ and k stands where the prior calls it improbable."""
    x, prior = estimate.x[:STATES], tracker.prior.x[:STATES]
    apart = [
        abs(value - mean) / sigma if sigma > 0.0 else inf
        for value, mean, sigma in zip(x, prior, tracker.smoother.prior_sigma, strict=True)
    ]
    at = max(tracker.at_bound(estimate), key=apart.__getitem__, default=0)
    shown = (f"{x[0] * KPA:.0f} Pa", f"{x[1]:.3f}", f"{exp(x[LN_K]) * 1e3:.1f} mm")[at]
    return f"{NAMES[at]} is at its bound, {shown}, {apart[at]:.1f} σ from its prior"


def _misfit(tracker: Tracker, state: TrackState) -> str:
    """Where the equations are farthest from what was measured."""
    worst = state.memory.farthest(state.bank[0].x)
    if worst is None:
        return "the equations do not fit what was measured"
    component = tracker.measurement.components[worst.component]
    mean, channel = worst.stretch.mean, COMPONENTS[component].replace("_", " ")
    where = f"at slip {mean.slip.value:.2f} under {mean.load.value:.0f} N"
    return f"the equations miss the {channel} by {abs(worst.off):.2g} {UNITS[component]} {where}"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
