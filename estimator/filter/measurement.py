"""The measurement of one window, linearised at an estimate: innovation, Jacobians, noise, σ of
what is predicted.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan, sqrt
from operator import mul
from typing import NamedTuple

import numpy as np

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import Settings
from gritd.estimator.filter import form_error
from gritd.estimator.filter.estimate import (
    KPA,
    STATES,
    Estimate,
    Matrix,
    Update,
    Vector,
    dot,
    soil,
    variance,
)
from gritd.estimator.filter.felt import by_estimate, effects_added, raised, soil_here, with_added
from gritd.estimator.filter.model import ForcePrediction, FormError, PredictedQuantity, WheelModel
from gritd.estimator.filter.nuisance import (
    EXPONENT,
    PEAK,
    PEAK_BY_SLIP,
    Sensitivity,
    nuisances,
)
from gritd.estimator.filter.tuning import FORM
from gritd.estimator.stages.situation import Recall
from gritd.estimator.terramechanics.soil import Array
from gritd.estimator.wheel.chain import Chain, Context, variants
from gritd.estimator.wheel.form import NAME, FormHere, Three
from gritd.estimator.wheel.sync import Snapshot
from gritd.estimator.wheel.wheel_state import WheelState, wheel_state, wheeling

COMPONENTS = ("torque", "drawbar_pull")  # what the filter is offered, in this order

# ∂(T, DP) by each uncertain effect parameter, in its σ
ByParameters = tuple[tuple[float, float], ...]


class Shared(NamedTuple):
    """A linearised prediction, and its gradients by the errors that all windows share."""

    sensitivity: Sensitivity
    torque: Vector  # (q,)
    pull: Vector  # (q,)


class Measurement:
    """Settings turned into h(x), its Jacobians and R.

    The vector is [c/kPa, tan φ, ln k], then the nuisances (nuisance.py), the uncertain parameters
    of effects, the directions of the learnt discrepancy, and the errors of form at their nodes
    (form_error.py): of the torque, and of the drawbar pull where it is measured.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.chain = Chain(settings, configured(settings.effects))
        self.model = WheelModel(settings, self.chain)
        self.nuisances = nuisances(settings)

        self._variants = _variants(settings)
        # before the first update
        self.unmoved: ByParameters = ((0.0, 0.0),) * len(self._variants)
        pulls = settings.wrench is not None and settings.wrench.pulls
        turns = settings.drive.torque_source != "none"
        # which of COMPONENTS are measured on this rig
        self.components = tuple([at for at, has in enumerate((turns, pulls)) if has])
        names = [nuisance.name for nuisance in self.nuisances]
        self._stress_places = tuple(
            [
                STATES + names.index(name) if name in names else None
                for name in (EXPONENT, PEAK, PEAK_BY_SLIP)
            ]
        )
        # windows over which the rest of the discrepancy stays the same
        self._lasting = max(FORM.lasting * settings.rates.update, 1.0)

    def prior(self, soil: Array, size: float) -> Array:
        """Covariance (d, d) before the run, of the soil (3, 3) and all that is estimated with it;
        size: of the error of form.
        """
        ones = len(self._variants) + directions_of(self.settings)
        known = [*[nuisance.sigma**2 for nuisance in self.nuisances], *[1.0] * ones]
        form = size**2 * form_error.prior()
        parts = [soil, np.diag(known), *[form] * len(self.components)]

        total = integer_sum(len(part) for part in parts)
        P, at = np.zeros((total, total)), 0
        for part in parts:
            P[at : at + len(part), at : at + len(part)] = part
            at += len(part)
        return P

    @property
    def nonlinear(self) -> tuple[int, ...]:
        """Entries of the vector that the tangents change with: the soil and the stresses' shape."""
        return (*range(STATES), *[at for at in self._stress_places if at is not None])

    @property
    def learnt_columns(self) -> slice:
        """Where the directions of the learnt discrepancy stand in the vector."""
        first = STATES + len(self.nuisances) + len(self._variants)
        return slice(first, first + directions_of(self.settings))

    def state(self, snapshot: Snapshot, context: Context, estimate: Estimate) -> WheelState:
        """The window in the wheel's own terms, effects accounted for."""
        return self._sensed(self.model, self.chain, snapshot, context, estimate)

    def by_parameters(
        self, now: WheelState, snapshot: Snapshot, context: Context, estimate: Estimate
    ) -> ByParameters:
        """How predicted (T, DP) change with one σ of each uncertain effect parameter."""
        if not self._variants:
            return ()

        here = _innovation(now, self.predict(estimate, now))
        changes = []
        for model, chain in self._variants:
            moved = self._sensed(model, chain, snapshot, context, estimate)
            there = _innovation(moved, self._predicted(model, estimate, moved))
            changes.append((here[0] - there[0], here[1] - there[1]))
        return tuple(changes)

    def predict(self, estimate: Estimate, now: WheelState) -> ForcePrediction:
        """T, DP and resistance of the equations at the estimate, in this window's geometry."""
        return self._predicted(self.model, estimate, now)

    def shared(
        self, now: WheelState, prediction: ForcePrediction, by_parameters: ByParameters
    ) -> Shared:
        """How a prediction follows the errors that all windows share."""
        sensitivity = _sensitivity(now, prediction)
        return Shared(sensitivity, *self._shared_gradients(sensitivity, now, by_parameters))

    def expected(
        self, estimate: Estimate, prediction: ForcePrediction, shared: Shared
    ) -> tuple[float, float]:
        """T [N·m] and DP [N] as the sensors should read them: the prediction, and the errors that
        all windows share.
        """
        x = self._without_stresses(estimate.x)
        return (
            prediction.torque.value + dot(shared.torque, x),
            prediction.drawbar_pull.value + dot(shared.pull, x),
        )

    def form_of(self, estimate: Estimate) -> FormError:
        """What the estimate adds to the configured shape of the stresses."""
        return FormError(*[0.0 if at is None else estimate.x[at] for at in self._stress_places])

    def at_slip(self, now: WheelState, slip: float) -> WheelState:
        """The window at another slip that is held."""
        there = now._replace(slip=now.slip._replace(value=slip))
        form = self.chain.form
        if form is None or now.form is None:
            return there
        return there._replace(form=form.at_slip(now.form, slip))

    def remember(
        self, recall: Mapping[str, Recall], elapsed: float, now: WheelState, snapshot: Snapshot
    ) -> Mapping[str, Recall]:
        """What effects and discrepancy remember, `elapsed` [s] later, after a window."""
        form = self.chain.form
        after = recall
        if now.situation is not None:
            after = self.chain.remember(recall, elapsed, now.situation)

        if form is None or now.form is None:
            return after
        lagging = form.remember(wheeling(now, snapshot.wheel_angle), recall.get(NAME, ()))
        return {**after, NAME: lagging}

    def linearise(
        self,
        now: WheelState,
        prediction: ForcePrediction,
        estimate: Estimate,
        by_parameters: ByParameters,
    ) -> Update:
        """Innovation, H and R of the components that are measured."""
        torque, pull = prediction.torque, prediction.drawbar_pull
        sensitivity, by_torque, by_pull = self.shared(now, prediction, by_parameters)
        x = self._without_stresses(estimate.x)

        update = Update(
            innovation=(
                now.torque.value - torque.value - dot(by_torque, x),
                now.drawbar_pull.value - pull.value - dot(by_pull, x),
            ),
            H=((*_state_gradient(torque), *by_torque), (*_state_gradient(pull), *by_pull)),
            R=self._noise(now, sensitivity),
        )
        return update.of(self.kept(now))

    def kept(self, now: WheelState) -> tuple[int, ...]:
        """Which of COMPONENTS a window measures."""
        values = (now.torque.value, now.drawbar_pull.value)
        return tuple([at for at in self.components if not isnan(values[at])])

    def _without_stresses(self, x: Vector) -> Vector:
        """The errors (q,) that shift the measurements in proportion to their gradients: not those
        of the stresses, which the model follows.
        """
        kept = list(x)
        for at in self._stress_places:
            if at is not None:
                kept[at] = 0.0
        return tuple(kept[STATES:])

    def _shared_gradients(
        self, s: Sensitivity, now: WheelState, by_parameters: ByParameters
    ) -> tuple[Vector, Vector]:
        """Of T and DP (q,) each: by the calibration, the effects' parameters, the learnt
        discrepancy, and the error of form.
        """
        columns = [*[nuisance.gradient(s) for nuisance in self.nuisances], *by_parameters]
        if now.form is not None:
            columns += [_felt(column, s) for column in now.form.columns]

        wheel, load = self.chain.wheel, now.load.value
        shares = form_error.shares(wheel, now.slip.value, load)
        of_torque = [wheel.radius * load * share for share in shares]
        of_pull = [load * share for share in shares]
        none = [0.0] * form_error.NODES

        torque = [column[0] for column in columns]
        pull = [column[1] for column in columns]
        for component in self.components:
            torque += of_torque if component == 0 else none
            pull += none if component == 0 else of_pull
        return tuple(torque), tuple(pull)

    def _noise(self, now: WheelState, s: Sensitivity) -> Matrix:
        """R (2, 2): each component's own noise, and that of z, i and W through the Jacobians,
        which T and DP share.
        """
        sigmas = (now.sinkage.sigma, now.slip.sigma, now.load.sigma)
        by_torque, by_pull = zip(s.by_sinkage, s.by_slip, s.by_load, strict=True)
        torque, pull = tuple(map(mul, by_torque, sigmas)), tuple(map(mul, by_pull, sigmas))

        common = dot(torque, pull)
        noise = (
            (dot(torque, torque) + now.torque.sigma**2, common),
            (common, dot(pull, pull) + now.drawbar_pull.sigma**2),
        )
        return noise if now.form is None else _plus_rest(noise, _rest(now.form, s), self._lasting)

    def sigmas(
        self, estimate: Estimate, now: WheelState, prediction: ForcePrediction, shared: Shared
    ) -> tuple[float, float, float]:
        """σ of T, DP and resistance predicted: of the estimate, and of this window's z, i and W."""
        sensitivity, torque, pull = shared
        of_torque, of_pull = _rest(now.form, sensitivity) if now.form is not None else ((), ())
        no_sensor = (0.0,) * len(torque)

        return (
            self._sigma(estimate, now, prediction.torque, torque, of_torque),
            self._sigma(estimate, now, prediction.drawbar_pull, pull, of_pull),
            self._sigma(estimate, now, prediction.resistance, no_sensor),
        )

    def _sigma(
        self,
        estimate: Estimate,
        now: WheelState,
        quantity: PredictedQuantity,
        shared: Vector,
        rest: Vector = (),
    ) -> float:
        noise = (
            quantity.by_theta_1 * now.theta_1.d_sinkage * now.sinkage.sigma,
            quantity.by_slip * now.slip.sigma,
            quantity.by_load * now.load.sigma,
            *rest,
        )
        known = variance(estimate, (*_state_gradient(quantity), *shared))
        return sqrt(known + dot(noise, noise))

    def _sensed(
        self,
        model: WheelModel,
        chain: Chain,
        snapshot: Snapshot,
        context: Context,
        estimate: Estimate,
    ) -> WheelState:
        """The window with one chain of effects; what wheel and testbed effects add is linear about
        the estimate.
        """
        now = wheel_state(self.settings, snapshot, chain, context)
        if now.situation is None or not chain.reacts or now.theta_1.value <= 0.0:
            return now

        rim = self._predicted(model, estimate, now)
        return now._replace(added=effects_added(chain, now, rim, soil(estimate)))

    def _predicted(self, model: WheelModel, estimate: Estimate, now: WheelState) -> ForcePrediction:
        """T, DP and resistance of the rim in the soil under this window, and what effects add,
        along the estimate.
        """
        ground = soil(estimate) if now.here is None else soil_here(estimate, now.here)

        prediction = model.predict(
            *ground, now.theta_1.value, now.slip.value, now.load.value, self.form_of(estimate)
        )
        if now.here is not None:
            here = now.here
            prediction = ForcePrediction(
                *(by_estimate(quantity, estimate, here) for quantity in prediction)
            )

        if now.form is not None:
            torque, pull, _ = now.form.mean
            prediction = prediction._replace(
                torque=raised(prediction.torque, torque),
                drawbar_pull=raised(prediction.drawbar_pull, pull),
            )

        if now.added is None:
            return prediction
        return with_added(prediction, now.added, estimate)


