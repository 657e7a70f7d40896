"""`gritd compare`: the forward simulation drawn over recordings, channel by channel, with the
residual below.
"""

from __future__ import annotations

import argparse
import importlib
import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import (
    DAMAGED,
    DONE,
    FAILED,
    CommandError,
    Parser,
    add_configuration,
    os_errors,
)
from gritd.tools.cli.files import writable
from gritd.tools.cli.optional import require
from gritd.tools.cli.progress import Progress
from gritd.tools.diagnose.explain.result import Quantity, SoilFit, Trace
from gritd.tools.diagnose.fit.problem import Fitted
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.noise.estimate import first_guess
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import read_all, sha256, signals
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.recordings.provenance import check_rig
from gritd.tools.report import comparison
from gritd.tools.report.comparison import Comparison

RATE = 10.0  # [Hz] of the grid on which they are compared


def main(argv: Sequence[str]) -> int:
    """Print the errors, draw what was asked for. Exit 3 if a recording is damaged: then it is of
    what was whole. Raises ConfigError or CommandError.
    """
    arguments = build_parser().parse_args(argv)
    if arguments.png:
        require("matplotlib", "--png")
    for path in filter(None, (arguments.report, arguments.png)):
        writable(path)

    configuration = config.load(arguments.config)
    with Progress("compare") as progress:
        progress.at(f"{len(arguments.files)} recordings")
        fitted = compare(
            arguments.files,
            configuration,
            fitted=arguments.fit,
            other_rig=arguments.other_rig,
            command=["gritd", "compare", *argv],
        )

    with os_errors():
        if arguments.report:
            arguments.report.write_text(comparison.render(fitted), encoding="utf-8")
        if arguments.png:
            importlib.import_module("gritd.tools.report.sheet").draw(arguments.png, fitted)

    print(comparison.printed(fitted))
    return DAMAGED if fitted.damage else DONE


def build_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="gritd compare",
        description="Draw the forward simulation over recordings, with the residual.",
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="recordings")
    add_configuration(parser, "the testbed, its soil and its effects", required=True)
    parser.add_argument(
        "--fit",
        action="store_true",
        help="fit the soil and the calibration within their uncertainty too",
    )
    parser.add_argument(
        "--report", type=Path, metavar="OUT.html", help="a page that needs nothing else"
    )
    parser.add_argument(
        "--png", type=Path, metavar="OUT.png", help="the same on one sheet; or .svg"
    )

    return parser


def compare(
    paths: Sequence[Path],
    configuration: Configuration,
    *,
    fitted: bool,
    other_rig: bool = False,
    command: Sequence[str] = (),
) -> Comparison:
    """Recordings compared with their simulation. Raises CommandError where one cannot be read or
    nothing can be compared, or where the configuration is of another testbed and that is not meant.
    """
    settings = configuration.settings
    recordings = read_all(paths)
    if not other_rig:
        check_rig(recordings, settings, configuration.source)
    series = [signals(recording, settings, RATE) for recording in recordings]
    rig = wheel_rig(series, settings, read_off=False)
    stack = Stack(rig)

    if stack.size == 0:
        raise CommandError(
            f"{paths[0]}: found no sample where the wheel drives under load; expected some seconds",
            FAILED,
        )

    configured = np.zeros(len(rig.constants))
    if fitted:
        base = fit_base(rig)
        fit, noise = base.fitted, base.problem.noise
    else:
        fit, noise = None, first_guess(stack, stack.predict(configured))

    sigma = {c: colour.sigma for c, colour in zip(rig.channels, noise.colours, strict=True)}

    return Comparison(
        settings.testbed,
        _traces(rig, _names(rig, paths), (configured, fit.u if fit else configured), sigma),
        _soil(rig, fit) if fit else None,
        (
            *(effect.name for effect in rig.baseline),
            *(["discrepancy"] if settings.discrepancy is not None else []),
        ),
        tuple(rig.words.caveats),
        _redo(paths, configuration, command),
        tuple(f"{recording.path}: {line}" for recording in recordings for line in recording.damage),
    )


def _names(rig: Rig, paths: Sequence[Path]) -> list[str]:
    """Of the runs; with the file's where two runs have the same."""
    names = [run.name for run in rig.runs]
    return [
        n if names.count(n) == 1 else f"{n} ({path.name})"
        for n, path in zip(names, paths, strict=True)
    ]


def _traces(
    rig: Rig, names: Sequence[str], constants: tuple[Array, Array], sigma: dict[str, float]
) -> tuple[Trace, ...]:
    before, after = (rig.predict(u, ()) for u in constants)

    return tuple(
        Trace(
            names[at],
            channel,
            rig.units[channel],
            (run.time - run.time[0]).tolist(),
            run.measured[channel].tolist(),
            before[at][channel].tolist(),
            after[at][channel].tolist(),
            run.used[channel].astype(int).tolist(),
            sigma[channel],
        )
        for channel in rig.channels
        for at, run in enumerate(rig.runs)
    )


def _soil(rig: Rig, fit: Fitted) -> SoilFit:
    spread = np.sqrt(np.diag(fit.covariance()))
    known = [
        (k, float(u), float(s))
        for k, u, s in zip(rig.constants, fit.u, spread, strict=False)
        if k.soil
    ]
    prior = {k.name: Quantity(k.value, k.sigma, k.unit) for k, _, _ in known}
    fitted = {k.name: Quantity(k.of(u), k.spread(u, s), k.unit) for k, u, s in known}
    return SoilFit(prior, fitted, fitted, {k.name: u for k, u, _ in known})


def _redo(
    paths: Sequence[Path], configuration: Configuration, command: Sequence[str]
) -> dict[str, object]:
    return {
        "command": shlex.join(command),
        "files": [{"file": path.name, "sha256": sha256(path)} for path in paths],
        "grid": f"{RATE:g} Hz",
        "configuration": configuration.text,
    }
