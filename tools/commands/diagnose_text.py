"""What `gritd diagnose` prints: the verdict for a person."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from gritd.estimator.visible import visible
from gritd.tools.cli.wording import chance, number, percent, shown, spaced, spelled
from gritd.tools.diagnose.explain.result import (
    Diagnosis,
    Fit,
    Hypothesis,
    NextExperiment,
    Quantity,
    Reference,
    SoilFit,
)
from gritd.tools.diagnose.verdict.decision import QUIET
from gritd.tools.report.words import quantity, to_tell

SHOWN = 4  # places and hypotheses
DIGITS = 2  # of a probability
LEAST, NEARLY = 0.75, 0.999  # sureness that is worth saying, and than which none is greater
NAMES = {"c": "c", "tan_phi": "tan φ"}


def text(diagnosis: Diagnosis) -> str:
    """The verdict for a person."""
    lines = [
        f"verdict: {diagnosis.verdict}. {diagnosis.summary}",
        *(f"  where: {place.where} ({chance(place.p)})" for place in diagnosis.location[1:SHOWN]),
        *(line for of in _shown(diagnosis) for line in _hypothesis(of, diagnosis)),
        *_had(diagnosis.reference),
    ]
    if (law := diagnosis.law) is not None:
        lines.append(f"  law: {law.expression} (takes {percent(law.share)} of the misfit)")
    named = diagnosis.verdict == "explained"
    if diagnosis.soil is not None:
        lines += _soil(diagnosis.soil, named)
    lines += _fit(diagnosis.fit, named)

    if diagnosis.next_experiment is not None:
        following = diagnosis.next_experiment
        lines.append(f"  next: {following.action}{_foreseen(following, diagnosis.verdict)}")
    if diagnosis.verdict != "unlisted":  # there all of the misfit remains
        lines.append(diagnosis.remaining_words)
    lines += (f"note: {c}" for c in diagnosis.caveats)
    return "\n".join(map(visible, lines))


def _shown(diagnosis: Diagnosis) -> list[Hypothesis]:
    """What is accepted, then what has a probability in the digits that are printed; of a campaign
    in which nothing is amiss none.
    """
    if diagnosis.verdict in QUIET:
        return []
    others = (of for of in diagnosis.hypotheses if not of.accepted)
    likely = [of for of in others if of.probability >= 0.5 * 10.0**-DIGITS]
    return [*diagnosis.accepted, *likely][:SHOWN]


def _hypothesis(of: Hypothesis, diagnosis: Diagnosis) -> Iterator[str]:
    """Where names are accepted, the others are rivals; without any, they are no explanation. Of an
    accepted one its equation too.
    """
    other = "rival" if diagnosis.accepted else "not accepted"
    head = f"  {'accepted' if of.accepted else other}: {of.effect}"
    head += f", probability {of.probability:.{DIGITS}f}"
    head += f", form error {percent(of.other_forms)}" if of.other_forms else ""
    values = "; ".join(filter(None, (_listed(of.known), *_profile(of))))
    yield f"{head}{f': {values}' if values else ''}"
    if of.accepted:
        yield from (f"    {line}" for line in of.equation.splitlines())


def _profile(of: Hypothesis) -> Iterator[str]:
    for channel, q in of.profile.items():
        unit, factor = shown(q.unit)
        yield f"with its profile it moves {spelled(channel)} by {spaced(q.value * factor, unit, 2)}"


def _had(reference: Reference | None) -> Iterator[str]:
    for effect, parameters in reference.effects.items() if reference else ():
        yield f"  in the reference too: {effect}: {_listed(parameters)}"


def _listed(parameters: Mapping[str, Quantity]) -> str:
    return ", ".join(f"{name} {quantity(q)}" for name, q in parameters.items())


def _soil(soil: SoilFit, named: bool) -> Iterator[str]:
    """named: whether an effect makes the difference between before and after."""
    for key, name in NAMES.items():
        before, after = quantity(soil.before[key]), quantity(soil.after[key])
        yield f"  {name}: {before} before, {after} after" if named else f"  {name}: {after}"
    if strained := soil.strained():
        yield f"  {strained}"


def _fit(fit: Fit, named: bool) -> Iterator[str]:
    for channel, inside in fit.unit.items():
        unit, factor = shown(inside)
        before, after = (number(of[channel] * factor) for of in (fit.before, fit.after))
        noise = number(fit.noise_floor[channel] * factor, 2)
        error = f"{before} before, {after} after" if named else before
        where = f"error of {spelled(channel)} on unseen runs"
        yield f"  {where}: {error}, noise {noise} {unit}".rstrip()

    if fit.innovation_before and fit.innovation_after:
        ratios = ", ".join(
            f"{spelled(name)} {ratio:.2g} before, {fit.innovation_after.get(name, ratio):.2g} after"
            for name, ratio in fit.innovation_before.items()
        )
        yield f"  innovation of the on-line filter over its σ: {ratios}"
    elif fit.innovation_note:
        yield f"  on-line filter: {fit.innovation_note}"


def _foreseen(following: NextExperiment, verdict: str) -> str:
    """What it would tell, and how sure one would be of what is true, of two as likely now."""
    if not following.separates:
        return ""
    told = to_tell(verdict, following.separates)
    sure = following.expected_probability
    known = sure >= LEAST  # else it is not foreseen, or next to nothing
    return f": {told} ({percent(min(sure, NEARLY))} sure)" if known else f": {told}"
