"""The words of a diagnosis: a misfit and its place as a testbed engineer reads them, with numbers
in the units of the report.

The residuals are those that the report draws: recorded less predicted with the value's own run held
out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.wording import (
    covariate_shown,
    fixed,
    listed,
    number,
    percent,
    shown,
    spaced,
    spelled,
)
from gritd.tools.diagnose.explain import changes
from gritd.tools.diagnose.fit.shape import Candidate, Shape
from gritd.tools.diagnose.noise import lines
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING

AT = {  # a value of a covariate, in words
    "slip": "{} slip",
    "speed": "{} speed",
    "velocity": "{}",
    "load": "{} load",
    "sinkage": "{} sinkage",
    "position": "{} along the bed",
    "time": "{} from the start",
    "heat": "∫I² dt of {}",
    "acceleration": "{}",
}
PLACES = {"time": "over time", "position": "along the bed"}
WINDOW = 2  # change points between which something is another
TIMES = {1: "once", 2: "twice"}


def label(candidate: Candidate) -> str:
    """An effect's name; of a misfit without a name, its channel and what it lives along."""
    if isinstance(candidate, str):
        return candidate
    if candidate.kind == "strain":
        return f"{candidate.channel} beyond what is known of it"
    along = f"{candidate.channel}~{'·'.join(candidate.along)}"
    return along if candidate.kind == "smooth" else f"{along} {candidate.kind}"


def described(shape: Shape) -> str:
    """A misfit without a name in words: `a step in drawbar pull along the bed`."""
    where = " and ".join(PLACES.get(name, f"with {spelled(name)}") for name in shape.along)
    kind = "smooth change" if shape.kind == "smooth" else shape.kind
    return f"a {kind} in {spelled(shape.channel)} {where}"


def sentence(
    stack: Stack, residual: Array, shape: Shape, places: Sequence[float], share: float
) -> str:
    """What a channel (residual (N,) of the stack) does along a smooth shape; places: its change
    points.
    """
    channel, (covariate, *others) = shape.channel, shape.along
    own = stack.of(channel) & (stack.covariate("speed") > 0.0)
    own = own if own.any() else stack.of(channel)
    say = _sizes(stack, channel)

    if covariate == "run":
        words = _runs(stack, residual, own, places, say)
    elif covariate == "constant":
        words = _everywhere(residual, own, stack.of(channel) & ~own, say)
    elif covariate == "wheel_angle":
        words = _turn(stack, residual, own, channel)
    elif covariate == "direction":
        words = _directions(stack, residual, own, say)
    elif places:
        words = _between(stack, residual, own, covariate, places, say)
    elif others:
        words = _corner(stack, residual, own, shape.along, say)
    else:
        words = _along(stack, residual, own, covariate, say)
    return _started(f"{spelled(channel)}, {words}; {percent(share)} of its misfit")


def ripple(stack: Stack, channel: str, order: float, amplitude: float, share: float) -> str:
    """A ripple of so many times a turn and its amplitude in the channel's unit."""
    size = _amplitude(stack, channel, amplitude)
    words = f"ripples {_times(order)} a turn, {size}"
    return _started(f"{spelled(channel)}, {words}; {percent(share)} of its misfit")


def wave(stack: Stack, residual: Array, shape: Shape, share: float) -> str:
    """A wave of a residual (N,) in time or along the bed, its amplitude the root of the mean square
    over the stretches.
    """
    channel, (axis,), frequency = shape.channel, shape.along, shape.at
    assert frequency is not None

    x, squares, count = stack.covariate(axis), 0.0, 0
    for index in lines.stretches(stack, channel):
        pair = lines.waves(x[index], np.array([frequency]))[:, 0]
        columns = np.column_stack((pair, np.ones(index.size)))
        fitted = np.linalg.lstsq(columns, residual[index], rcond=None)[0]
        squares += index.size * float(fitted[0] ** 2 + fitted[1] ** 2)
        count += index.size

    size = _amplitude(stack, channel, float(np.sqrt(squares / max(count, 1))))
    length = _wavelength(stack, axis, 1.0 / frequency)
    period, waves = f"oscillates with a period of {length}", f"waves of {length} along the bed"
    words = period if axis == "time" else waves
    return _started(f"{spelled(channel)}, {words}, {size}; {percent(share)} of its misfit")


