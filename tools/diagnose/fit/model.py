"""A set of effects, its fit, and its evidence."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.form_error import form_errors, had_freedoms
from gritd.tools.diagnose.fit.marginal import Chosen, Marginal
from gritd.tools.diagnose.fit.problem import Fitted, Free, Maker, Problem
from gritd.tools.diagnose.fit.random_effect import Freedom
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True, eq=False)
class Bends:
    """Other forms of a model's effects: the freedoms, and which size each has."""

    freedoms: tuple[Freedom, ...] = ()
    sizes: Chosen = ()

    def of(self, names: Sequence[str]) -> Bends:
        """Those of some effects."""
        kept = [i for i, f in enumerate(self.freedoms) if f.name in names]
        return Bends(tuple(self.freedoms[i] for i in kept), tuple(self.sizes[i] for i in kept))


NO_BENDS = Bends()


@dataclass(frozen=True, eq=False)
class Model:
    """The base model with some effects, fitted together with the constants.

    fitted:   with every freedom at the size that `chosen` says; of a plain model without any.
    evidence: log evidence, averaged over the sizes of the freedoms about these.
    sizes:    of each freedom of form, which one.
    bends:    of each freedom of an effect, its size: how far the effect's form differs.
    """

    fitted: Fitted
    names: tuple[str, ...] = ()
    evidence: float = float("nan")
    sizes: Chosen = ()
    bends: tuple[float, ...] = ()
    marginal: Marginal | None = None
    chosen: Chosen = ()  # sizes of all freedoms in `marginal`

    @property
    def other_forms(self) -> Bends:
        """Of the model's effects, as they were fitted."""
        first = len(self.sizes)
        freedoms = self.marginal.freedoms if self.marginal else ()
        return Bends(tuple(freedoms[first:]), self.chosen[first:])

    def discrepancy(self) -> tuple[Array, Array]:
        """What the discrepancies of form amount to (N,): in the channels' units, and whitened."""
        return self._amount(0, self._of_form)

    def of_form(self, number: int) -> Array:
        """Weights (m,) of one discrepancy of form times its size, averaged over the sizes."""
        assert self.marginal is not None
        return self.marginal.moments(self.chosen, self.marginal.place_of(number))[0]

    def zeros(self) -> Array:
        """What zeros without a law amount to beyond our formula of them (N,), whitened: of effects
        that go as they like along some covariate.
        """
        free = {effect.name for effect in self.fitted.acting if effect.free_along}
        return self._amount(self._of_form, len(self.fitted.allowance.parts) - 1, free)[1]

    @property
    def _of_form(self) -> int:
        """How many freedoms of form act."""
        freedoms = self.marginal.freedoms if self.marginal else ()
        sizes = _values(freedoms[: len(self.sizes)], self.sizes) if freedoms else []
        return sum(size > 0.0 for size in sizes)

    def _amount(
        self, begin: int, end: int, names: Collection[str] | None = None
    ) -> tuple[Array, Array]:
        """Of the acting freedoms begin … end − 1, beside what every fit has; of some names only."""
        allowance, slack = self.fitted.allowance, self.fitted.slack
        ends = np.cumsum([freedom.columns.shape[1] for freedom, _ in allowance.parts])
        own = np.zeros_like(self.fitted.residual)
        whitened = np.zeros_like(self.fitted.residual)
        for number in range(begin + 1, end + 1):
            freedom, size = allowance.parts[number]
            if names is not None and freedom.name not in names:
                continue
            weights = slack[ends[number - 1] : ends[number]]
            own = own + size * (freedom.columns @ weights)
            whitened = whitened + size * (freedom.whitened @ weights)
        return own, whitened

    def of_forms(self, name: str) -> Array | None:
        """Log likelihood (h,) of each size by which an effect may act in another form than ours,
        the other freedoms as chosen; None where it has no other form.
        """
        own = self._form_of(name)
        if self.marginal is None or own is None:
            return None
        return self.marginal.log_likelihoods(self.chosen, own)

    def _form_of(self, name: str) -> int | None:
        """Which freedom holds other forms of an effect: the last of its own."""
        every = list(enumerate(self.marginal.freedoms if self.marginal else ()))
        own = [number for number, freedom in every[len(self.sizes) :] if freedom.name == name]
        return own[-1] if own else None

    def form_share(self, name: str) -> float:
        """Root mean square share by which an effect may act in another form than ours."""
        own = self._form_of(name)
        if self.marginal is None or own is None:
            return 0.0
        return self.marginal.size_of(self.chosen, own)

    def constants(self) -> tuple[Array, Array]:
        """Mean (q,) and covariance (q, q) of the constants in prior σ, averaged over the sizes of
        all freedoms: how far the forms may be off is part of what is not known of the soil.
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
    forms: Sequence[Freedom],
    effects: Sequence[Maker],
    free: Sequence[Free],
    start: tuple[Array, Array],
    sizes: Chosen,
    bends: Bends = NO_BENDS,
    near: Fitted | None = None,
) -> Model:
    """Fit and sizes in turns, until the sizes stay and linear algebra has little to add, a few
    rounds at most.

    Every fit has the freedoms of its effects too, as far as they are known when it begins. Without
    the other forms that these need, it would strain the constants, to where linear algebra tells
    nothing. The other forms are made anew where the first fits ended, and then stay: of two effects
    that are nearly one, each could take the other's part from round to round.

    problem: without freedoms; forms: those of the model's form; start: constants (q,) and effect
    parameters (p,); sizes: of the forms, where the search begins; bends: of the first effects, from
    a model that holds them; near: a fit whose derivatives by the constants do for a beginning.

    The evidence counts the objective where the fit stands. Slopes that promise more than it could
    reach, at a kink or a bound, do not count.
    """
    every, sizes = (*forms, *bends.freedoms), (*sizes, *bends.sizes)
    fitted = problem.with_freedoms(every, _values(every, sizes)).descend(
        effects, free, *start, near=near
    )
    for number in range(TUNING.fit.size_rounds):
        known = every
        if number < TUNING.fit.bent_anew or _unbent(fitted, every):
            every = (*forms, *form_errors(problem.stack, problem.noise, fitted))
        of_fit = _handed_on(known, sizes, every)
        marginal = Marginal(fitted, problem.fixed, every)

        beyond = marginal.gain(of_fit)
        sizes, evidence = marginal.likeliest(of_fit)
        done = beyond < TUNING.fit.last_step
        if (done and sizes == of_fit) or number + 1 == TUNING.fit.size_rounds:
            break
        fitted = problem.with_freedoms(every, _values(every, sizes)).refit(fitted)

    names = tuple(effect.name for effect in fitted.acting)
    of_forms, of_bends = of_fit[: len(forms)], of_fit[len(forms) :]
    bent = tuple(_values(every[len(forms) :], of_bends))
    return Model(fitted, names, evidence - beyond, of_forms, bent, marginal, of_fit)


def _unbent(fitted: Fitted, freedoms: Sequence[Freedom]) -> bool:
    """Whether an effect has left its bound since the other forms were made, and has none."""
    own = zip(fitted.free, fitted.x, strict=True)
    acting = {f.name for f, x in own if f.parameter.role == "strength" and x != 0.0}
    return not acting <= {freedom.name for freedom in freedoms}


def _handed_on(known: Sequence[Freedom], sizes: Chosen, every: Sequence[Freedom]) -> Chosen:
    """Of every freedom the size that it has among the known ones; the smallest where it is new."""
    of_known = dict(zip(_places(known), sizes, strict=True))
    return tuple(of_known.get(place, 0) for place in _places(every))


def _places(freedoms: Sequence[Freedom]) -> list[tuple[str, int]]:
    """The name of each freedom, and how many of that name stand before it."""
    names = [f.name for f in freedoms]
    return [(name, names[:number].count(name)) for number, name in enumerate(names)]


def with_forms_had(problem: Problem, model: Model) -> Model:
    """The same fit where what the reference shows by itself may have other forms than ours, as the
    model's effects have: for what is reported of soil and form. A search has none of it.
    """
    if model.marginal is None:
        return model
    with problem.stack.rig.aside():
        had = had_freedoms(problem.stack, problem.noise, model.fitted)
    chosen = (*model.chosen, *(0 for _ in had))
    return replace(model, marginal=model.marginal.beside(had), chosen=chosen) if had else model


def sized_model(
    problem: Problem, forms: Sequence[Freedom], start: tuple[Array, Array], sizes: Chosen
) -> Model:
    """Without effects, the forms of given sizes, descended to from constants (q,) and no effect
    parameters (0,).
    """
    fitted = problem.with_freedoms(forms, _values(forms, sizes)).descend((), (), *start)
    marginal = Marginal(fitted, problem.fixed, forms)
    evidence = marginal.log_evidence(sizes) - marginal.gain(sizes)
    return Model(fitted, (), evidence, sizes, (), marginal, sizes)


def plain_model(problem: Problem, fitted: Fitted) -> Model:
    """A fit without freedoms, with its evidence."""
    names = tuple(effect.name for effect in fitted.acting)
    return Model(fitted, names, Marginal(fitted, problem.fixed, ()).likeliest(())[1])


def _values(freedoms: Sequence[Freedom], chosen: Chosen) -> list[float]:
    return [f.sizes.values[number] for f, number in zip(freedoms, chosen, strict=True)]
