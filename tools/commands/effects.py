"""`gritd effects [NAME]`: the physics that gritd knows beyond the paper's equations."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from gritd.estimator.config.nearest import did_you_mean
from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import EXPERIMENTS, STAGES, Effect, Parameter
from gritd.tools.cli.command import DONE, USAGE, CommandError, Parser

WIDTH = 96


def main(argv: Sequence[str]) -> int:
    """Raises CommandError for a name that is no effect."""
    name = build_parser().parse_args(argv).name

    if name is not None and name not in EFFECTS:
        raise CommandError(
            f"effects: found no effect {name!r}{did_you_mean(name, EFFECTS)}; "
            "expected one that `gritd effects` lists",
            USAGE,
        )
    print("\n".join(listing() if name is None else page(EFFECTS[name])))
    return DONE


def listing() -> Iterator[str]:
    """All effects by where they act, a line each."""
    for stage in STAGES:
        yield f"{stage}:"
        for name, effect in EFFECTS.items():
            if effect.stage == stage:
                yield f"  {name:26}{_short(effect.sentence())}"
    yield ""
    yield "`gritd effects NAME` has formula, parameters, fingerprint and what looks alike."


def _short(sentence: str) -> str:
    return textwrap.shorten(sentence, WIDTH - 28, placeholder=" …")


def page(effect: type[Effect]) -> Iterator[str]:
    """One effect: what it is, its formula, its parameters, and what it is confused with."""
    yield f"{effect.name}: acts on the {effect.stage}"
    yield from _wrapped(effect.sentence())
    yield ""
    yield from (f"  {line}".rstrip() for line in effect.formula().splitlines())
    yield ""

    yield "parameters"
    yield from (_parameter(parameter) for parameter in effect.parameters())
    yield ""

    mark = effect.fingerprint
    yield f"fingerprint: {mark.channel.replace('_', ' ')} over {mark.covariate}"
    yield from _wrapped(mark.sentence)

    if alike := looks_like(effect.name):
        yield ""
        yield "looks like, and what distinguishes them"
        yield from (f"  {other:26}{EXPERIMENTS[key]}" for other, key in alike.items())


def looks_like(name: str) -> dict[str, str]:
    """Effects that look alike, each with the key of EXPERIMENTS; either may have named the
    other.
    """
    named_by_others = {
        other: effect.confusable_with[name]
        for other, effect in EFFECTS.items()
        if name in effect.confusable_with
    }
    return dict(sorted({**named_by_others, **EFFECTS[name].confusable_with}.items()))


def _parameter(parameter: Parameter) -> str:
    unit = f" {parameter.unit}" if parameter.unit else ""
    usual = (
        f"off at {parameter.off:g}{unit}, typically {parameter.sigma:g}{unit}"
        if parameter.role == "strength"
        else f"{parameter.centre:g} ± {parameter.sigma:g}{unit}"
    )
    bounds = f"{parameter.low:g} … {parameter.high:g}{unit}"
    return f"  {parameter.name:14}{parameter.meaning}: {usual}; {bounds}"


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="  ")


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd effects", description="The effects, or all that is known of one of them."
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="an effect")

    return parser