def term(stack: Stack, shape: Shape, size: float) -> str:
    """A wave or a step as a term of a law; size in the channel's unit."""
    (axis,), at = shape.along, shape.at
    assert at is not None
    if shape.kind == "wave":
        amplitude = _amplitude(stack, shape.channel, abs(size))
        return f"{amplitude} every {_wavelength(stack, axis, 1.0 / at)}"
    step = signed(size, stack.rig.units[shape.channel])
    return f"{step} beyond {value_of(stack, axis, at)}"


def _wavelength(stack: Stack, axis: str, length: float) -> str:
    unit, factor = shown(stack.rig.units[axis])
    return spaced(length * factor, unit, 3)


def strain(channel: str, what: str, value: float, unit: str, sigmas: float) -> str:
    """A calibration constant that the fit pulls off what is known of it."""
    size = f"{fixed(100.0 * value, 2)} %" if what == "scale" else signed(value, unit)
    moved = f"the fit moves its {what} by {size}, {number(abs(sigmas), 2)} σ of its calibration"
    return _started(f"{spelled(channel)}, {moved}")


def _started(words: str) -> str:
    return words[:1].upper() + words[1:]


# ---- pieces ------------------------------------------------------------------------------------

Say = Callable[[float], str]


def _sizes(stack: Stack, channel: str) -> Say:
    """A mean residual, as more or less than the model."""
    unit, factor = shown(stack.rig.units[channel])
    return lambda mean: (
        f"{spaced(abs(mean) * factor, unit, 2)} {'more' if mean >= 0.0 else 'less'} than the model"
    )


def _everywhere(residual: Array, own: Bools, rest: Bools, say: Say) -> str:
    """Friction acts while the wheel turns, an offset at rest too."""
    mean = float(residual[own].mean())

    if not rest.any():
        return f"everywhere {say(mean)}"
    still = float(residual[rest].mean())
    if abs(still - mean) < TUNING.explain.means_alike * abs(mean):
        return f"at rest as while the wheel turns {say(mean)}"

    known = (
        "as the model"
        if abs(still) < TUNING.explain.means_alike * abs(mean)
        else _brief(say(still))
    )
    return f"while the wheel turns {say(mean)}, at rest {known}"


def _brief(words: str) -> str:
    return words.replace(" than the model", "")


def signed(value: float, unit: str) -> str:
    """A value in the unit that is shown, with its sign."""
    seen, factor = shown(unit)
    return ("+" if value >= 0.0 else "") + spaced(value * factor, seen, 2)


def value_of(stack: Stack, covariate: str, value: float) -> str:
    """A value of a covariate in words, such as `30 % slip`."""
    return AT.get(covariate, "{}").format(_value(stack, covariate, value))


def _value(stack: Stack, covariate: str, value: float) -> str:
    unit, factor = covariate_shown(covariate, stack.rig.units.get(covariate, ""))
    return spaced(value * factor, unit, _digits(covariate, value * factor))


def _apart(stack: Stack, covariate: str, values: Sequence[float]) -> list[str]:
    """Values of a covariate, each in as many digits as tell it from the others; 0 for one that is
    nothing beside them.
    """
    unit, factor = covariate_shown(covariate, stack.rig.units.get(covariate, ""))
    least = TUNING.explain.reads_nothing * max(abs(v) for v in values)
    known = [v * factor if abs(v) > least else 0.0 for v in values]

    texts: list[str] = []
    for more in range(TUNING.explain.more_digits + 1):
        texts = [spaced(v, unit, _digits(covariate, v) + more) for v in known]
        if len(set(texts)) == len(texts):
            break
    return texts


def _digits(covariate: str, value: float) -> int:
    return 3 if covariate in ("position", "time") and abs(value) >= TUNING.explain.long_place else 2


