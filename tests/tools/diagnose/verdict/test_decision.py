"""From evidence to what is said: alarms by name, other published forms, learnt probabilities."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import norm

from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.effects.base import Effect, Fingerprint, strength, turning
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar
from gritd.tools.cli.command import CommandError
from gritd.tools.diagnose.fit.columns import whole
from gritd.tools.diagnose.fit.evidence import strength_sizes
from gritd.tools.diagnose.fit.form_error import form_error_sizes
from gritd.tools.diagnose.fit.marginal import Marginal
from gritd.tools.diagnose.fit.model import Model, fit_model
from gritd.tools.diagnose.fit.nuisance import NuisanceColumns
from gritd.tools.diagnose.fit.problem import Fitted, free_of
from gritd.tools.diagnose.fit.random_effect import RandomEffect, Sizes
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.search.calibration import learnt
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict import decide, resemblance
from gritd.tools.proof.ours.calibrate import case_of, learn, log_truth, main, read
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


def _model(acting: Sequence[Effect], name: str) -> Model:
    """A listed effect fitted to recordings in which something acts."""
    rig = wheel_rig(record(plan(seconds=12.0), acting), settings())
    base = fit_base(rig)
    free = free_of((EFFECTS[name],))
    start = np.array([1.0 if f.parameter.role == "strength" else 0.0 for f in free])
    return fit_model(base.problem, (), (EFFECTS[name],), free, (base.fitted.u, start), ())


@dataclass(frozen=True)
class HessSoomFriction(Effect):
    """Break-away friction as T_S/(1 + (ω/ω_S)²) (Hess and Soom 1990)."""

    size: float = strength("size", "", typical=0.6, low=0.0, high=1e6)
    stage = "drivetrain"
    fingerprint = Fingerprint("torque", "constant", "")

    def torque_loss(self, situation: Situation) -> Scalar:
        speed = situation.wheel_speed
        return self.size / (1.0 + (speed / 0.12) ** 2) * turning(speed)


def test_another_published_form_keeps_its_name() -> None:
    """Lorentz's break-away friction is not our Gaussian: ours needs the least bending, the other
    more, and what it is bent by is paid for by far.
    """
    ours = _model((make("stribeck_friction", {"excess": 0.6}),), "stribeck_friction")
    other = _model((HessSoomFriction(size=1.5),), "stribeck_friction")
    assert ours.form_sizes == (form_error_sizes().values[0],) < other.form_sizes
    assert other.marginal is not None
    assert other.evidence > other.marginal.log_evidence((0,)) + 3.0


@pytest.mark.long
def test_the_calibration_is_learnt_from_what_was_true() -> None:
    """Rivals whose evidence is three times too large: the temperature comes out as three."""
    rng, cases = np.random.default_rng(0), []
    for _ in range(400):
        evidence = rng.normal(20.0, 6.0, 3)
        share = np.exp((evidence - evidence.max()) / 3.0)
        truth = rng.choice(["a", "b", "c"], p=share / share.sum())
        weighed = [
            {"names": [n], "nameless": False, "evidence": e}
            for n, e in zip("abc", evidence.tolist(), strict=True)
        ]
        cases.append(case_of(weighed, [str(truth)], False, 3))
    by, score = learn(cases)
    assert by.temperature == pytest.approx(3.0, rel=0.25)
    overconfident = replace(by, temperature=0.5)
    assert score > np.mean([log_truth(case, overconfident) for case in cases])


@dataclass(frozen=True, eq=False)
class Fit:
    """A model of which names, number of parameters and form error alone matter."""

    names: tuple[str, ...]
    parameters: int = 1

    @property
    def fitted(self) -> Any:
        return SimpleNamespace(free=range(self.parameters))

    def form_share(self, name: str) -> float:
        return 0.4


@pytest.fixture
def names_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is fitted; what has parameters misses less of runs that were held out."""
    monkeypatch.setattr(decide, "unexplained_with", lambda *_: None)
    monkeypatch.setattr(decide, "missed", lambda _, fitted: 1.0 - 0.1 * len(fitted.free))


def _searched(bare: Fit) -> Any:
    return SimpleNamespace(bare=bare, base=bare, screening=None, problem=None)


