"""Other published forms of an effect, as a term of the fit.

A listed effect stands for its physics, not for one formula. Another form differs from ours by a
smooth share of what the effect does. An effect that adds S(x) to all channels may therefore add

    S(x) (1 + h(x)),   h(x) = Σ aⱼ φⱼ(x),   aⱼ ~ N(0, ρ²/m)

with one h for all channels: the strength itself varies smoothly with the conditions, with time and
along the bed, as another formula for it would have it. Beside h each channel has a factor of its
own, since another formula shares the effect out among the channels in another way; and an effect
may do more one way than the other, as a gear loses torque by which side drives. What an effect of
the soil does may follow slip and load over an arc of rolling, and build up where each run begins:
soil has to move first. Another law of shear does as much at another shear displacement, so it may
act as a change of slip too. No law says what profile a rim, a hub or a tooth has, so a ripple may
also have other harmonics, of up to twice its size. No wall, rail, pulley or bed is the same all
along, so what is of neither the drive nor its current may also vary with the place, in waves of any
length down to a twelfth of the way, with a size of its own, which is mostly nought. No law says how
a zero creeps, or how it is set before each run: it may follow any smooth function, of up to twice
the size of our formula. What the parameters of the model's effects can do is taken out of all this,
so that a strength is what its effect does on the whole; so is what the constants of a drive without
soil can do. ρ is how far published forms differ; its prior is over 0 to 40 %. Our own form may be
the best one to name an effect by, but the soil is never reported as if it were exact: where the
soil can absorb most of an effect, another form of it changes the soil and hardly the fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.effects.base import Effect, order_of
from gritd.estimator.stages.history import followed, run_begins
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.functions import along, along_place, shares
from gritd.tools.diagnose.fit.problem import Fitted, build
from gritd.tools.diagnose.fit.random_effect import Kind, RandomEffect, Sizes, even, random_effect
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.rig.interface import HAD, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import DEPENDENT, SLIGHT, SQUARE

EXACT = ("sensor",)  # stages at which there is but one form: offsets, scales, delays
OF_SHEAR = "contact"  # the stage of shear stress, which follows the shear displacement
OF_SOIL = ("soil", "contact", "wheel")  # stages whose effects follow: soil has to move first


def form_error_sizes() -> Sizes:
    """Shares by which published forms of an effect differ, with their prior."""
    return Sizes(TUNING.fit.form_error_sizes, TUNING.fit.form_error_prior)


def form_errors(stack: Stack, noise: Noise, fitted: Fitted) -> tuple[RandomEffect, ...]:
    """Of each effect of a fit that changes anything: its other forms, and of a zero any at all."""
    numbered = enumerate(fitted.acting)
    acting = [_Acting(effect, added_by(stack, fitted, number)) for number, effect in numbered]
    own = np.arange(len(fitted.u), len(fitted.centre))
    return _forms_of(stack, noise, fitted, acting, own)


def baseline_terms(stack: Stack, noise: Noise, fitted: Fitted) -> tuple[RandomEffect, ...]:
    """The same of each effect that the reference shows by itself, in both campaigns."""
    constants = stack.rig.constants
    own = [number for number, constant in enumerate(constants) if constant.kind == HAD]
    names = dict.fromkeys(constants[number].parameter[0] for number in own)
    acting = [_had(stack, fitted, name) for name in names]
    return _forms_of(stack, noise, fitted, acting, np.array(own, dtype=np.intp))


@dataclass(frozen=True, eq=False)
class _Acting:
    """An effect, and what it adds to the prediction (N,)."""

    effect: Effect
    added: Array


def _had(stack: Stack, fitted: Fitted, name: str) -> _Acting:
    """An effect of the reference, whose strengths are constants of the rig."""
    strengths = {p.name for p in EFFECTS[name].parameters() if p.role == "strength"}
    values, without = {}, fitted.u.copy()
    for number, constant in enumerate(stack.rig.constants):
        effect, parameter = constant.parameter
        if constant.kind == HAD and effect == name:
            values[parameter] = constant.of(float(fitted.u[number]))
            if parameter in strengths:
                without[number] = constant.strain(0.0)

    added = fitted.predicted - stack.predict(without, fitted.acting)
    return _Acting(make(name, values), _finite(added))


def _forms_of(
    stack: Stack, noise: Noise, fitted: Fitted, acting: Sequence[_Acting], own: Index
) -> tuple[RandomEffect, ...]:
    """Other forms of effects. own: which of the fit's unknowns are their parameters."""
    if not acting:
        return ()
    functions, places = shares(stack, np.ones(stack.size, bool)), along_place(stack)
    named = np.column_stack((fitted.raw[:, own], stack.named))
    made: list[RandomEffect] = []
    for one in (one for one in acting if np.any(one.added)):
        kinds: Iterator[tuple[Kind, Array, Sizes, int]] = chain(
            (("profile", *profile, 0) for profile in _profiles(stack, noise, one)),
            (("place", *varied, 0) for varied in _varied(one, places)),
            (("law", *_other_laws(stack, noise, fitted, one, functions)),),
        )
        for kind, columns, sizes, least in kinds:
            free = _beside(noise, columns, named)
            made.append(random_effect(one.effect.name, free, noise, sizes, least, kind))
    return tuple(made)


