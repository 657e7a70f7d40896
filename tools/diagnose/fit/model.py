"""A set of effects, its fit, and its evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.form_error import added_by, baseline_terms, form_errors
from gritd.tools.diagnose.fit.marginal import Chosen, Marginal
from gritd.tools.diagnose.fit.problem import Fitted, Free, Maker, Problem
from gritd.tools.diagnose.fit.random_effect import Kind, RandomEffect
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN


@dataclass(frozen=True, eq=False)
class FormErrors:
    """Other forms of a model's effects: the terms, and which size each has."""

    terms: tuple[RandomEffect, ...] = ()
    sizes: Chosen = ()

    def of(self, names: Sequence[str]) -> FormErrors:
        """Those of some effects."""
        kept = [i for i, f in enumerate(self.terms) if f.name in names]
        return FormErrors(tuple(self.terms[i] for i in kept), tuple(self.sizes[i] for i in kept))


NO_FORM_ERRORS = FormErrors()


@dataclass(frozen=True, eq=False)
class Model:
    """The base model with some effects, fitted together with the constants.

    fitted:   with every term at the size that `chosen` says; of a plain model without any.
    evidence: log evidence, averaged over the sizes of the terms about these.
    sizes:    of each term of form, which one.
    form_sizes: of each term of an effect, its size: how far the effect's form differs.
    """

    fitted: Fitted
    names: tuple[str, ...] = ()
    evidence: float = float("nan")
    sizes: Chosen = ()
    form_sizes: tuple[float, ...] = ()
    marginal: Marginal | None = None
    chosen: Chosen = ()  # sizes of all terms in `marginal`

    @property
    def other_forms(self) -> FormErrors:
        """Of the model's effects, as they were fitted."""
        first = len(self.sizes)
        terms = self.marginal.terms if self.marginal else ()
        return FormErrors(tuple(terms[first:]), self.chosen[first:])

    def discrepancy(self) -> tuple[Array, Array]:
        """What the discrepancies of form amount to (N,): in the channels' units, and whitened."""
        return self._amount(("form", ""))

    def of_form(self, number: int) -> Array:
        """Weights (m,) of one discrepancy of form times its size, averaged over the sizes."""
        assert self.marginal is not None
        return self.marginal.moments(self.chosen, self.marginal.place_of(number))[0]

    def profiles(self, name: str = "") -> tuple[Array, Array]:
        """What effects, or one of them, amount to beyond our formula (N,) along what no law tells
        of: in the channels' units, and whitened.
        """
        return self._amount(("profile",), name)

    def _amount(self, kinds: Sequence[Kind], name: str = "") -> tuple[Array, Array]:
        """Of the acting terms of some kinds, beside what every fit has; name: of one effect."""
        nuisance, slack = self.fitted.nuisance, self.fitted.slack
        ends = np.cumsum([term.columns.count for term, _ in nuisance.parts])
        own = np.zeros_like(self.fitted.residual)
        whitened = np.zeros_like(self.fitted.residual)
        for number, (term, size) in enumerate(nuisance.parts[1:], start=1):
            if term.kind in kinds and name in ("", term.name):
                weights = slack[ends[number - 1] : ends[number]]
                own = own + size * term.columns.times(weights)
                whitened = whitened + size * term.whitened.times(weights)
        return own, whitened

    def log_likelihoods(self, name: str, kind: Kind) -> Array | None:
        """Of each size (h,) of one term of an effect, the others as chosen; None where it has none
        of this kind.
        """
        own = self._term_of(name, kind)
        if self.marginal is None or own is None:
            return None
        return self.marginal.log_likelihoods(self.chosen, own)

    def _term_of(self, name: str, kind: Kind) -> int | None:
        """Which of the terms it is."""
        terms = enumerate(self.marginal.terms if self.marginal else ())
        return next((n for n, term in terms if (term.name, term.kind) == (name, kind)), None)

    def form_share(self, name: str) -> float:
        """Root mean square share by which an effect may act in another form than ours."""
        own = self._term_of(name, "law")
        if self.marginal is None or own is None:
            return 0.0
        return self.marginal.size_of(self.chosen, own)

    def constants(self) -> tuple[Array, Array]:
        """Mean (q,) and covariance (q, q) of the constants in prior σ, averaged over the sizes of
        all terms: how far the forms may be off is part of what is not known of the soil.
        """
        count = len(self.fitted.u)
        if self.marginal is None:
            return self.fitted.u, self.fitted.covariance()[:count, :count]
        return self.marginal.constants(self.chosen, count)

    def parameters(self) -> tuple[Array, Array]:
        """Mean and standard deviation (p,) of the effects' parameters in expected sizes, averaged
        likewise; of one that is held at its bound that of the fit, as if it were not held.
        """
        first, count = len(self.fitted.u), len(self.fitted.x)
        wanted = np.arange(first, first + count)
        sigma = self.fitted.sigma[wanted]
        if self.marginal is None:
            return self.fitted.x, sigma
        mean, covariance = self.marginal.moments(self.chosen, wanted)
        held = self.fitted.held[wanted]
        return mean, np.where(held, sigma, np.sqrt(np.diag(covariance)))


