"""What the blur of changing predictions hides of effects that show at changes of the motion.

    gritd prove --strata single --seal-only --keep --output BATCH …
    python -m gritd.tools.dev.transients BATCH … [--most N]

A value whose prediction changes fast has a larger σ (tools/diagnose/rig/blur.py). For every
campaign: how far each effect of its expected size stands out of noise, soil and calibration [σ],
with this blur and without it.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import Parser
from gritd.tools.diagnose.fit.base import BaseFit, allowed
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.signatures import raw_signatures
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import read_all

EFFECTS = ("sensor_latency", "contact_relaxation", "wheel_inertia")
SEEN = 1.0  # [σ] an effect that stands out less is not seen in a campaign, with blur or without


def standing(rig: Rig) -> Mapping[str, tuple[float, float]]:
    """How far each effect stands out [σ], with the blur and without it."""
    base = fit_base(rig, np.random.default_rng(0))
    stack, fitted, noise = base.problem.stack, base.fitted, base.problem.noise
    named = [name for name in EFFECTS if name in rig.effects]
    signatures = tuple(raw_signatures(stack, fitted.u, fitted.predicted, named))

    blur = rig.blur(stack, fitted.predicted)
    sharp = np.sqrt(np.maximum(noise.uncertain**2 - blur**2, 0.0))
    both = [_heights(base, signatures, uncertain) for uncertain in (noise.uncertain, sharp)]
    return {name: (both[0][name], both[1][name]) for name in both[0]}


def _heights(
    base: BaseFit, signatures: Sequence[Signature], uncertain: Array
) -> Mapping[str, float]:
    """Of each effect, the root of its curvature beside soil and calibration."""
    noise = replace(base.problem.noise, uncertain=uncertain)
    stack = noise.stack
    problem = Problem(stack, noise, np.column_stack((noise.of_runs, allowed(stack))))
    projection = problem.descend((), (), base.fitted.u, np.zeros(0), rounds=0).projection()

    heights = {}
    for signature in signatures:
        curvature, _ = projection.project(whiten(noise, signature.columns))
        heights[str(signature.of)] = float(np.sqrt(np.diag(curvature).max()))
    return heights


def _campaigns(batches: Sequence[Path]) -> Iterator[Path]:
    for batch in batches:
        for configuration in sorted(batch.rglob("*.yaml")):
            if any(configuration.parent.glob("*.mcap")):
                yield configuration.parent


def main(argv: Sequence[str] | None = None) -> None:
    given = _parser().parse_args(argv)

    for folder in list(_campaigns(given.batches))[: given.most]:
        (configuration,) = folder.glob("*.yaml")
        settings = config.load(configuration).settings
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            seen = standing(rig_of(read_all(sorted(folder.glob("*.mcap"))), settings)[0])

        told = (
            f"{name} {blurred:.1f}, without blur {sharp:.1f} ({sharp / blurred - 1.0:+.0%})"
            for name, (blurred, sharp) in seen.items()
            if sharp > SEEN
        )
        print(f"{folder.parent.name}: {'; '.join(told)}", flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m gritd.tools.dev.transients", description=__doc__)
    parser.add_argument("batches", nargs="+", type=Path, metavar="BATCH")
    parser.add_argument("--most", type=int, help="campaigns, the first ones")
    return parser


if __name__ == "__main__":
    main()
