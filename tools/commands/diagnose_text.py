"""What `gritd diagnose` prints: the verdict for a person."""

from __future__ import annotations

import math
from collections.abc import Iterator

from gritd.estimator.visible import visible
from gritd.tools.diagnose.explain.result import (
    Diagnosis,
    Fit,
    Hypothesis,
    NextExperiment,
    SoilFit,
)


def text(diagnosis: Diagnosis) -> str:
    """The verdict for a person."""
    lines = [
        f"verdict: {diagnosis.verdict}",
        diagnosis.summary,
        *(f"  where: {place.where} (p {place.p:.2g})" for place in diagnosis.location[:4]),
        *map(_hypothesis, diagnosis.hypotheses[:4]),
    ]
    if diagnosis.law is not None:
        lines.append(f"  law: {diagnosis.law.expression} (takes {diagnosis.law.share:.0%})")
    if diagnosis.soil is not None:
        lines += _soil(diagnosis.soil)
    lines += _fit(diagnosis.fit)

    if diagnosis.next_experiment is not None:
        following = diagnosis.next_experiment
        lines.append(f"  next: {following.action}{_foreseen(following)}")
    lines += [diagnosis.remaining_words, *(f"note: {c}" for c in diagnosis.caveats)]
    return "\n".join(map(visible, lines))


def _hypothesis(of: Hypothesis) -> str:
    values = ", ".join(
        f"{n} {q.value:.3g} ± {q.sigma:.2g} {q.unit}".rstrip() for n, q in of.parameters.items()
    )
    alike = f"; like {', '.join(of.indistinguishable_from)}" if of.indistinguishable_from else ""
    return f"  {'*' if of.accepted else ' '} {of.effect} {of.probability:.2f}: {values}{alike}"


def _soil(soil: SoilFit) -> Iterator[str]:
    for name in ("c", "tan_phi"):
        before, after = soil.before[name], soil.after[name]
        yield (
            f"  {name}: {before.value:.4g} ± {before.sigma:.2g} before, "
            f"{after.value:.4g} ± {after.sigma:.2g} {after.unit} after"
        )
    if strained := soil.strained():
        yield f"  {strained}"


def _fit(fit: Fit) -> Iterator[str]:
    for channel, unit in fit.unit.items():
        yield (
            f"  held-out {channel}: {fit.before[channel]:.3g} before, "
            f"{fit.after[channel]:.3g} after, noise {fit.noise_floor[channel]:.2g} {unit}"
        )

    if fit.innovation_before and fit.innovation_after:
        ratios = ", ".join(
            f"{name} {ratio:.2g} before, {fit.innovation_after.get(name, ratio):.2g} after"
            for name, ratio in fit.innovation_before.items()
        )
        yield f"  on-line filter, innovation over its sigma: {ratios}"
    elif fit.innovation_note:
        yield f"  on-line filter: {fit.innovation_note}"


def _foreseen(following: NextExperiment) -> str:
    gain = following.expected_gain_nats
    return f" (expected gain {gain:.0f} nats)" if math.isfinite(gain) else ""
