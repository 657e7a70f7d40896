"""`python -m gritd.tools.dev.effect_figures`: docs/effects.md and a picture of every effect, before
and after.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import EXPERIMENTS, STAGES, Effect
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.history import rate_of
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics import linear
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import Parser
from gritd.tools.cli.drawing import (
    AFTER,
    BEFORE,
    COLUMN,
    LINE,
    MEASURED,
    WIDE,
    Name,
    look,
    named,
    save,
)
from gritd.tools.testbed.fingerprints import SOIL, TORQUE_CONSTANT, WHEEL, channels, typical_value

DOCS = Path(__file__).resolve().parents[2] / "docs"
N = 800
TEETH = 4.0  # cycles shown of what repeats with the wheel angle
LOAD, SLIP, SPEED = 65.0, 0.3, 0.25  # [N], [-], [rad/s] where nothing else is swept

LABELS = {
    "torque": ("motor torque", "N·m", 1.0),
    "drawbar_pull": ("drawbar pull", "N", 1.0),
    "sinkage": ("sinkage", "mm", 1e3),
    "load": ("load", "N", 1.0),
}
AXES = {
    "constant": "slip [%]",
    "slip": "slip [%]",
    "speed": "wheel speed [rad/s]",
    "load": "load [N]",
    "sinkage": "load [N], deeper to the right",
    "wheel_angle": "wheel angle [turns]",
    "position": "position on the bed [m]",
    "time": "time [s]",
    "heat": "time [s]",
    "acceleration": "time [s], speed stepping up and down",
    "rate": "time [s], load stepping up and down",
    "run": "pass",
    "reversal": "wheel angle since the drive turned round [rad]",
}
SHARES = (  # of the typical strength, its name, colour and width
    (0.0, "without", MEASURED, WIDE),
    (0.5, "half", BEFORE, LINE),
    (1.0, "typical", AFTER, LINE),
)
HEIGHT = 2.7  # [in]


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page and the pictures, of all effects or of those named."""
    parser = Parser(prog="python -m gritd.tools.dev.effect_figures", description=main.__doc__)
    parser.add_argument("effects", nargs="*", metavar="EFFECT")
    names = parser.parse_args(argv).effects or list(EFFECTS)
    if unknown := [name for name in names if name not in EFFECTS]:
        parser.error(f"found {unknown[0]!r}; expected one of {', '.join(EFFECTS)}")
    (DOCS / "effects").mkdir(parents=True, exist_ok=True)
    for name in names:
        draw(EFFECTS[name], DOCS / "effects" / f"{name}.png")
    (DOCS / "effects.md").write_text(page(), encoding="utf-8")
    return 0


# --- pictures ---


