"""One blind case: everything that is true of it, drawn from its own seed; and what of it is handed
over.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from gritd.tools.proof.blind import campaign, detect, knowledge, printed
from gritd.tools.proof.blind.detect import BlindTrial, Detector
from gritd.tools.proof.blind.groups import NEEDED
from gritd.tools.proof.blind.plant import worlds
from gritd.tools.proof.blind.plant.concealed import LISTED
from gritd.tools.proof.blind.plant.concealed import drawn as effect_drawn
from gritd.tools.proof.blind.plant.contact import PlantSoil
from gritd.tools.proof.blind.plant.effect import PlantEffect
from gritd.tools.proof.blind.plant.respond import World
from gritd.tools.proof.blind.plant.scene import TrueRig
from gritd.tools.proof.blind.strata import LEVELS, USUAL, Assignment

ATTEMPTS = 25  # campaigns tried until one shows the effect as strongly as wanted
USUAL_SHARE = (0.2, 0.6)  # of the largest plausible strength, between which the usual one lies
COMPARED = ("single", "usual", "absorbed", "confounded")
CHANNELS = {
    "sinkage": "sinkage",
    "current": "torque",
    "pull": "drawbar_pull",
    "load": "load",
    "torque": "axle_torque",
}
HEAVIEST = 400.0  # [N]
TALL = 0.4  # stated noise over true where the true is 2.5 times the stated
WRONG_NOISE = {
    True: 0.5,
    False: 0.3,
}  # share of cases without and with an effect whose stated noise is off by two


@dataclass(frozen=True)
class BlindCase:
    """The answers: never shown to the diagnosis before it has spoken."""

    number: int
    seed: int
    assignment: Assignment
    family: str
    design: campaign.Design
    trial: BlindTrial  # its world holds the concealed effects
    reference: BlindTrial | None  # the campaign before, without them
    noise_factor: float  # stated noise over true
    detectability: float  # D of all concealed effects together
    single: tuple[float, ...]  # D of each
    inseparable: dict[
        str, float
    ]  # rivals that this campaign cannot tell from the (only) effect, with what D is left
    oracle_variance: dict[
        str, float
    ]  # what fitting adds to a held-out error, by the diagnosis' channels [SI²]

    @property
    def effects(self) -> tuple[PlantEffect, ...]:
        return self.trial.world.effects

    def stated(self) -> knowledge.Knowledge:
        return knowledge.misstated(self.trial.known, self.noise_factor)

    def alone(self) -> list[BlindCase]:
        """Of two effects the same campaign with each of them alone."""
        if len(self.effects) < 2:
            return []
        worlds_of_one = [self.trial.world.with_effects(effect) for effect in self.effects]
        return [replace(self, trial=replace(self.trial, world=of)) for of in worlds_of_one]

    def answers(self) -> dict[str, Any]:
        """As JSON types."""
        world, before = self.trial.world, self.reference

        return {
            "case": self.number,
            "seed": self.seed,
            **asdict(self.assignment),
            "detectability": self.detectability,
            "detectability_single": list(self.single),
            "detection_limit": detect.LIMIT,
            "inseparable": self.inseparable,
            "oracle_variance": self.oracle_variance,
            "concealed": [
                _described(effect) | {"coinciding": effect.coinciding()} for effect in self.effects
            ],
            "world_habits": [_described(effect) for effect in world.baseline],
            "world_bed": {"form": type(world.bed).__name__, **vars(world.bed)},
            "soil_family": self.family,
            "soil": _soil(self.trial),
            "reference_soil": None if before is None else _soil(before),
            "habits": asdict(self.design),
            "noise_factor": self.noise_factor,
            "runs": [asdict(run) for run in self.trial.runs],
            "reference_runs": [asdict(run) for run in before.runs] if before else [],
            "chain": asdict(self.trial.chain),
            "rig": asdict(world.rig),
        }


def _described(effect: PlantEffect) -> dict[str, Any]:
    return {"name": effect.name, "form": type(effect).__name__, **asdict(effect)}


def _soil(trial: BlindTrial) -> dict[str, float]:
    return {name: float(value) for name, value in asdict(trial.world.ground).items()}


def drawn(number: int, seed: int, assignment: Assignment) -> BlindCase:
    """A case from its seed. Campaigns are drawn until the effect shows as wanted, or the best of
    them is taken.
    """
    rng = np.random.default_rng(seed)
    wanted = detect.LIMIT * LEVELS.get(assignment.level, 0.0)
    best: BlindCase | None = None

    for _ in range(ATTEMPTS if assignment.effects else 1):
        case = _attempt(number, seed, assignment, wanted, rng)
        if best is None or min(case.single, default=0.0) > min(best.single, default=0.0):
            best = case
        if min(best.single, default=wanted) > 0.9 * wanted:
            break

    assert best is not None
    return _judged(best, rng)


def _attempt(
    number: int, seed: int, assignment: Assignment, wanted: float, rng: np.random.Generator
) -> BlindCase:
    design = campaign.design_drawn(rng, _fixed(assignment))
    family, trial, reference = _trials(design, assignment, rng)
    detector = _detector(trial)
    facts = detector.facts()

    made = [effect_drawn(name, rng, facts) for name in assignment.effects]
    if assignment.level == USUAL:
        made = [replace(e, strength=e.strength * rng.uniform(*USUAL_SHARE)) for e in made]
        fitted = [(effect, detector.detectability([effect])) for effect in made]
    else:
        fitted = [detect.strengthened(detector, effect, wanted) for effect in made]
    effects = tuple(effect for effect, _ in fitted)

    return BlindCase(
        number=number,
        seed=seed,
        assignment=assignment,
        family=family,
        design=design,
        trial=replace(trial, world=trial.world.with_effects(*effects)),
        reference=reference,
        noise_factor=TALL if assignment.noise == "tall" else noise_factor(not effects, rng),
        detectability=detector.detectability(effects) if effects else 0.0,
        single=tuple(distance for _, distance in fitted),
        inseparable={},
        oracle_variance={},
    )


def _detector(trial: BlindTrial) -> Detector:
    return printed.PrintedDetector(trial) if trial.printed else Detector(trial)


def _fixed(assignment: Assignment) -> campaign.Design:
    fixed: dict[str, Any] = dict(assignment.without)
    for name in assignment.effects:
        fixed = NEEDED.get(name, {}) | fixed
    return campaign.Design(**fixed)


def _trials(
    design: campaign.Design, assignment: Assignment, rng: np.random.Generator
) -> tuple[str, BlindTrial, BlindTrial | None]:
    """Soil family, the campaign, and the reference campaign before it, if any."""
    family, trial = _trial(design, assignment, rng)
    if not assignment.pair:
        return family, trial, None

    if assignment.printed:
        trial = replace(trial, printed=printed.errors_drawn(trial, rng))
    runs = _runs(trial.world.rig, trial.world.ground, design, rng)
    reference = replace(trial, runs=runs)
    if assignment.bed == "prepared":
        ground = knowledge.prepared(trial.world.ground, rng)
        trial = replace(trial, world=replace(trial.world, ground=ground))
    return family, trial, reference


def _trial(
    design: campaign.Design, assignment: Assignment, rng: np.random.Generator
) -> tuple[str, BlindTrial]:
    """Soil, rig, world, knowledge, sensors and campaign."""
    while True:
        family, ground = knowledge.ground_drawn(rng)
        rig = knowledge.rig_drawn(rng)
        runs = campaign.campaign(rig, ground, design, rng)
        if _drivable(rig, ground, runs):
            break

    heaviest = max(run.weight for run in runs)
    known = knowledge.knowledge_drawn(rig, ground, heaviest, bool(design.wrench), rng)
    rig = knowledge.fitted(rig, heaviest, known.torque_constant, rng)
    bed, own = worlds.drawn(assignment.world, rng, worlds.Size(heaviest, rig.radius))
    chain = knowledge.chain_drawn(known, rng)

    if assignment.noise == "slow":
        chain = knowledge.slowed(chain)
    return family, BlindTrial(World(rig, ground, bed=bed, baseline=own), known, chain, runs)


def _runs(
    rig: TrueRig, ground: PlantSoil, design: campaign.Design, rng: np.random.Generator
) -> tuple[campaign.BlindRun, ...]:
    """Another campaign of the same rig."""
    while True:
        runs = campaign.campaign(rig, ground, design, rng)
        if _drivable(rig, ground, runs):
            return runs


def _drivable(rig: TrueRig, ground: PlantSoil, runs: tuple[campaign.BlindRun, ...]) -> bool:
    """Whether no load bogs the wheel, nor is too small or too large for a testbed."""
    weights = [run.weight for run in runs]
    return (
        min(weights) >= 4.0
        and max(weights) <= HEAVIEST
        and campaign.deepest(rig, ground, max(weights)) < 1.15
    )


def noise_factor(nothing: bool, rng: np.random.Generator) -> float:
    """Stated noise over true."""
    return float(rng.choice((0.5, 2.0))) if rng.random() < WRONG_NOISE[nothing] else 1.0


def _judged(case: BlindCase, rng: np.random.Generator) -> BlindCase:
    """With the oracle's error, and the rivals that this campaign cannot tell from a single listed
    effect.
    """
    detector = _detector(case.trial)
    added = detector.refit_variance(case.effects)
    unit = {"current": case.trial.known.torque_constant.value**2}
    variance = {CHANNELS[name]: unit.get(name, 1.0) * value for name, value in added.items()}
    rivals = _rivals(case, detector, rng) if case.assignment.stratum in COMPARED else {}
    return replace(case, oracle_variance=variance, inseparable=rivals)


def _rivals(case: BlindCase, detector: Detector, rng: np.random.Generator) -> dict[str, float]:
    change = detector.change(case.effects)
    left = {
        name: detector.beside(change, detector.rivals(name, rng))
        for name in LISTED
        if name != case.effects[0].name
    }
    return {name: d for name, d in left.items() if d < detect.NEAR}