def _profiles(stack: Stack, noise: Noise, one: _Acting) -> Iterator[tuple[Array, Sizes]]:
    """Of one effect, how it may go along what no law tells of: columns (N, m) with their sizes."""
    sizes = even(TUNING.fit.profile_sizes)
    for zeros in _free_zeros(stack, noise, one.effect, one.added):
        yield zeros, sizes
    for harmonics in _harmonics(stack, one.effect):
        yield _share(one.added, harmonics), sizes


def _varied(one: _Acting, places: Array) -> Iterator[tuple[Array, Sizes]]:
    """Of one effect, how it may vary along the bed: columns (N, m) with their sizes. places (N, p):
    functions of the place.
    """
    if _placed(type(one.effect)) and places.shape[1]:
        yield _share(one.added, places), _place_sizes()


def _other_laws(
    stack: Stack, noise: Noise, fitted: Fitted, one: _Acting, functions: Array
) -> tuple[Array, Sizes, int]:
    """Of one effect, how else published forms of it differ: columns (N, m) with their sizes, and
    the smallest of these that counts for the uncertainty of the constants.

    functions (N, f): of the conditions.
    """
    effect, added = one.effect, one.added
    columns = _share(added, np.column_stack((functions, _by_channel(stack, added), np.sign(added))))
    if effect.stage in OF_SOIL:
        columns = np.column_stack((columns, _following(stack, added)))
    if effect.stage == OF_SHEAR:
        displaced = _displaced(stack, noise, fitted, added)
        columns = np.column_stack((columns, _share(displaced, functions)))
    return columns, form_error_sizes(), 0 if effect.stage in EXACT else 1


def _share(added: Array, functions: Array) -> Array:
    """Columns (N, m) of an effect that adds so much (N,), times functions (N, m), together of
    size 1.
    """
    return np.asarray(added[:, None] * functions / np.sqrt(functions.shape[1]))


def _placed(effect: type[Effect]) -> bool:
    """Whether what an effect does may vary with the place on the bed: neither a drive, nor what
    reads its current, knows of that, and zeros vary as they like.
    """
    of_current = effect.stage == "sensor" and effect.fingerprint.channel == "torque"
    return effect.stage != "drivetrain" and not of_current and not effect.free_along


def varied_along_place(stack: Stack, effect: type[Effect], made: Signature) -> list[Array]:
    """Each strength of a signature as it may vary along the bed (N, m), by the largest share."""
    places = along_place(stack)
    if not _placed(effect) or not places.shape[1]:
        return []
    share = TUNING.fit.place_sizes[-1] / np.sqrt(places.shape[1])
    return [share * column[:, None] * places for column in made.columns.T]


def _place_sizes() -> Sizes:
    return Sizes(TUNING.fit.place_sizes, TUNING.fit.place_prior)


def added_by(stack: Stack, fitted: Fitted, number: int) -> Array:
    """Prediction with an effect less that without it (N,); 0 where the others alone run away."""
    acting = build(fitted.effects, fitted.free, fitted.x)
    others = tuple(e for i, e in enumerate(acting) if i != number)
    return _finite(fitted.predicted - stack.predict(fitted.u, others))