def draw(effect: type[Effect], path: Path) -> None:
    """The channel against the covariate where the effect shows most: off, half and typical
    strength.
    """
    channel, covariate, _ = effect.fingerprint
    label, unit, scale = LABELS[channel]
    motion, x = sweep(covariate, turns=TEETH / _order(effect))
    curves = [scale * _seen(effect, motion, share)[channel] for share, *_ in SHARES]

    with look():
        figure = Figure(figsize=(COLUMN, HEIGHT), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for curve, (_, _, colour, width) in zip(curves, SHARES, strict=True):
            above.plot(x, curve, color=colour, lw=width)
            below.plot(x, curve - curves[0], color=colour, lw=width)

        above.set_ylabel(f"{label} [{unit}]")
        below.set_ylabel(f"change [{unit}]")
        below.set_xlabel(AXES[covariate])
        for axes in (above, below):
            axes.margins(x=0.0)
        right = int(np.argmax(x))
        named(
            above,
            [
                Name(float(curve[right]), words, colour)
                for curve, (_, words, colour, _) in zip(curves, SHARES, strict=True)
            ],
        )
        figure.align_ylabels()
        save(figure, path)


def _seen(effect: type[Effect], motion: Motion, share: float) -> dict[str, Array]:
    """What the channels say with the effect at a share of its typical strength."""
    acting = partly(effect, share)
    if not effect.filter_only:
        return channels(
            simulate_arrays(WHEEL, SOIL, motion, (acting,), torque_constant=TORQUE_CONSTANT)
        )

    true = simulate_arrays(WHEEL, SOIL, motion)
    closed = linear.predict_batch(
        WHEEL, SOIL.cohesion, SOIL.tan_phi, SOIL.shear_modulus, true.theta_1, true.slip, true.load
    )
    return {"torque": closed.torque + share * (true.torque - closed.torque)}


def partly(effect: type[Effect], share: float) -> Effect:
    """The effect at a share of its typical strength."""
    return effect(
        **{
            p.name: p.off + share * (typical_value(p) - p.off) if p.role == "strength" else p.centre
            for p in effect.parameters()
        }
    )


def _order(effect: type[Effect]) -> float:
    """Cycles a turn of what repeats with the wheel angle."""
    return next((p.centre for p in effect.parameters() if p.name in ("count", "order")), 1.0)


def sweep(covariate: str, turns: float = 1.0) -> tuple[Motion, Array]:
    """A motion in which the covariate varies and as little else as possible, and the x axis (N,)
    that shows it.
    """
    time, ramp = np.linspace(0.0, 60.0, N), np.linspace(0.0, 1.0, N)
    load, slip, speed = np.full(N, LOAD), np.full(N, SLIP), np.full(N, SPEED)
    passes = np.ones(N)

    if covariate in ("slip", "constant"):
        slip = 0.02 + 0.78 * ramp
        x = 100.0 * slip
    elif covariate == "speed":
        speed = 0.02 + 0.6 * ramp
        x = speed
    elif covariate in ("load", "sinkage"):
        load = 20.0 + 90.0 * (1.0 - np.abs(2.0 * ramp - 1.0))
        x = load
    elif covariate == "run":
        passes = np.ceil(8.0 * np.maximum(ramp, 1e-9))
        x = passes
    elif covariate == "acceleration":
        speed = SPEED + 0.1 * np.tanh(8.0 * np.sin(0.3 * time))
        x = time
    elif covariate == "reversal":
        speed = np.where(ramp < 0.5, -SPEED, SPEED)
        time = 2.0 * ramp
        x = SPEED * (time - 1.0)
    elif covariate == "rate":
        load = LOAD + 20.0 * np.tanh(4.0 * np.sin(0.3 * time))
        x = time
    else:
        longest = {
            "time": 1200.0,
            "heat": 1200.0,
            "position": 80.0,
            "wheel_angle": turns * 2.0 * np.pi / SPEED,
        }
        time = longest[covariate] * ramp
        x = time

    motion = _driven(time, load, slip, speed, passes)
    if covariate == "wheel_angle":
        x = np.asarray(motion.wheel_angle) / (2.0 * np.pi)
    if covariate == "position":
        x = np.asarray(motion.carriage_position)

    return motion, x


def _driven(time: Array, load: Array, slip: Array, speed: Array, passes: Array) -> Motion:
    travel = WHEEL.radius * speed * (1.0 - slip)
    step = time[1] - time[0]

    return Motion(
        time=time,
        wheel_angle=np.cumsum(speed) * step,
        wheel_speed=speed,
        carriage_position=np.cumsum(travel) * step,
        carriage_speed=travel,
        load=load,
        pass_number=passes,
        wheel_acceleration=rate_of(time, speed),
    )


# --- the page ---


def page() -> str:
    """docs/effects.md, from what each effect's file says."""
    effects = sorted(EFFECTS.values(), key=lambda e: (STAGES.index(e.stage), e.name))
    parts = [INTRODUCTION, _index(effects), *(_section(effect) for effect in effects), _menu()]
    return "\n".join(part.rstrip() + "\n" for part in parts)


INTRODUCTION = """\
<!-- made by `python -m gritd.tools.dev.effect_figures`; edit the effects' files instead -->
# The effects

Physics that may be at work on a testbed and that Eqs. (1)-(10) leave out. Each is one file in
`estimator/effects/`, shared by simulator, diagnosis and on-line filter; [adding an
effect](adding-an-effect.md) shows how to write one.

Pictures show the channel where the effect shows most, over the covariate it follows: without it, at
half and at typical strength, below the change. Wheel r = 72 mm, b = 71 mm, dry
sand (c = 1 kPa, tan φ = 0.577, k = 25 mm, n = 1.1), 65 N, slip 30 % and 0.25 rad/s where they are
not swept; load is swept up and down again.

A parameter is a *strength*, which turns the effect off at the given value, or a *shape*. *Expected*
is the prior: the typical size of a strength, mean ± standard deviation of a shape.
"""


def _index(effects: Sequence[type[Effect]]) -> str:
    rows = [f"| [`{e.name}`](#{e.name}) | {e.stage} | {e.sentence()} |" for e in effects]
    return "\n".join(["| effect | acts on | what it is |", "|---|---|---|", *rows])


def _section(effect: type[Effect]) -> str:
    rivals = [f"`{name}` ({EXPERIMENTS[how]})" for name, how in effect.confusable_with.items()]
    where = f"{effect.fingerprint.channel} over {effect.fingerprint.covariate}".replace("_", " ")

    return "\n".join(
        [
            f"## {effect.name}\n",
            f"{effect.sentence()}\n",
            "```text",
            effect.formula(),
            "```\n",
            f"![{effect.name}](effects/{effect.name}.png)\n",
            f"**Shows** in {where}: {effect.fingerprint.sentence}.\n",
            f"**Looks like** {'; '.join(rivals)}.\n",
            "| parameter | what | unit | expected | bounds |",
            "|---|---|---|---|---|",
            *(_row(effect, p.name) for p in effect.parameters()),
        ]
    )


def _row(effect: type[Effect], name: str) -> str:
    p = next(p for p in effect.parameters() if p.name == name)
    expected = (
        f"{p.sigma:g}, off at {p.off:g}" if p.role == "strength" else f"{p.centre:g} ± {p.sigma:g}"
    )
    return f"| `{p.name}` | {p.meaning} | {p.unit or '-'} | {expected} | {p.low:g} … {p.high:g} |"


def _menu() -> str:
    return "\n".join([MENU, *(f"- `{k}`: {v}" for k, v in EXPERIMENTS.items())])


MENU = """## Experiments that distinguish effects

Simulated for every pair named above (`tests/estimator/effects/test_separation.py`): the soil within
its prior and the other effect are fitted to what the effect changes, on a campaign without the
experiment and on the same with it. With it, more than two standard deviations are left.
"""


if __name__ == "__main__":
    sys.exit(main())