def _along(stack: Stack, residual: Array, own: Bools, covariate: str, say: Say) -> str:
    """Means at the low and the high end, and in the middle where that stands out."""
    x = stack.covariate(covariate)
    ends = [
        _quantiles(x, residual, own, part)
        for part in (TUNING.explain.low_end, TUNING.explain.middle, TUNING.explain.high_end)
    ]
    (_, low), (_, middle), (_, high) = ends

    outside = max(middle - max(low, high), min(low, high) - middle)
    if outside <= TUNING.explain.middle_stands_out * abs(high - low):
        ends = [ends[0], ends[2]]

    (first, mean), *rest = ends
    at, *beyond = _apart(stack, covariate, [first, *(v for v, _ in rest)])
    others = [f"{_brief(say(m))} at {v}" for (_, m), v in zip(rest, beyond, strict=True)]
    return ", ".join([f"{say(mean)} at {AT.get(covariate, '{}').format(at)}", *others])


def _quantiles(
    x: Array, residual: Array, own: Bools, part: tuple[float, float]
) -> tuple[float, float]:
    """Mean covariate and mean residual between two quantiles of the covariate."""
    low, high = np.quantile(x[own], part)
    inside = own & (x >= low) & (x <= high)
    return float(x[inside].mean()), float(residual[inside].mean())


def _between(
    stack: Stack, residual: Array, own: Bools, covariate: str, places: Sequence[float], say: Say
) -> str:
    """The stretch between change points that is farthest from the rest."""
    x = changes.values(stack, covariate)
    assert x is not None
    low, high, inside = _stretch(x, residual, own, places)

    if len(places) == WINDOW:
        low, high = sorted(places)
        inside = own & (x > low) & (x <= high)

    rest = own & ~inside
    here, elsewhere = float(residual[inside].mean()), float(residual[rest].mean())
    return f"{_span(stack, covariate, low, high)} {say(here)}, elsewhere {_brief(say(elsewhere))}"


def _stretch(
    x: Array, residual: Array, own: Bools, places: Sequence[float]
) -> tuple[float, float, Bools]:
    """Ends (infinite where open) and values of the stretch that differs most from the rest."""
    edges = [-np.inf, *sorted(places), np.inf]
    stretches = [
        (a, b, own & (x > a) & (x <= b)) for i, a in enumerate(edges) for b in edges[i + 1 :]
    ]
    stretches = [s for s in stretches if s[2].any() and (own & ~s[2]).any()]
    return max(stretches, key=lambda s: _contrast(residual[s[2]], residual[own & ~s[2]]))


def shows(stack: Stack, residual: Array, channel: str, places: Sequence[float]) -> bool:
    """Whether changes between runs take most of what the means of a residual (N,) differ by."""
    number_of, own = (
        changes.values(stack, "run"),
        stack.of(channel) & (stack.covariate("speed") > 0.0),
    )
    assert number_of is not None

    numbers = np.unique(number_of[own])
    means = np.array([residual[own & (number_of == n)].mean() for n in numbers])

    side = np.searchsorted(sorted(places), numbers)
    level = np.array([means[side == k].mean() for k in side])
    return bool(
        np.sum((level - means.mean()) ** 2)
        >= TUNING.explain.runs_show * np.sum((means - means.mean()) ** 2)
    )


def _contrast(inside: Array, rest: Array) -> tuple[float, float]:
    """Squares that two means instead of one take up; then which side is farther off nought."""
    between = (
        (inside.mean() - rest.mean()) ** 2 * inside.size * rest.size / (inside.size + rest.size)
    )
    return round(float(between), TUNING.explain.equal_places), abs(float(inside.mean())) - abs(
        float(rest.mean())
    )


def _span(stack: Stack, covariate: str, low: float, high: float) -> str:
    """A stretch in words; infinite ends are open."""
    if np.isfinite(low) and np.isfinite(high):
        _, factor = covariate_shown(covariate, stack.rig.units.get(covariate, ""))
        first = number(low * factor, _digits(covariate, low * factor))
        return f"from {first} to {value_of(stack, covariate, high)}"
    edge = value_of(stack, covariate, low if np.isfinite(low) else high)
    return f"{'beyond' if np.isfinite(low) else 'up to'} {edge}"