def directions_of(settings: Settings) -> int:
    """How many directions the learnt discrepancy of form is uncertain in."""
    return 0 if settings.discrepancy is None else settings.discrepancy.directions


def _felt(changed: Three, s: Sensitivity) -> tuple[float, float]:
    """Change of the predicted (T, DP) with a change of δ in torque, pull and sinkage: the sinkage
    that the equations would give is the measured one less δ.
    """
    torque, pull, sinkage = changed
    return torque - s.by_sinkage[0] * sinkage, pull - s.by_sinkage[1] * sinkage


def _rest(form: FormHere, s: Sensitivity) -> tuple[Vector, Vector]:
    """What the rest of δ makes of predicted T and of DP: of their own, and by the sinkage."""
    torque, pull, sinkage = form.rest
    return (torque, s.by_sinkage[0] * sinkage), (pull, s.by_sinkage[1] * sinkage)


def _plus_rest(noise: Matrix, rest: tuple[Vector, Vector], lasting: float) -> Matrix:
    """R (2, 2) with the rest of δ. It is the same in so many windows, so each bears that many times
    its variance: their mean is then off by the rest, as one window is.
    """
    (a, b), (_, d) = noise
    torque, pull = rest
    b += lasting * torque[1] * pull[1]
    return (a + lasting * dot(torque, torque), b), (b, d + lasting * dot(pull, pull))


