"""The words of a diagnosis: a misfit and its place as a testbed engineer reads them, with numbers
in the units of the report.

The residuals are those that the report draws: recorded less predicted with the value's own run held
out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.wording import (
    covariate_shown,
    fixed,
    listed,
    magnitude,
    number,
    percent,
    shown,
    spaced,
    spelled,
)
from gritd.tools.diagnose.fit.shape import Candidate, Shape
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN

AT = {  # a value of a covariate, in words
    "slip": "{} slip",
    "speed": "{} speed",
    "velocity": "{}",
    "load": "{} load",
    "sinkage": "{} sinkage",
    "time": "{} from the start",
    "heat": "∫I² dt of {}",
    "acceleration": "{}",
}
PLACES = ("time", "position")
TIMES = {1: "once", 2: "twice"}
SLIDING = "of sliding over the soil"
OSCILLATES = "oscillates with a period of"


def label(candidate: Candidate) -> str:
    """An effect's name; of a misfit without a name, its channel and what it lives along."""
    if isinstance(candidate, str):
        return candidate
    if candidate.kind == "strain":
        return f"{candidate.channel} beyond what is known of it"
    along = f"{candidate.channel}~{'·'.join(candidate.along)}"
    return along if candidate.kind == "smooth" else f"{along} {candidate.kind}"


def described(shape: Shape, units: Mapping[str, str]) -> str:
    """A misfit without a name in words: `a step in drawbar pull along the bed`; units: of the
    rig's covariates.
    """
    if shape.along == ("constant",):
        return f"an offset of {spelled(shape.channel)}"
    if shape.along == ("run",):
        return f"a change in {spelled(shape.channel)} from run to run"
    ways = {"time": "over time", "position": _along(units), "sliding": SLIDING}
    where = " and ".join(ways.get(name, f"with {spelled(name)}") for name in shape.along)
    kind = "smooth change" if shape.kind == "smooth" else shape.kind
    return f"a {kind} in {spelled(shape.channel)} {where}"


def sentence(
    stack: Stack, residual: Array, shape: Shape, covariate: str, share: float, size: float = 0.0
) -> str:
    """What a channel (residual (N,) of the stack) does along a covariate, in such a shape; size: of
    a wave, its amplitude in the channel's unit.
    """
    here = _Where(stack, residual, shape.channel)
    if shape.kind == "wave":
        words = _oscillates(stack, shape, size)
    elif shape.kind != "smooth":
        words = here.between(shape)
    else:
        ways = {"run": here.runs, "constant": here.everywhere, "direction": here.directions}
        words = ways[covariate]() if covariate in ways else here.along(covariate)
    return _started(f"{spelled(shape.channel)}, {words}; {percent(share)} of its misfit")


def along_covariate(stack: Stack, residual: Array, channel: str, covariate: str) -> str:
    """What a channel of a residual (N,) does along a covariate, without its name."""
    return _Where(stack, residual, channel).along(covariate)


def strain(channel: str, what: str, value: float, unit: str, sigmas: float) -> str:
    """A calibration constant that the fit pulls off what is known of it."""
    size = f"{fixed(100.0 * value, 2)} %" if what == "scale" else signed(value, unit)
    moved = f"the fit moves its {what} by {size}, {number(abs(sigmas), 2)} σ of its calibration"
    return _started(f"{spelled(channel)}, {moved}")


def signed(value: float, unit: str) -> str:
    """A value in the unit that is shown, with its sign."""
    seen, factor = shown(unit)
    return ("+" if value >= 0.0 else "") + spaced(value * factor, seen, 2)


def value_of(stack: Stack, covariate: str, value: float) -> str:
    """A value of a covariate in words, such as `30 % slip`."""
    unit, factor = covariate_shown(covariate, stack.rig.units.get(covariate, ""))
    digits = 3 if covariate in PLACES else 2
    return _at(stack, covariate).format(spaced(value * factor, unit, digits))


# ---- pieces ------------------------------------------------------------------------------------


def _along(units: Mapping[str, str]) -> str:
    """What a position lies along: the bed, or the turn of a drive without soil."""
    return "along the bed" if units["position"] == "m" else "along the turn"


def _at(stack: Stack, covariate: str) -> str:
    """How a value of a covariate is said, `{}` in its place."""
    if covariate == "position":
        return f"{{}} {_along(stack.rig.units)}"
    return AT.get(covariate, "{}")


def _started(words: str) -> str:
    return words[:1].upper() + words[1:]


def _brief(words: str) -> str:
    return words.replace(" than the model", "")


def _oscillates(stack: Stack, shape: Shape, size: float) -> str:
    (axis,), at = shape.along, shape.at
    assert at is not None
    unit, factor = shown(stack.rig.units[shape.channel])
    amplitude = f"± {spaced(abs(size) * factor, unit, 2)}"
    if axis == "wheel_angle":
        turns = round(2.0 * np.pi * at, 2)
        return f"ripples {TIMES.get(int(turns), f'{turns:.4g} times')} a turn, {amplitude}"
    unit, factor = shown(stack.rig.units[axis])
    length = spaced(factor / at, unit, 3)
    if axis == "time":
        return f"{OSCILLATES} {length}, {amplitude}"
    along = SLIDING if axis == "sliding" else _along(stack.rig.units)
    return f"waves of {length} {along}, {amplitude}"


