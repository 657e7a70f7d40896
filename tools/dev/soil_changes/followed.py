"""What the filter makes of a case, and how honest its σ is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.filter.estimate import KPA, TAN_PHI, C
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.status import UPDATED, Flag
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.dev.soil_changes.cases import SoilChangeCase

WARNING = Flag.MISMATCH | Flag.RESET | Flag.CHANGED | Flag.PRIOR
BACK, STAYS = 15.0, 5.0  # [s] in which σ is to hold again, and for how long at least


class Track(NamedTuple):
    """What the filter made of a case, one row a window that was used, each (n,)."""

    time: Array  # [s]
    error: Array  # (n, 2) of c [Pa] and tan φ
    sigma: Array  # (n, 2)
    nees: Array  # normalised error squared of the pair, 2 when honest
    warned: NDArray[np.bool_]  # whether a flag warns of the estimate

    @property
    def away(self) -> Array:
        """Error of c or of tan φ (n,), whichever is the larger in its σ."""
        worst: Array = np.max(np.abs(self.error) / self.sigma, axis=1)
        return worst


def followed(case: SoilChangeCase) -> Track:
    """The filter over a case."""
    tracker = Tracker(case.settings)
    state, rows = tracker.start(), []

    for number, snapshot in enumerate(case.snapshots):
        state, account = tracker.step(state, snapshot)
        if account.status not in UPDATED:
            continue
        estimate = account.estimate
        covariance = np.array(estimate.soil_P)[: TAN_PHI + 1, : TAN_PHI + 1]
        error = np.array(
            (
                estimate.x[C] - case.cohesion[number] / KPA,
                estimate.x[TAN_PHI] - case.tan_phi[number],
            )
        )
        rows.append(
            (
                (snapshot.evaluated - case.snapshots[0].evaluated) / NS,
                error,
                np.sqrt(np.diag(covariance)),
                error @ np.linalg.solve(covariance, error),
                bool(account.flags & WARNING),
            )
        )

    return Track(*(np.array(column) for column in zip(*rows, strict=True)))


class FollowedCase(NamedTuple):
    """One case in figures; times in s of driving."""

    driven: float  # after the change began
    beyond: float  # of it, beyond 3σ without a flag
    far: float  # of it, beyond 5σ without a flag
    warned: float  # of it, with a flag
    back: float  # from the end of the change until 2σ holds; inf where it never does
    nees: float  # at the end


def judged(case: SoilChangeCase, track: Track) -> FollowedCase:
    """How honest σ was from the change on."""
    step = 1.0 / case.settings.rates.update
    after = track.time >= case.begins
    silent = after & ~track.warned

    return FollowedCase(
        driven=step * float(np.sum(after)),
        beyond=step * float(np.sum(silent & (track.away > 3.0))),
        far=step * float(np.sum(silent & (track.away > 5.0))),
        warned=step * float(np.sum(after & track.warned)),
        back=_back(track, case.settled, step),
        nees=float(track.nees[-1]),
    )


def _back(track: Track, settled: float, step: float) -> float:
    """Driving time from `settled` until error ≤ 2σ has begun to hold for some seconds."""
    inside = track.away[track.time >= settled] <= 2.0
    stays = round(STAYS / step)
    if inside.size < stays:
        return float("inf")
    held = np.convolve(inside, np.ones(stays, int), "valid") == stays
    return step * float(np.argmax(held)) if held.any() else float("inf")


def begun(track: Track) -> int:
    """How often a flag went up."""
    return int(np.sum(np.diff(track.warned.astype(int), prepend=0) > 0))