def fit_model(
    problem: Problem,
    forms: Sequence[RandomEffect],
    effects: Sequence[Maker],
    free: Sequence[Free],
    start: tuple[Array, Array],
    sizes: Chosen,
    other_forms: FormErrors = NO_FORM_ERRORS,
    near: Fitted | None = None,
) -> Model:
    """Fit and sizes in turns, until the sizes stay and linear algebra has little to add, a few
    rounds at most. Of a turn counts what its fit reached, and not what other sizes promise there;
    one that ends well below the one before is the last, and does not count.

    Every fit has the terms of its effects too, as far as they are known when it begins. Without
    the other forms that these need, it would strain the constants, to where linear algebra tells
    nothing. The other forms are made anew where the first fits ended, and then stay, unless an
    effect shrinks: of two effects that are nearly one, each could take the other's part from round
    to round.

    problem: without terms; forms: those of the model's form; start: constants (q,) and effect
    parameters (p,); sizes: of the forms, where the search begins; bends: of the first effects, from
    a model that holds them; near: a fit whose derivatives by the constants do for a beginning.

    The evidence counts the objective where the fit stands. Slopes that promise more than it could
    reach, at a kink or a bound, do not count.
    """
    every, sizes = (*forms, *other_forms.terms), (*sizes, *other_forms.sizes)
    fitted = problem.with_terms(every, _values(every, sizes)).descend(
        effects, free, *start, near=near
    )
    made, best = fitted, None
    for number in range(TUNING.numerics.size_rounds):
        known = every
        begun = number < TUNING.numerics.form_rounds
        if begun or _without_form_errors(fitted, every) or _shrunk(problem, made, fitted):
            every, made = (*forms, *form_errors(problem.stack, problem.noise, fitted)), fitted
        of_fit = _handed_on(known, sizes, every)
        marginal = Marginal(fitted, problem.fixed, every)

        beyond = marginal.gain(of_fit)
        sizes, evidence = marginal.likeliest(of_fit)
        reached = (evidence if sizes == of_fit else marginal.log_evidence(of_fit)) - beyond
        if best is not None and reached < best.evidence - TUNING.search.little:
            break
        best = _model(fitted, reached, marginal, of_fit, len(forms))
        if beyond < TUNING.fit.last_step and sizes == of_fit:
            break
        if number + 1 < TUNING.numerics.size_rounds:
            fitted = problem.with_terms(every, _values(every, sizes)).refit(fitted)

    assert best is not None
    return best


def _model(fitted: Fitted, evidence: float, marginal: Marginal, sizes: Chosen, forms: int) -> Model:
    """sizes: of every term in the fit, first so many of the model's form."""
    names = tuple(effect.name for effect in fitted.acting)
    form_sizes = tuple(_values(marginal.terms[forms:], sizes[forms:]))
    return Model(fitted, names, evidence, sizes[:forms], form_sizes, marginal, sizes)


def _without_form_errors(fitted: Fitted, terms: Sequence[RandomEffect]) -> bool:
    """Whether an effect has left its bound since the other forms were made, and has none."""
    own = zip(fitted.free, fitted.x, strict=True)
    acting = {f.name for f, x in own if f.parameter.role == "strength" and x != 0.0}
    return not acting <= {term.name for term in terms}


