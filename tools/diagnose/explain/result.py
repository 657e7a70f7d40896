"""What a diagnosis found: the JSON of `gritd diagnose`, and the evidence a report draws. Plain
values, SI inside.

Arrays are lists of floats of one length n per trace; `to_json` gives the whole tree as JSON types,
NaN as null.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from gritd.estimator.model.learnt import LearntForm
from gritd.tools.cli.wording import listed, sigmas
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict.decision import Verdict


@dataclass(frozen=True)
class Quantity:
    """A value, its standard deviation and unit. For a parameter, the unit is the one it is stated
    in (SI).
    """

    value: float
    sigma: float
    unit: str = ""


@dataclass(frozen=True)
class Test:
    """The alarm: is there a mismatch at all? A likelihood ratio, which noise alone makes as large
    as 1/level in a share `level` of campaigns at most.

    name:      what was largest: "omnibus", "strain", or the name of an effect whose signature stood
        out.
    statistic: the log likelihood ratio [nats], and the threshold it had to pass.
    p:         largest chance that noise alone could give of as much.
    level:     the false-alarm rate at which the threshold was set.
    nulls:     simulations of noise that it rests on: none.
    """

    name: str
    statistic: float
    threshold: float
    p: float
    level: float
    nulls: int


@dataclass(frozen=True)
class Location:
    """Where the misfit lives. `share` is the part of the channel's explainable misfit that the
    covariate takes.

    p is the chance of as much by noise alone, q after false-discovery control over all pairs that
    were tried.
    changes: values of the covariate at which the misfit starts or stops; of runs, the number (from
    1) of the first beyond.
    """

    channel: str
    covariate: str
    share: float
    p: float
    q: float
    where: str
    changes: tuple[float, ...] = ()


@dataclass(frozen=True)
class Hypothesis:
    """One effect, fitted jointly with the soil to all channels, scored on runs and conditions it
    was not fitted to.

    other_forms: of an accepted effect, the share by which what it does may differ where it is
        driven otherwise: published forms of it do.
    profile: channel -> from lowest to highest, what an effect moves it by that goes along what no
        law tells of; of that its parameters state a part only.
    """

    effect: str
    probability: float
    heldout_gain_nats: float
    parameters: Mapping[str, Quantity]
    indistinguishable_from: tuple[str, ...] = ()
    accepted: bool = False
    sentence: str = ""  # the effect in plain words
    equation: str = ""  # what it changes, and how
    score_nats: float = 0.0  # of its signature, before the nonlinear fit
    # rival -> what would distinguish them, in words
    separated_by: Mapping[str, str] = field(default_factory=dict)
    other_forms: float = 0.0
    profile: Mapping[str, Quantity] = field(default_factory=dict)

    @property
    def known(self) -> Mapping[str, Quantity]:
        """The parameters that are more than their σ; all where none is."""
        there = {n: q for n, q in self.parameters.items() if abs(q.value) > q.sigma}
        return there or self.parameters


SOIL = {  # in words
    "c": "cohesion c",
    "tan_phi": "tan φ",
    "k": "shear modulus k",
    "n": "sinkage exponent n",
    "K": "sinkage modulus K",
}


@dataclass(frozen=True)
class SoilFit:
    """c [Pa], tan_phi, k [m], n, K [Pa/mⁿ]: known before, fitted without and with the accepted
    effects.

    strain: (before − prior)/σ of each, at the fit without the effect.
    """

    prior: Mapping[str, Quantity]
    before: Mapping[str, Quantity]
    after: Mapping[str, Quantity]
    strain: Mapping[str, float]

    def strained(self) -> str:
        """In words, which parameters the fit without an effect moved far from what was known; empty
        if none.
        """
        far = [
            (k, s)
            for k, s in self.strain.items()
            if math.isfinite(s) and abs(s) >= TUNING.explain.strained_soil
        ]

        moved = listed([f"{SOIL.get(k, k)} by {sigmas(s)}" for k, s in far])
        return f"Without an effect the fit moves {moved} from what was known." if moved else ""


@dataclass(frozen=True)
class Fit:
    """Root mean square errors in the channel's unit, on data held out: predicted by a fit to the
    other runs.

    innovation: root mean square of the on-line filter's normalised innovations, None where there
    are none; the note says why, or why after is as before.
    """

    unit: Mapping[str, str]
    before: Mapping[str, float]
    after: Mapping[str, float]
    noise_floor: Mapping[str, float]
    innovation_before: Mapping[str, float] | None = None
    innovation_after: Mapping[str, float] | None = None
    innovation_note: str = ""


@dataclass(frozen=True)
class Law:
    """An empirical expression for what no listed effect explains, in the channel's unit, valid
    inside `domain`. It predicts runs that were held out better than the discrepancy of form does,
    and is what is written into a configuration, in place of that.

    share: of the misfit, by squares; parameters: of effect `empirical_law`; soil: as fitted beside.
    """

    channel: str
    expression: str
    domain: Mapping[str, tuple[float, float]]
    share: float
    parameters: Mapping[str, Quantity]
    carries: bool = True
    soil: Mapping[str, Quantity] = field(default_factory=dict)


@dataclass(frozen=True)
class NextExperiment:
    """separates: effects that are distinguished; of an unlisted misfit those that are distinguished
    from it; where the recordings were insufficient, those that would show.

    expected_probability: that of what is true, of two as likely now, after the expected gain.
    NaN: not foreseen.
    """

    key: str  # of gritd.estimator.effects.base.EXPERIMENTS
    action: str
    separates: tuple[str, ...]
    expected_gain_nats: float
    expected_probability: float = math.nan


@dataclass(frozen=True)
class Remainder:
    """What the accepted names leave of a channel beyond its noise, root mean square."""

    rms: float
    unit: str
    where: str  # in words


@dataclass(frozen=True)
class Discrepancy:
    """How far the form of the model may be off in a channel, one standard deviation."""

    size: float
    unit: str
    learnt_from: str  # prior, reference or recordings


@dataclass(frozen=True)
class Reference:
    """The campaign that a new one is held against: then names, places and fit speak of what is new.

    verdict: of its own diagnosis, where there was one; covered: share of the new campaign's values
        that lie where the reference was driven; outside: where the others lie.
    effects: that the reference shows by itself, which act in both campaigns: their parameters.
    """

    verdict: str | None
    covered: float
    outside: str
    effects: Mapping[str, Mapping[str, Quantity]]
    files: tuple[str, ...] = ()
    bed: str = ""


@dataclass(frozen=True)
class Ripple:
    """A line in the spectra of a channel at the recordings' own rate.

    at:        ripples a turn of the wheel (along 1/turn), or a frequency (along Hz); with its
        standard deviation.
    amplitude: root mean square over the runs, in the channel's unit.
    p:         of as much by noise alone, all that were tried counted.
    frequency: [Hz] in the slowest and in the fastest stretch.
    harmonic_of: of which louder line of the channel; reference: whether the reference has it too.
    """

    channel: str
    at: float
    sigma: float
    along: str
    amplitude: float
    amplitude_sigma: float
    unit: str
    p: float
    frequency: tuple[float, float]
    harmonic_of: float | None = None
    reference: bool = False


@dataclass(frozen=True)
class Explanation:
    """One of those that compete: listed effects, the discrepancy of form alone where there are
    none, unexplained terms beside them where `nameless`. evidence: [nats] above the
    discrepancy alone.
    """

    names: tuple[str, ...]
    nameless: bool
    evidence: float
    probability: float
    share: float = 0.0
    trust: tuple[float, ...] = ()


@dataclass(frozen=True)
class Trace:
    """One channel of one run on the analysis grid, each list (n,). Predictions are for the run held
    out.

    used: 1 where the soil fit used the sample, 0 where it did not (standstill, lifted, unsteady).
    """

    run: str
    channel: str
    unit: str
    time: list[float]
    measured: list[float]
    before: list[float]
    after: list[float]
    used: list[int]
    sigma: float  # noise of one grid value


@dataclass(frozen=True)
class Scatter:
    """Residual (measured − predicted) against a covariate where the misfit lives; lists (n,)."""

    channel: str
    covariate: str
    unit: str
    covariate_unit: str
    x: list[float]
    before: list[float]
    after: list[float]
    run: list[int]
    sigma: float


@dataclass(frozen=True)
class Diagnosis:
    """Everything `gritd diagnose` found."""

    verdict: Verdict
    summary: str  # one or two sentences with numbers
    test: Test
    location: tuple[Location, ...]
    hypotheses: tuple[Hypothesis, ...]
    soil: SoilFit | None  # None for a rig without soil
    fit: Fit
    law: Law | None
    next_experiment: NextExperiment | None
    caveats: tuple[str, ...]
    nuisance: Mapping[str, Quantity]  # calibration constants, fitted with the accepted effects
    # channel -> sigma of a grid value, correlation time [s], shares of slow and fast noise
    noise: Mapping[str, Mapping[str, float]]
    baseline: tuple[str, ...]  # effects the configuration already held
    traces: tuple[Trace, ...]
    scatters: tuple[Scatter, ...]
    # files with their SHA-256, configuration text, seed, versions, settings of the engine
    redo: Mapping[str, Any]

    share: float = 0.0  # of the misfit that the accepted names take
    remaining_words: str = ""
    # channel -> what the accepted names leave
    remaining: Mapping[str, Remainder] = field(default_factory=dict)
    # channel -> how far the form of the model may be off
    discrepancy: Mapping[str, Discrepancy] = field(default_factory=dict)
    reference: Reference | None = None  # the campaign in which nothing is new
    explanations: tuple[Explanation, ...] = ()  # all that were weighed
    lines: tuple[Ripple, ...] = ()  # at the recordings' own rate
    latencies: tuple[()] = ()  # none: the fit has the delay of each channel
    candidates: int = 0  # listed effects that were considered
    # the discrepancy of form as a configuration holds it; not in the JSON
    learnt: LearntForm | None = None

    @property
    def accepted(self) -> tuple[Hypothesis, ...]:
        return tuple(h for h in self.hypotheses if h.accepted)

    def to_json(self) -> dict[str, Any]:
        """The contract of docs/diagnosis.md; more keys than those promised may appear."""
        whole = asdict(replace(self, learnt=None))
        del whole["learnt"]

        soil, fit = whole.pop("soil"), whole.pop("fit")
        whole["soil"] = soil and {**soil, "strain_words": self.soil.strained() if self.soil else ""}
        whole["fit"] = {
            "heldout": {"before": fit["before"], "after": fit["after"]},
            "noise_floor": fit["noise_floor"],
            "unit": fit["unit"],
            "innovation": {key: fit[f"innovation_{key}"] for key in ("before", "after", "note")},
        }
        return plain(whole)  # type: ignore[no-any-return]


def plain(value: Any) -> Any:
    """The same tree in JSON types; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, bool | str) or value is None:
        return value
    number = value.item() if hasattr(value, "item") else value
    return None if isinstance(number, float) and not math.isfinite(number) else number