def _innovation(now: WheelState, prediction: ForcePrediction) -> tuple[float, float]:
    """Measured minus predicted T and DP; 0 where one is not measured."""
    torque = now.torque.value - prediction.torque.value
    pull = now.drawbar_pull.value - prediction.drawbar_pull.value
    return 0.0 if isnan(torque) else torque, 0.0 if isnan(pull) else pull


def _variants(settings: Settings) -> list[tuple[WheelModel, Chain]]:
    """Model and effects with one uncertain effect parameter moved by its sigma."""
    moved = [Chain(settings, effects) for effects in variants(settings)]
    return [(WheelModel(settings, chain), chain) for chain in moved]


def _sensitivity(now: WheelState, prediction: ForcePrediction) -> Sensitivity:
    torque, pull = prediction.torque, prediction.drawbar_pull
    by_z = now.theta_1.d_sinkage

    return Sensitivity(
        torque=torque.value,
        drawbar_pull=pull.value,
        sinkage=now.sinkage.value,
        slip=now.slip.value,
        load=now.load.value,
        by_sinkage=(torque.by_theta_1 * by_z, pull.by_theta_1 * by_z),
        by_slip=(torque.by_slip, pull.by_slip),
        by_load=(torque.by_load, pull.by_load),
        by_exponent=(torque.by_exponent, pull.by_exponent),
        by_peak=(torque.by_peak, pull.by_peak),
    )


def _state_gradient(quantity: PredictedQuantity) -> Vector:
    """Gradient with respect to the scaled state [c/kPa, tan φ, ln k]."""
    return quantity.by_c * KPA, quantity.by_tan_phi, quantity.by_ln_k