class _Where:
    """What a channel's residual is, as more or less than the model: in the new campaign, where a
    reference comes first.
    """

    def __init__(self, stack: Stack, residual: Array, channel: str) -> None:
        own = stack.of(channel)
        own = own & stack.new if (own & stack.new).any() else own
        driving = own & (stack.covariate("speed") > 0.0)
        self._stack, self._residual = stack, residual
        self._own = driving if driving.any() else own
        self._rest: Bools = own & ~self._own
        self._unit, self._factor = shown(stack.rig.units[channel])

    def _mean(self, part: Bools) -> float:
        return float(self._residual[part].mean())

    def _say(self, mean: float) -> str:
        size = spaced(abs(mean) * self._factor, self._unit, 2)
        return f"{size} {'more' if mean >= 0.0 else 'less'} than the model"

    def everywhere(self) -> str:
        """Friction acts while the wheel turns, an offset at rest too."""
        mean = self._mean(self._own)
        if not self._rest.any():
            return f"everywhere {self._say(mean)}"
        still = self._mean(self._rest)
        tenths = round(10.0 * still / mean) if mean else 0
        if tenths == 10:
            return f"at rest as while the wheel turns {self._say(mean)}"
        known = _brief(self._say(still)) if tenths else "as the model"
        return f"while the wheel turns {self._say(mean)}, at rest {known}"

    def along(self, covariate: str) -> str:
        """Means of the lower and the upper third, and of the middle one where that is not between
        them.
        """
        x, index = self._stack.covariate(covariate), np.flatnonzero(self._own)
        parts = np.array_split(index[np.argsort(x[index], kind="stable")], 3)
        (low, middle, high) = (float(self._residual[part].mean()) for part in parts)
        shown = [0, 2] if min(low, high) <= middle <= max(low, high) else [0, 1, 2]

        at = self._apart(covariate, [float(x[parts[k]].mean()) for k in shown])
        first, *rest = (self._say((low, middle, high)[k]) for k in shown)
        others = (f"{_brief(say)} at {v}" for say, v in zip(rest, at[1:], strict=True))
        return ", ".join([f"{first} at {_at(self._stack, covariate).format(at[0])}", *others])

    def _apart(self, covariate: str, values: Sequence[float]) -> list[str]:
        """Values of a covariate, to a hundredth of what they differ by, or as whole numbers."""
        unit, factor = covariate_shown(covariate, self._stack.rig.units.get(covariate, ""))
        places = max(1 - magnitude(max(float(np.ptp(values)) * factor, SPAN)), 0)
        return [f"{fixed(v * factor, places)} {unit}".rstrip() for v in values]

    def between(self, shape: Shape) -> str:
        """The stretch of a window, or that side of a step which is farther off."""
        (covariate,), places = shape.along, shape.places
        x = self._stack.covariate(covariate)
        low, high = (*places, np.inf)[:2]
        inside = self._own & (x > low) & (x <= high)
        outside = self._own & ~inside
        if not inside.any() or not outside.any():
            return self.everywhere()
        if len(places) == 1 and abs(self._mean(inside)) < abs(self._mean(outside)):
            low, high, inside, outside = -np.inf, low, outside, inside

        here, elsewhere = self._mean(inside), _brief(self._say(self._mean(outside)))
        if covariate != "run":
            return f"{self._span(covariate, low, high)} {self._say(here)}, elsewhere {elsewhere}"
        names = [name for number, name in self._names().items() if low < number <= high]
        span = f"in {names[0]}" if len(names) == 1 else f"from {names[0]} to {names[-1]}"
        return f"{span} {self._say(here)}, in the other runs {elsewhere}"

    def _span(self, covariate: str, low: float, high: float) -> str:
        """A stretch in words; infinite ends are open."""
        if np.isinf(high):
            return f"beyond {value_of(self._stack, covariate, low)}"
        end = value_of(self._stack, covariate, high)
        if np.isinf(low):
            return f"up to {end}"
        _, factor = covariate_shown(covariate, self._stack.rig.units.get(covariate, ""))
        return f"from {number(low * factor, 3 if covariate in PLACES else 2)} to {end}"

    def _names(self) -> dict[float, str]:
        """Of the channel's runs, by their number in order of time."""
        number_of, runs = self._stack.covariate("run"), self._stack.rig.runs
        return {
            float(n): runs[int(self._stack.run[number_of == n][0])].name
            for n in np.unique(number_of[self._own])
        }

    def runs(self) -> str:
        number_of = self._stack.covariate("run")
        means = {
            name: self._mean(self._own & (number_of == n)) for n, name in self._names().items()
        }
        levels = np.array(list(means.values()))
        if levels.size > 1 and round(10.0 * np.ptp(levels) / np.abs(levels).max()) == 0:
            return f"in all runs {self._say(float(levels.mean()))}"

        far = sorted(means, key=lambda name: -abs(means[name]))[: TUNING.explain.shown]
        each = [f"{_brief(self._say(means[name]))} in {name}" for name in means if name in far]
        most = "from run to run" if len(far) == len(means) else "above all"
        return f"{most}: {listed(each)} than the model"

    def directions(self) -> str:
        forward = self._stack.covariate("direction") > 0.0
        sides = {"forward": self._own & forward, "backward": self._own & ~forward}
        means = {word: self._mean(side) for word, side in sides.items() if side.any()}
        if len(means) < 2:
            return self._say(*means.values())
        ahead, back = means.values()
        return f"{self._say(ahead)} forward, {_brief(self._say(back))} backward"
