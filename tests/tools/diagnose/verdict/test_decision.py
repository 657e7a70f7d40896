"""From evidence to what is said: alarms by name, other published forms, learnt probabilities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.fit.evidence import SCALES
from gritd.tools.diagnose.fit.problem import WIDE, Fitted, free_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.screen.screen import Screen
from gritd.tools.diagnose.verdict import decide, forms
from gritd.tools.diagnose.verdict.calibration import Calibration, learnt
from gritd.tools.proof.ours.calibrate import learn, log_truth, tabled
from gritd.tools.proof.ours.cases import record
from gritd.tools.proof.ours.other_forms import LorentzStribeck
from tests.tools.diagnose.campaigns import plan, settings


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with np.errstate(all="ignore"):
        yield


def test_an_alarm_counts_what_noise_shows_under_the_same_name() -> None:
    """Six nats on a function that slow noise imitates say less than five on one that it cannot."""
    found = Screen(
        {"drift": 6.0, "friction": 5.0},
        {"drift": (4.0, 5.0), "friction": (0.2, 1.0)},
        {},
        {},
        np.zeros(300),
    )
    assert found.largest[0] == "friction"
    assert found.surprise("drift") < 1.0 < found.threshold < found.surprise("friction")


def _evidence(acting: Sequence[Effect], name: str) -> Any:
    """Evidence of a listed effect above the base model, for each degree of difference of forms."""
    rig = WheelRig(record(plan(seconds=12.0), acting), settings())
    base = fit_base(rig, np.random.default_rng(0))
    effect = EFFECTS[name]
    free = free_of((effect,))
    x = np.array([1.0 if f.parameter.role == "strength" else 0.0 for f in free])
    fitted = base.problem.descend((effect,), free, base.fitted.u, x)
    return forms.evidence(base.problem, fitted, base.fitted)


def test_another_published_form_keeps_its_name() -> None:
    """Lorentz's break-away friction is not our Gaussian: with a discrepancy it is evident, ours
    needs none.
    """
    ours = _evidence((make("stribeck_friction", {"excess": 0.6}),), "stribeck_friction")
    other = _evidence((LorentzStribeck(size=1.5),), "stribeck_friction")
    assert np.argmax(ours) == 0
    assert np.argmax(other) > 0
    assert other.max() > other[0] + 3.0


def test_the_calibration_is_learnt_from_what_was_true() -> None:
    """Rivals whose evidence is three times too large: the temperature comes out as three."""
    rng, cases = np.random.default_rng(0), []
    for _ in range(400):
        evidence = rng.normal(20.0, 6.0, 3)
        share = np.exp((evidence - evidence.max()) / 3.0)
        truth = rng.choice(["a", "b", "c"], p=share / share.sum())
        weighed = [[[n], [e] * forms.FORMS] for n, e in zip("abc", evidence.tolist(), strict=True)]
        cases.append(
            {"stratum": "effect", "truth": [str(truth)], "weighed": weighed, "nameless": -1e6}
        )
    by, score = learn(cases)
    assert by.temperature == pytest.approx(3.0, rel=0.25)
    overconfident = Calibration(0.5, by.forms, by.more, by.nameless, by.lapse)
    assert score > log_truth(tabled(cases), overconfident).mean()


@pytest.mark.parametrize(
    "left, verdict", [(0.0, "explained"), (40.0, "explained"), (100.0, "unlisted")]
)
def test_an_explanation_that_leaves_much_is_none(
    left: float, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Five hundred nats gained, by far more than functions without a name alone; what stands out
    beside it decides.
    """
    monkeypatch.setattr(decide, "remaining", lambda *_: (left, left > 0.0))
    base, best = (
        SimpleNamespace(names=n, fitted=SimpleNamespace(objective=o))
        for n, o in (((), 1000.0), (("a",), 0.0))
    )
    search: Any = SimpleNamespace(base=base)
    weighed: Any = [decide.WeighedModel(best, np.full(forms.FORMS, 480.0))]
    found = decide.judged(search, weighed, 200.0, learnt())
    assert found.verdict == verdict
    assert found.probability["a"] + found.unlisted == pytest.approx(1.0 - learnt().lapse)
    assert (found.probability["a"] > 0.5) == (verdict == "explained")


def test_the_learnt_table_is_sound() -> None:
    by = learnt()
    assert 0.5 < by.temperature < 50.0
    assert np.exp(by.forms).sum() == pytest.approx(1.0, abs=0.05)
    assert max(by.more, by.nameless) < 3.0
    assert 0.0 < by.lapse < 0.2


def test_the_evidence_of_a_fit_is_the_integral() -> None:
    """A linear problem with one constant and one bounded strength: against quadrature over both."""
    rng = np.random.default_rng(5)
    jacobian = rng.standard_normal((30, 2))
    values = jacobian @ np.array([0.7, 1.1]) + rng.standard_normal(30)
    effect = EFFECTS["viscous_friction"]
    free, at, penalty = free_of((effect,)), np.array([0.4, 0.8]), np.array([1.0, 1.0 / WIDE])
    residual = values - jacobian @ at
    objective = float(residual @ residual + np.sum((penalty * at) ** 2))
    fitted = Fitted(
        (effect,),
        free,
        at[:1],
        at[1:],
        jacobian @ at,
        residual,
        jacobian,
        jacobian,
        penalty,
        np.zeros(0),
        objective,
    )

    constant, strength = np.linspace(-4.0, 5.0, 300), np.linspace(0.0, 8.0, 400)
    off = (
        values[:, None, None]
        - jacobian[:, 0, None, None] * constant[:, None]
        - jacobian[:, 1, None, None] * strength
    )
    likelihood = (
        np.exp(-0.5 * (np.sum(off**2, axis=0) - residual @ residual)) * norm.pdf(constant)[:, None]
    )
    priors = np.mean([2.0 * norm.pdf(strength, 0.0, s) for s in SCALES], axis=0)
    true = np.trapezoid(np.trapezoid(likelihood * priors, strength, axis=1), constant)
    assert fitted.log_evidence == pytest.approx(np.log(true) - 0.5 * residual @ residual, abs=0.02)