def _runs(stack: Stack, residual: Array, own: Bools, places: Sequence[float], say: Say) -> str:
    number_of = changes.values(stack, "run")
    assert number_of is not None
    numbers = np.unique(number_of[own])
    names = {float(n): stack.rig.runs[int(stack.run[number_of == n][0])].name for n in numbers}
    means = {float(n): float(residual[own & (number_of == n)].mean()) for n in numbers}

    if places:
        low, high, inside = _stretch(number_of, residual, own, places)
        within = [names[n] for n in names if low < n <= high]
        span = f"in {within[0]}" if len(within) == 1 else f"from {within[0]} to {within[-1]}"
        rest = float(residual[own & ~inside].mean())
        return (
            f"{span} {say(float(residual[inside].mean()))}, in the other runs {_brief(say(rest))}"
        )

    levels = np.array(list(means.values()))
    if levels.size > 1 and np.ptp(levels) < TUNING.explain.means_alike * np.abs(levels).min():
        return f"in all runs {say(float(levels.mean()))}"

    told = list(names)
    if len(told) > TUNING.explain.runs_named:
        told = sorted(sorted(told, key=lambda n: -abs(means[n]))[: TUNING.explain.runs_far_named])
    each = [f"{_brief(say(means[n]))} in {names[n]}" for n in told]
    return (
        f"{'from run to run' if len(told) == len(names) else 'most'}: {listed(each)} than the model"
    )


def _turn(stack: Stack, residual: Array, own: Bools, channel: str) -> str:
    """Once or twice a turn, whichever is larger."""
    angle = stack.covariate("wheel_angle")[own]
    columns = np.column_stack(
        [np.ones(angle.size), *(f(o * angle) for o in TIMES for f in (np.cos, np.sin))]
    )
    fitted = np.linalg.lstsq(columns, residual[own], rcond=None)[0]
    sizes = {order: float(np.hypot(*fitted[2 * order - 1 : 2 * order + 1])) for order in TIMES}
    order = max(sizes, key=lambda o: sizes[o])
    return f"varies {TIMES[order]} a turn, {_amplitude(stack, channel, sizes[order])}"


def _amplitude(stack: Stack, channel: str, amplitude: float) -> str:
    unit, factor = shown(stack.rig.units[channel])
    return f"± {spaced(amplitude * factor, unit, 2)}"


def _times(order: float) -> str:
    return TIMES.get(int(order), f"{order:.0f} times")


def _directions(stack: Stack, residual: Array, own: Bools, say: Say) -> str:
    forward = stack.covariate("direction") > 0.0
    means = [float(residual[side].mean()) for side in (own & forward, own & ~forward) if side.any()]
    if len(means) < 2:
        return say(means[0])
    return f"{say(means[0])} forward, {_brief(say(means[1]))} backward"


def _corner(stack: Stack, residual: Array, own: Bools, names: Sequence[str], say: Say) -> str:
    """Of the four corners of two covariates the one that is farthest off."""
    x, y = (stack.covariate(name) for name in names)
    corners = []
    for first in (TUNING.explain.low_end, TUNING.explain.high_end):
        for second in (TUNING.explain.low_end, TUNING.explain.high_end):
            inside = own & _within(x, own, first) & _within(y, own, second)
            if inside.any():
                corners.append((float(residual[inside].mean()), inside))

    if not corners:
        return _along(stack, residual, own, names[0], say)
    mean, inside = max(corners, key=lambda c: abs(c[0]))

    place = " and ".join(
        value_of(stack, n, float(v[inside].mean())) for n, v in zip(names, (x, y), strict=True)
    )
    return f"at {place} {say(mean)}, elsewhere {_brief(say(float(residual[own & ~inside].mean())))}"


def _within(x: Array, own: Bools, part: tuple[float, float]) -> Bools:
    """The lower or the upper third of a covariate: the outer ends of two may never meet."""
    low, high = np.quantile(
        x[own], (0.0, 1.0 / 3.0) if part == TUNING.explain.low_end else (2.0 / 3.0, 1.0)
    )
    inside: Bools = (x >= low) & (x <= high)
    return inside