def _finite(added: Array) -> Array:
    return added if np.isfinite(added).all() else np.zeros_like(added)


def _following(stack: Stack, added: Array) -> Array:
    """What is still wanting of an effect (N, m) that follows slip and load over an arc of rolling,
    and of one that begins where each run begins.
    """
    group = np.asarray(stack.run * len(stack.rig.channels) + stack.channel, dtype=float)
    begins = run_begins(group, stack.size)
    angle = stack.covariate("wheel_angle")
    turned = np.where(begins, 0.0, np.abs(np.diff(angle, prepend=angle[0])))
    if not turned.any():  # steady states: nothing builds up
        return np.zeros((stack.size, 0))
    rolled = np.cumsum(turned)
    rolled -= rolled[begins][np.cumsum(begins) - 1]

    columns = []
    for arc in TUNING.fit.following_arcs:
        share = -np.expm1(-turned / arc)
        columns += [followed(added, share, group) - added, -added * np.exp(-rolled / arc)]
    return np.column_stack(columns)


def _displaced(stack: Stack, noise: Noise, fitted: Fitted, added: Array) -> Array:
    """What slip does to all channels (N,), as large as an effect that adds so much (N,): another
    law of shear does as much at another shear displacement.
    """
    names = [constant.name for constant in stack.rig.constants]
    if stack.rig.slipping not in names:
        return np.zeros_like(added)
    number = names.index(stack.rig.slipping)

    size = np.linalg.norm(whiten(noise, added[:, None]))
    return np.asarray(
        fitted.raw[:, number] * size / max(np.linalg.norm(fitted.own[:, number]), SQUARE)
    )


def _free_zeros(stack: Stack, noise: Noise, effect: Effect, added: Array) -> Iterator[Array]:
    """What a zero that adds so much (N,) may be instead: columns (N, m) over each covariate along
    which no law says how it goes, in the channel where it stands out most. It is off by as much
    whatever is measured.
    """
    if not effect.free_along:
        return

    own = _where_most(stack, noise, added)
    acting = own != 0.0
    size = np.sqrt(np.mean(own**2, where=acting)) if acting.any() else 0.0

    for covariate in effect.free_along:
        columns = along(stack, covariate)
        if columns.shape[1]:
            yield size * acting[:, None] * columns / np.sqrt(columns.shape[1])


def _where_most(stack: Stack, noise: Noise, added: Array) -> Array:
    """What an effect adds (N,) to the channel in which it stands out most; else 0."""
    whitened = whiten(noise, added[:, None])[:, 0]
    shown = {c: float(np.sum(whitened[stack.of(c)] ** 2)) for c in stack.rig.channels}
    return np.where(stack.of(max(shown, key=lambda c: shown[c])), added, 0.0)


def _beside(noise: Noise, columns: Array, named: Array) -> Array:
    """Columns (N, m) without what has a name (N, n): parameters of the fit's effects and others."""
    share = np.linalg.lstsq(whiten(noise, named), whiten(noise, columns), rcond=DEPENDENT)[0]
    return np.asarray(columns - named @ share)


def _by_channel(stack: Stack, added: Array) -> Array:
    """Marks (N, m) of the channels in which an effect acts, rounding apart; (N, 0) where it is but
    one.
    """
    least = SLIGHT * np.abs(stack.measured)
    marks = [
        own for own in map(stack.of, stack.rig.channels) if np.any(np.abs(added) > least, where=own)
    ]
    if len(marks) < 2:
        return np.zeros((stack.size, 0))
    return np.column_stack(marks).astype(float)


def _harmonics(stack: Stack, effect: Effect) -> Iterator[Array]:
    """The first harmonics of a ripple's order (N, m): times it they give another profile."""
    if effect.fingerprint.covariate != "wheel_angle":
        return
    name = order_of(type(effect))
    phase = stack.covariate("wheel_angle") * (getattr(effect, name) if name else 1.0)
    orders = range(1, TUNING.fit.harmonics + 1)
    waves = [np.sqrt(2.0) * wave(k * phase) for k in orders for wave in (np.cos, np.sin)]
    yield np.column_stack(waves)
