"""What is reported of the soil: averaged over all explanations, of the new campaign where there is
a reference.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain.result import Quantity, SoilFit
from gritd.tools.diagnose.fit.model import Model, with_forms_had
from gritd.tools.diagnose.fit.problem import Fitted, Problem
from gritd.tools.diagnose.rig.interface import Constant, Rig
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SLIGHT, SUMMED
from gritd.tools.diagnose.verdict.decision import Decision


def soil_of(problem: Problem, before: Fitted, decision: Decision) -> SoilFit | None:
    """Prior, fit of the exact model, average over the explanations, and strain; None without
    soil.
    """
    rig = problem.stack.rig
    soil = [k for k in rig.constants if k.soil]
    if not soil:
        return None
    strain = {k.name: float(u) for k, u in zip(rig.constants, before.u, strict=True) if k.soil}
    prior = {k.name: Quantity(k.value, k.sigma, k.unit) for k in soil}
    return SoilFit(prior, constants_of(rig, before, True), averaged_soil(problem, decision), strain)


def constants_of(rig: Rig, fitted: Fitted, soil: bool) -> dict[str, Quantity]:
    """Constants of one fit: of the soil, or all others."""
    count = len(fitted.u)
    spread = fitted.covariance()[:count, :count]
    return {k.name: _quantity(rig, k, fitted.u, spread) for k in rig.constants if k.soil == soil}


def averaged_soil(problem: Problem, decision: Decision) -> dict[str, Quantity]:
    """The soil, averaged over all explanations by their probabilities: which of them is true is
    part of what is not known.
    """
    rig = problem.stack.rig
    weighed = [(w.model, w.probability) for w in decision.weighed]
    likely = [(model, share) for model, share in weighed if share > TUNING.screen.level]
    every = likely or [(decision.best, 1.0)]

    soils = [(_soil_of(problem, model), share) for model, share in every]
    total = sum(share for _, share in soils)

    out = {}
    for name, first in soils[0][0].items():
        mean = sum(share * soil[name].value for soil, share in soils) / total
        square = sum(
            share * (soil[name].sigma ** 2 + (soil[name].value - mean) ** 2)
            for soil, share in soils
        )
        out[name] = Quantity(mean, float(np.sqrt(square / total)), first.unit)

    return {k.name: _beside_prior(k, out[k.name]) for k in rig.constants if k.name in out}


def _beside_prior(known: Constant, fitted: Quantity) -> Quantity:
    """What was found, with a σ that what was known before is within reach of.

    Two determinations that contradict each other are off by more than their σ say, both of them
    (Birge 1932, Phys. Rev. 40, 207-227): the form of the model may have moved the soil, or the
    earlier measurement was wrong, and the recordings do not tell which.
    """
    reach, strain = TUNING.explain.strained_soil, known.strain(fitted.value)
    if abs(strain) <= reach:
        return fitted
    return replace(fitted, sigma=max(fitted.sigma, known.spread(strain, abs(strain) / reach)))


def _soil_of(problem: Problem, model: Model) -> dict[str, Quantity]:
    """The soil of one explanation. What stands at its bound is not known better than before."""
    rig = problem.stack.rig
    mean, spread = with_forms_had(problem, model).constants()
    found = {}
    for constant, held in zip(rig.constants, model.fitted.held, strict=False):
        if constant.soil:
            quantity = _quantity(rig, constant, mean, spread)
            before = _quantity(rig, constant, mean, np.eye(len(mean)))
            own = replace(quantity, sigma=constant.sigma) if held else quantity
            found[constant.name] = _doubting(constant, own, before.sigma)
    return found


def _doubting(known: Constant, fitted: Quantity, before: float) -> Quantity:
    """With what was known and what the recordings say weighed by how well they agree.

    before: σ of what was known, in the constant's unit, where it was fitted.
    """
    u = known.strain(fitted.value)
    wider = before / known.spread(u, 1.0)  # a bed prepared anew is less known
    mean, sigma = reconciled(u / wider, fitted.sigma / before)
    value = known.of(wider * mean)
    return replace(fitted, value=value, sigma=known.spread(wider * mean, wider * sigma))


def _quantity(rig: Rig, constant: Constant, mean: Array, spread: Array) -> Quantity:
    """Value and σ of a constant from the mean (q,) and covariance (q, q) of all, in prior σ; of a
    bed that was prepared anew, in the new campaign.
    """
    value, slope = linear(rig, constant, mean)
    return Quantity(value, float(np.sqrt(slope @ spread @ slope)), constant.unit)


def linear(rig: Rig, constant: Constant, mean: Array) -> tuple[float, Array]:
    """Value of a constant at the mean (q,) of all in prior σ, and its slope (q,) along them; of a
    bed that was prepared anew, in the new campaign.
    """
    place = rig.constants.index(constant)
    u = float(mean[place])
    value, slope = constant.of(u), np.zeros(len(mean))
    slope[place] = constant.spread(u, 1.0)

    for number, change in enumerate(rig.constants):
        if change.changes == constant.name:
            factor = float(np.exp(change.of(float(mean[number]))))
            value, slope = factor * value, factor * slope
            slope[number] = value * change.sigma
    return value, slope


# ---- what was known, and what the recordings say -------------------------------------------------


def reconciled(mean: float, sigma: float) -> tuple[float, float]:
    """Mean and σ in units of the prior σ, about the prior's mean, from those of a Gaussian fit,
    where what was known and what the recordings say may contradict each other.

    A fit takes both for Gaussian: m = prior and recordings weighed by their σ, however far apart
    they lie. Recordings that tell little of the soil may still pull it far, by what the form of the
    model misses: 15 σ off, each σ twice that of what was known, say. No soil explains that, but
    Gaussians cannot doubt. So both have tails here. What was stated of the soil is wrong in one
    case of a hundred. The recordings' own σ is known from few independent conditions, so that what
    they say has Student's distribution. What contradicts is then doubted, the vaguer of the two
    first, and two that agree stay as they were (O'Hagan and Pericchi 2012, Braz. J. Probab. Stat.
    26, 372-401).
    """
    precision = 1.0 / sigma**2 - 1.0 if sigma > 0.0 else np.inf  # by the recordings: precision
    if not SLIGHT < precision < 1.0 / SLIGHT:
        return mean, sigma
    value, own = mean * (1.0 + precision) / precision, precision**-0.5

    at = _points(value, own)
    density = _prior(at) * _student((at - value) / own)
    weight = density * np.gradient(at)
    weight /= weight.sum()
    middle = float(weight @ at)
    return middle, float(np.sqrt(weight @ (at - middle) ** 2))


def _points(value: float, own: float) -> Array:
    """Where the densities are summed: fine about both, out to where both have ended."""
    unit = np.tan(0.5 * np.pi * np.linspace(-1.0, 1.0, SUMMED)[1:-1])
    return np.unique(np.concatenate((unit, value + min(own, 1.0) * unit)))


def _prior(at: Array) -> Array:
    wrong, far = TUNING.screen.level, TUNING.explain.stated_far
    return np.asarray((1.0 - wrong) * _normal(at) + wrong / far * _normal(at / far))


def _normal(at: Array) -> Array:
    return np.exp(-0.5 * at**2)


def _student(at: Array) -> Array:
    freedom = TUNING.explain.precision_freedom
    return np.asarray((1.0 + at**2 / freedom) ** (-0.5 * (freedom + 1.0)))
