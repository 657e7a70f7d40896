"""A zero that creeps while values are set one after the other looks like a wrong scale. It shows
while a value stands.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.config.settings import Uncertain
from gritd.tools.calibrate.plateaus import Plateau
from gritd.tools.cli.command import DAMAGED, CommandError

SURE = 4.0  # [σ] of the rate, from which it creeps
HARM = 0.003  # of the span over the whole procedure, under which it does not matter
UNSEEN = 0.01  # of the span, that the stretches at rest should be able to show at 3σ


def rate(plateaus: Sequence[Plateau]) -> Uncertain:
    """The rate at which the readings creep while they should stand [raw/s], of all stretches."""
    known = [one for one in plateaus if np.isfinite(one.creep.sigma)]
    if not known:
        return Uncertain(0.0, float("inf"))
    # by their lengths: each one's own scatter, of a few means, is too uncertain to weigh by
    weight = np.array([(one.end - one.begin) ** 2 for one in known])
    weight /= weight.sum()
    value, sigma = (
        np.array([getattr(one.creep, name) for one in known]) for name in ("value", "sigma")
    )
    return Uncertain(float(weight @ value), float(np.sqrt(weight**2 @ sigma**2)))


def checked(plateaus: Sequence[Plateau], channel: str, where: str = "") -> str:
    """A line where a creep that matters could not be seen; ''. Raises CommandError where the
    readings creep.
    """
    means = np.array([one.mean.value for one in plateaus])
    span = float(np.ptp(means)) if means.size else 0.0
    if span == 0.0:
        return ""

    creep = rate(plateaus)
    took = plateaus[-1].end - plateaus[0].begin
    part = abs(creep.value) * took / span
    if abs(creep.value) > SURE * creep.sigma and part > HARM:
        raise CommandError(
            f"{where}{channel}: found readings that creep by {creep.value:.2g} a second while they "
            f"should stand, {100 * part:.1f} % of their span in {took:.0f} s; expected a steady "
            "zero: let sensor and amplifier warm up, and take it again",
            DAMAGED,
        )

    unseen = 3.0 * creep.sigma * took / span
    if unseen > UNSEEN and not _returns(means, span):
        least = f"{100 * unseen:.0f} % of the span" if np.isfinite(unseen) else "any"
        return (
            f"{channel}: a creeping zero of {least} would not be seen; set the first value again "
            "at the end, or hold each value longer"
        )
    return ""


def _returns(means: np.typing.NDArray[np.float64], span: float) -> bool:
    """Whether a value from the first half is set again later: a creep then shows as a residual."""
    half = means.size // 2
    early, late = means[: max(half, 1)], means[max(half, 1) :]
    return bool((np.abs(early[:, None] - late[None, :]) < 0.05 * span).any())