def _judged(
    listed: float, nameless: float, trust: float, parameters: int = 1, name: str = "bulldozing"
) -> Any:
    """One effect that is so far to be trusted against unexplained terms, of so much evidence
    each [nats].
    """
    bare, best = Fit((), 0), Fit((name,), parameters)
    search = _searched(bare)
    weighed: Any = [
        decide.WeighedExplanation(bare, (), 0, 0.0),
        decide.WeighedExplanation(best, (name,), 0, listed, share=0.9, trust=(trust,)),
        decide.WeighedExplanation(bare, (), 1, nameless),
    ]
    return decide.judged(search, weighed, {}, learnt(30))


def test_the_verdict_is_that_of_the_evidence(names_alone: None) -> None:
    named = _judged(900.0, 200.0, 0.9)
    assert named.verdict == "explained" and named.best.names == ("bulldozing",)
    assert named.probability["bulldozing"] == pytest.approx(0.9) and not named.resembled

    strange = _judged(200.0, 900.0, 0.9)
    assert strange.verdict == "unlisted" and strange.best.names == ()
    assert strange.probability["bulldozing"] + strange.unlisted == pytest.approx(1.0)


def test_what_is_likelier_resembled_than_there_is_not_named(
    names_alone: None,
) -> None:
    found = _judged(900.0, 200.0, 0.2)
    assert found.verdict == "unlisted" and found.probability["bulldozing"] == pytest.approx(0.2)
    assert [(r.name, r.share, r.forms) for r in found.resembled] == [("bulldozing", 0.9, 0.4)]


def test_what_predicts_unseen_runs_worse_is_less_likely(names_alone: None) -> None:
    """As well as without it is not better."""
    found = _judged(900.0, 200.0, 0.7, parameters=0)
    assert found.verdict == "unlisted" and found.best.names == () and found.share == 0.0
    assert [(r.name, r.predicts) for r in found.resembled] == [("bulldozing", False)]
    assert found.probability["bulldozing"] < 0.5 < found.unlisted

    assert _judged(900.0, 200.0, 0.7, 0, "sensor_drift").verdict == "explained"  # a zero set anew

    sure = _judged(900.0, 200.0, 0.9, parameters=0)
    assert sure.best.names == ("bulldozing",) and 0.5 < sure.probability["bulldozing"] < 0.8


def test_no_name_is_stated_that_is_less_likely_than_none(names_alone: None) -> None:
    """Listed effects together are likelier than none, but no single one is."""
    by, names = learnt(30), "abc"
    bare, every = Fit((), 0), [Fit((name,)) for name in names]
    even = by.temperature * (by.nameless - by.listed + np.log(30))
    listed = [decide.WeighedExplanation(cast(Any, fit), fit.names, 0, even - 1.0) for fit in every]
    none = decide.WeighedExplanation(cast(Any, bare), (), 1, 0.0)
    found = decide.judged(_searched(bare), [none, *listed], {}, by)
    assert sum(found.probability.values()) > found.unlisted > max(found.probability.values())
    assert found.verdict == "unlisted"


@pytest.mark.parametrize(("more", "said"), [(-0.5, ("a",)), (0.5, ("a", "b"))])
def test_a_further_name_is_stated_where_it_is_likelier_than_none_beside_the_first(
    names_alone: None, monkeypatch: pytest.MonkeyPatch, more: float, said: tuple[str, ...]
) -> None:
    """Three rivals for the second place together are likelier than the first alone, with each
    of them e^more as likely as that.
    """

    def left(_: Any, model: Fit, name: str) -> Fit:
        return Fit(tuple(n for n in model.names if n != name))

    monkeypatch.setattr(decide, "without", left)
    monkeypatch.setattr(decide, "taken_share", lambda *_: 0.9)
    by, one, whole = learnt(30), Fit(("a",)), (1.0, 1.0)
    asked = by.temperature * (np.log(30) - by.more)
    weighed: Any = [decide.WeighedExplanation(one, ("a",), 0, 30.0, 0.0, 0.9, (1.0,))]
    for rival in "bcd":
        fit, gain = Fit(("a", rival)), asked + by.temperature * (more if rival == "b" else -0.5)
        two: Any = fit
        weighed.append(decide.WeighedExplanation(two, fit.names, 0, 30.0 + gain, 0.0, 0.9, whole))
    found = decide.judged(_searched(Fit((), 0)), weighed, {}, by)
    assert found.probability["b"] > found.unlisted
    assert found.best.names == said


