"""Whether an effect of an explanation is what was left out, or something that resembles it.

Either may have been there: the effect in some published form, or other physics that our formula can
be bent to. Both explain the recordings by the same functions, so at any form error h, the share by
which the formula is bent, their likelihood L(h) is one. They differ by what is expected. Published
laws of an effect differ little, so its prior over h has hardly anything at the last size; what only
resembles it mostly needs that. What is there takes nearly all of the misfit where it acts, what
resembles it a lesser share s. With the share λ of explanations that mislead (calibration.py)

    P(effect) = Σ L(h) (1 − λ) p(h, s | effect) / Σ L(h) [(that) + λ p(h, s | other)]

where p(h, s | …) = p(h | …) k sᵏ⁻¹. The denominator, over the sum of L(h) with the prior of the
search, is how likely it is that something is seen so at all: by it an explanation whose law must be
bent far, or which leaves much, weighs less against others that fit. The odds of what must vary with
the place on the bed are lower. L is not tempered as evidence between explanations is: both priors
were counted by it. A ripple whose line stands in the spectra is one, whatever its profile:
of it h says nothing. Where runs that were held out are predicted worse with the effect, its odds
are lower: of what only resembles it that is oftener so.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Effect, order_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import log_sum
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.search.calibration import OddsCalibration
from gritd.tools.diagnose.search.foretold import TURNING
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN


def trusted(
    rig: Rig, model: Model, shares: Sequence[float], by: OddsCalibration
) -> tuple[tuple[float, ...], float]:
    """Of each effect of a model, the probability that it is there, if the model is the best
    explanation; and how likely it is that they, or what resembles them, are seen so: 1 for effects
    that are there and take all of the misfit. shares: of the misfit, or of that where it acts,
    which are taken.
    """
    every = [
        seen(_of_law(rig, model, name), _of_place(model, name), share, by.lapse)
        for name, share in zip(model.names, shares, strict=True)
    ]
    largest = (1.0 - by.lapse) * TUNING.verdict.share_power
    fitting = np.prod([(there + alike) / largest for there, alike in every])
    return tuple(believed(*each) for each in every), float(fitting)


def seen(law: Array | None, place: Array | None, share: float, lapse: float) -> tuple[float, float]:
    """How likely it is that an effect is there and seen so, and that something resembles it and is.
    law (h,): log likelihood of each size of its form error; place (p,): log evidence of each share
    that varies with the place; None where that says nothing.
    """
    there = (1.0 - lapse) * _of_share(share, TUNING.verdict.share_power)
    alike = lapse * _of_share(share, TUNING.verdict.share_power_other)
    if law is not None:
        likelihood = np.exp(law - law.max())
        likelihood /= likelihood @ np.array(TUNING.fit.form_error_prior)
        there *= float(likelihood @ np.array(TUNING.verdict.form_own))
        alike *= float(likelihood @ np.array(TUNING.verdict.form_other))
    if place is not None:
        there *= float(np.exp(place - log_sum(place)) @ np.array(TUNING.verdict.place_odds))
    return there, alike


def believed(there: float, alike: float) -> float:
    """Probability that an effect is there."""
    return there / max(there + alike, SPAN)


def likely(probability: float) -> bool:
    """Likelier than not."""
    return probability > 1.0 - probability


def doubted(trust: float) -> float:
    """The probability of what predicts unseen runs worse than no effect does."""
    odds = TUNING.verdict.worse * trust / max(1.0 - trust, SPAN)
    return odds / (1.0 + odds)


def _of_share(share: float, power: float) -> float:
    """Density of a share of the misfit."""
    return float(power * share ** (power - 1.0))


def _of_law(rig: Rig, model: Model, name: str) -> Array | None:
    """Log likelihood of each size of the form error (h,)."""
    effect = next(one for one in model.fitted.acting if one.name == name)
    return None if _has_line(rig, effect) else model.log_likelihoods(name, "law")


def _of_place(model: Model, name: str) -> Array | None:
    """Log evidence of each share that varies with the place (p,); of what goes with it by itself
    that says nothing.
    """
    goes = EFFECTS[name].fingerprint.covariate == "position"
    known = None if goes else model.log_likelihoods(name, "place")
    return None if known is None else known + np.log(TUNING.fit.place_prior)


def _has_line(rig: Rig, effect: Effect) -> bool:
    """Whether a ripple at the recordings' own rate is the effect's."""
    order = ripples_a_turn(effect)
    return order is not None and any(abs(x.at - order) < x.cell for x in rig.lines.fresh())


def ripples_a_turn(effect: Effect) -> float | None:
    """Of an effect that goes with the wheel's angle."""
    if effect.fingerprint.covariate != TURNING:
        return None
    name = order_of(type(effect))
    return float(getattr(effect, name)) if name else 1.0