def _shrunk(problem: Problem, made: Fitted, fitted: Fitted) -> bool:
    """Whether an effect adds less than half of what it did where its other forms were made: they
    would be shares of what is no longer there.
    """
    for number in range(len(fitted.effects)):
        before, now = (added_by(problem.stack, one, number) for one in (made, fitted))
        if _size(problem, now) < 0.5 * _size(problem, before):
            return True
    return False


def _size(problem: Problem, added: Array) -> float:
    """Of what an effect adds (N,), whitened."""
    return float(np.linalg.norm(whiten(problem.noise, added[:, None])))


def does(fitted: Fitted) -> dict[str, float]:
    """Size of what the strengths of each effect do, whitened."""
    done = fitted.own[:, len(fitted.u) :] * fitted.x
    strengths = np.array([f.parameter.role == "strength" for f in fitted.free])
    of = np.array([f.name for f in fitted.free])
    names = (effect.name for effect in fitted.acting)
    return {n: float(np.linalg.norm(done[:, strengths & (of == n)].sum(axis=1))) for n in names}


def squares(stack: Stack, model: Model) -> Array:
    """Of each effect of a model what it does (k, channels), whitened and squared."""
    fitted = model.fitted
    done = (fitted.own[:, len(fitted.u) :] * fitted.x) ** 2
    shown = stack.by_channel(done)
    of = np.array([f.name for f in fitted.free])
    return np.array([shown[:, of == name].sum(axis=1) for name in model.names])


def in_one_place(stack: Stack, model: Model) -> float:
    """How many of a model's effects act in the channels where others act, but one: each by the
    share that its squares have in common with those of the rest.
    """
    if len(model.names) < 2:
        return 0.0
    done = squares(stack, model)
    rest = done.sum(axis=0) - done
    own, rest = (s / np.maximum(s.sum(axis=1, keepdims=True), SPAN) for s in (done, rest))
    common = np.minimum(own, rest).sum(axis=1)
    return float(common.sum() - common.max())


def _handed_on(
    known: Sequence[RandomEffect], sizes: Chosen, every: Sequence[RandomEffect]
) -> Chosen:
    """Of every term the size that it has among the known ones; the smallest where it is new."""
    of_known = dict(zip(_places(known), sizes, strict=True))
    return tuple(of_known.get(place, 0) for place in _places(every))


def _places(terms: Sequence[RandomEffect]) -> list[tuple[str, int]]:
    """The name of each term, and how many of that name stand before it."""
    names = [f.name for f in terms]
    return [(name, names[:number].count(name)) for number, name in enumerate(names)]


def with_forms_had(problem: Problem, model: Model) -> Model:
    """The same fit where what the reference shows by itself may have other forms than ours, as the
    model's effects have: for what is reported of soil and form. A search has none of it.
    """
    if model.marginal is None:
        return model
    had = baseline_terms(problem.stack, problem.noise, model.fitted)
    chosen = (*model.chosen, *(0 for _ in had))
    return replace(model, marginal=model.marginal.beside(had), chosen=chosen) if had else model


def sized_model(
    problem: Problem, forms: Sequence[RandomEffect], start: tuple[Array, Array], sizes: Chosen
) -> Model:
    """Without effects, the forms of given sizes, descended to from constants (q,) and no effect
    parameters (0,).
    """
    fitted = problem.with_terms(forms, _values(forms, sizes)).descend((), (), *start)
    marginal = Marginal(fitted, problem.fixed, forms)
    evidence = marginal.log_evidence(sizes) - marginal.gain(sizes)
    return Model(fitted, (), evidence, sizes, (), marginal, sizes)


def plain_model(problem: Problem, fitted: Fitted) -> Model:
    """A fit without terms, with its evidence."""
    names = tuple(effect.name for effect in fitted.acting)
    return Model(fitted, names, Marginal(fitted, problem.fixed, ()).likeliest(())[1])


def _values(terms: Sequence[RandomEffect], chosen: Chosen) -> list[float]:
    return [f.sizes.values[number] for f, number in zip(terms, chosen, strict=True)]