def test_of_equals_the_simplest_comes_first(names_alone: None) -> None:
    """Coulomb before Stribeck, unless Stribeck is clearly likelier."""
    bare, plain, richer = Fit((), 0), Fit(("plain",)), Fit(("richer",), 2)
    search = _searched(bare)
    for more, first in ((1.0, "plain"), (20.0, "richer")):
        weighed: Any = [
            decide.WeighedExplanation(richer, richer.names, 0, 900.0 + more),
            decide.WeighedExplanation(plain, plain.names, 0, 900.0),
        ]
        assert decide.judged(search, weighed, {}, learnt(30)).best.names == (first,)


def test_a_simpler_name_that_is_less_likely_than_none_comes_after_one_that_is_likelier(
    names_alone: None,
) -> None:
    by = learnt(30)
    bare, plain, richer = Fit((), 0), Fit(("plain",)), Fit(("richer",), 2)
    even = by.temperature * (by.nameless - by.listed + np.log(30))
    weighed: Any = [decide.WeighedExplanation(cast(Any, bare), (), 1, 0.0)] + [
        decide.WeighedExplanation(
            cast(Any, fit), fit.names, 0, even + by.temperature * more, 0.0, 0.9, (1.0,)
        )
        for fit, more in ((plain, -0.06), (richer, 0.09))
    ]
    found = decide.judged(_searched(bare), weighed, {}, by)
    assert found.probability["plain"] < found.unlisted < found.probability["richer"]
    assert found.best.names == ("richer",)


def sure_of(law: Any, place: Any, share: float, lapse: float) -> float:
    return resemblance.believed(*resemblance.seen(law, place, share, lapse))


def test_a_law_that_must_be_bent_does_not_keep_a_name_from_one_that_fits(
    names_alone: None,
) -> None:
    """As likely as it, and so far off that it only resembles the misfit."""
    bare, fits, bent = Fit((), 0), Fit(("fits",)), Fit(("bent",))
    straight, far = np.array([[0.0, 0, -9, -9], [-9.0, -9, -9, 0]])
    weighed: Any = []
    for model, law in ((fits, straight), (bent, far)):
        there, alike = resemblance.seen(law, None, 0.95, 0.13)
        trust = (resemblance.believed(there, alike),)
        weighed.append(
            decide.WeighedExplanation(
                cast(Any, model), model.names, 0, 900.0, 0.0, 0.0, 0.95, trust, there + alike
            )
        )
    found = decide.judged(_searched(bare), weighed, {}, learnt(30))
    assert found.best.names == ("fits",) and found.probability["fits"] > 0.5


def test_a_form_error_that_no_published_law_needs_tells_against_a_name() -> None:
    """As much likelihood without bending and with it says little; bending that pays says much."""
    straight, open_, bent = np.array([[0.0, -3, -9, -9], [0.0, 0, 0, 0], [-9.0, -9, -9, 0]])
    believed = [sure_of(law, None, 0.9, 0.13) for law in (straight, open_, bent)]
    assert believed[0] > 0.97 > believed[1] > 0.5 and believed[2] < 0.5
    assert sure_of(straight, None, 0.05, 0.13) < believed[0]


def test_an_effect_that_is_there_on_a_part_of_the_bed_only_is_doubted() -> None:
    even, placed = np.array([[0.0, -9, -9], [-9.0, -9, 0]])
    straight, bent = np.array([[0.0, 0, -9, -9], [-9.0, -9, -9, 0]])
    as_sure = sure_of(straight, even, 0.9, 0.13)
    assert as_sure == pytest.approx(sure_of(straight, None, 0.9, 0.13), abs=1e-3)
    assert sure_of(straight, placed, 0.9, 0.13) < 0.9 < as_sure
    assert sure_of(bent, placed, 0.9, 0.13) < 0.2


