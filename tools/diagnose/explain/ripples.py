"""Ripples and vibrations that the recordings show at their own rate, and those left without a
name.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from gritd.estimator.effects.base import Effect
from gritd.tools.cli.wording import shown, spaced, spelled
from gritd.tools.diagnose.explain.result import Ripple
from gritd.tools.diagnose.orders.lines import SpectralLine
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict.resemblance import ripples_a_turn

ALONG = {"angle": "1/turn", "time": "Hz"}


def ripples_of(rig: Rig) -> tuple[Ripple, ...]:
    """All lines of the new campaign, the likeliest first."""
    return tuple(
        Ripple(
            line.channel,
            line.at,
            line.sigma,
            ALONG[line.axis],
            line.size,
            line.size_sigma,
            rig.units[line.channel],
            line.p,
            line.frequency,
            line.harmonic or None,
            rig.lines.shared(line),
        )
        for line in sorted(rig.lines.new, key=lambda x: x.p)
    )


def left_over(rig: Rig, accepted: Sequence[Effect], places: Collection[str] = ()) -> Iterator[str]:
    """Sentences for new ripples that no accepted effect has, for vibrations, and where ripples
    aligned the runs. told: channels that are said to oscillate in time already.
    """
    if rig.lines.aligned:
        yield (
            "The wheel's encoder begins at other angles from run to run: a ripple of"
            f" {rig.lines.aligned:.2f} a turn aligned the runs."
        )

    named = [order for effect in accepted if (order := ripples_a_turn(effect)) is not None]
    fresh = rig.lines.fresh("angle")
    ripples = [x for x in fresh if not any(abs(x.at - order) < x.cell for order in named)]
    if ripples:
        yield f"The wheel ripples, and no accepted effect does: {_listed(rig, ripples)}."
    if vibrations := [x for x in rig.lines.fresh("time") if x.channel not in places]:
        yield f"The recordings vibrate, whatever the speed: {_listed(rig, vibrations)}."


def _listed(rig: Rig, lines: Sequence[SpectralLine]) -> str:
    """The likeliest places with their channels, in words."""
    groups = _grouped(sorted(lines, key=lambda x: x.p))
    places = [_place(rig, group) for group in groups[: TUNING.explain.shown]]
    more = len(groups) - len(places)
    return "; ".join(places) + (f"; and {more} more" if more else "")


def _place(rig: Rig, group: Sequence[SpectralLine]) -> str:
    first = group[0]
    each = ((x, *shown(rig.units[x.channel])) for x in group)
    sizes = ", ".join(f"{spelled(x.channel)} ± {spaced(x.size * f, u, 2)}" for x, u, f in each)
    low, high = first.frequency

    if first.axis == "time":
        return f"{first.at:.2f} Hz ({sizes})"
    hertz = " to ".join(dict.fromkeys((f"{low:.1f}", f"{high:.1f}")))
    return f"{first.at:.2f} times a turn, {hertz} Hz ({sizes})"


def _grouped(lines: Sequence[SpectralLine]) -> list[list[SpectralLine]]:
    """Lines of several channels at one place together."""
    groups: list[list[SpectralLine]] = []
    for line in lines:
        for group in groups:
            if abs(line.at - group[0].at) < line.cell:
                if line.channel not in [x.channel for x in group]:
                    group.append(line)
                break
        else:
            groups.append([line])
    return groups