def test_explanations_with_one_and_with_two_effects_stand_together_against_none(
    names_alone: None,
) -> None:
    """None is the likeliest number, but two of three say that there is something listed."""
    bare, one, two = Fit((), 0), Fit(("a",)), Fit(("a", "b"))
    by = learnt(30)
    weighed: Any = [
        decide.WeighedExplanation(bare, (), 1, 900.0 - by.temperature * by.nameless),
        decide.WeighedExplanation(
            one, ("a",), 0, 900.0 - by.temperature * (by.listed - np.log(30))
        ),
        decide.WeighedExplanation(
            two,
            ("a", "b"),
            False,
            900.0 - by.temperature * (by.listed + by.more - 2.0 * np.log(30) + 0.2),
        ),
    ]
    found = decide.judged(_searched(bare), weighed, {}, by)
    assert found.verdict == "explained" and found.best.names == ("a",)


def test_what_has_no_name_stands_beside_a_rival_too(names_alone: None) -> None:
    """A companion gains little, and unexplained terms gain much beside either model."""
    bare, one, two = Fit((), 0), Fit(("a",)), Fit(("a", "b"))
    alone: Any = [
        decide.WeighedExplanation(one, ("a",), 0, 900.0),
        decide.WeighedExplanation(two, ("a", "b"), 0, 905.0),
        decide.WeighedExplanation(two, ("a", "b"), 1, 1005.0),
    ]
    search = _searched(bare)
    assert decide.judged(search, alone, {}, learnt(30)).best is two
    alone.append(decide.WeighedExplanation(one, ("a",), 1, 1000.0))
    assert decide.judged(search, alone, {}, learnt(30)).best is one


def test_the_learnt_table_is_sound() -> None:
    by = learnt()
    assert 0.5 < by.temperature < 50.0
    assert max(by.more, by.nameless) < 3.0 and by.listed > -5.0
    assert 0.0 < by.lapse < 0.3


def test_a_table_is_learnt_from_campaigns_alone_and_pairs(tmp_path: Path) -> None:
    for number, bed in enumerate([None, "same"]):
        case = tmp_path / "cases" / f"case-{number}"
        case.mkdir(parents=True)
        said = {"names": ["grousers"], "nameless": False, "evidence": 9.0 + number}
        found = {"explanations": [said], "candidates": 30}
        (case / "result.json").write_text(json.dumps(found))
        (tmp_path / "answers").mkdir(exist_ok=True)
        answers = {"effects": ["grousers"], "bed": bed}
        (tmp_path / "answers" / f"{case.name}.json").write_text(json.dumps({"answers": answers}))

    assert [c.evidence.tolist() for c in read(tmp_path)] == [[9.0], [10.0]]

    out = tmp_path / "table.json"
    assert main([str(tmp_path), "--out", str(out)]) == 0
    table = json.loads(out.read_text())
    assert {"temperature", "listed", "more", "nameless", "lapse", "cases"} <= table.keys()

    with pytest.raises(CommandError, match="no trial that raised an alarm"):
        main([str(tmp_path / "answers"), "--out", str(out)])
    assert json.loads(out.read_text()) == table


def test_the_evidence_of_a_fit_is_the_integral() -> None:
    """A linear problem with one constant and one bounded strength: against quadrature over both."""
    rng = np.random.default_rng(5)
    jacobian = rng.standard_normal((30, 2))
    values = jacobian @ np.array([0.7, 1.1]) + rng.standard_normal(30)
    effect = EFFECTS["viscous_friction"]
    free, at, penalty = (
        free_of((effect,)),
        np.array([0.4, 0.8]),
        np.array([1.0, 1.0 / TUNING.fit.strength_prior]),
    )
    residual = values - jacobian @ at
    objective = float(residual @ residual + np.sum((penalty * at) ** 2))
    none = np.zeros((30, 0))
    fixed = RandomEffect("nothing", whole(none), whole(none), Sizes())
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
        NuisanceColumns(((fixed, 1.0),)),
        np.zeros((0, 2)),
        np.zeros(2),
        np.eye(2),
        np.zeros(2, bool),
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
    priors = np.mean([2.0 * norm.pdf(strength, 0.0, s) for s in strength_sizes()], axis=0)
    true = np.trapezoid(np.trapezoid(likelihood * priors, strength, axis=1), constant)
    evidence = Marginal(fitted, (fixed,), ()).log_evidence(())
    assert evidence == pytest.approx(np.log(true) - 0.5 * residual @ residual, abs=0.02)
