"""`gritd estimate FILE…`: what runs on one bed know together of its soil, compared with what each
knows alone.
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import exp, sqrt
from pathlib import Path
from typing import Any

from gritd.estimator.config import units
from gritd.estimator.config.configuration import Configuration, load, loads
from gritd.estimator.config.nearest import did_you_mean
from gritd.estimator.config.settings import Repeatability, Settings, settings_of_run
from gritd.estimator.filter.estimate import KPA, LN_K, TAN_PHI, C, Estimate
from gritd.estimator.offline.bed_runs import BedRun, bed_runs, doubted
from gritd.estimator.offline.playback import without_absent
from gritd.estimator.offline.streams import STREAMS
from gritd.estimator.online.bed import Known, fingerprint
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.recording import Recording
from gritd.estimator.visible import visible
from gritd.tools.cli import files
from gritd.tools.cli.command import (
    DAMAGED,
    DONE,
    FAILED,
    USAGE,
    CommandError,
    Parser,
    add_configuration,
    os_errors,
)
from gritd.tools.cli.progress import Progress
from gritd.tools.recordings.provenance import check_rig

REPEATABILITY = {"c": ("cohesion", "Pa"), "tan_phi": ("tan_phi", ""), "k": ("shear_modulus", "")}
UNUSUAL = 16.27  # chi-square, 3 degrees of freedom: 0.1 % of runs of the same soil are beyond


def main(argv: Sequence[str]) -> int:
    """Exit 0; 1 where no run could be used; 3 where a recording is damaged. Raises CommandError."""
    arguments = build_parser().parse_args(argv)
    recordings = [files.recording(path, STREAMS) for path in _once(arguments.files)]
    configurations = configurations_of(recordings, arguments)
    repeatability = _repeatability(configurations[0].settings.bed.repeatability, arguments)

    given = [settings_of(c, r) for c, r in zip(configurations, recordings, strict=True)]
    check_same_rig(given, recordings)
    try:
        runs = estimated(list(zip(given, recordings, strict=True)), repeatability)
    except RecordingError as error:
        raise CommandError(error, DAMAGED) from None

    print("\n".join(map(visible, lines(runs, repeatability))))
    if arguments.json:
        _write(arguments.json, runs, repeatability)
    damage = [f"{r.path}: {line}" for r in recordings for line in r.damage]
    print("".join(f"{visible(line)}\n" for line in damage), end="", file=sys.stderr)
    return DAMAGED if damage else FAILED if doubted(runs).why else DONE


def _once(paths: Sequence[Path]) -> list[Path]:
    """Each file once, whatever it is called; says so where one came twice."""
    kept: dict[Path, Path] = {}
    for path in paths:
        place = path.resolve()
        if place in kept:
            print(f"{path}: the same file as {kept[place]}; used once", file=sys.stderr)
        kept.setdefault(place, path)
    return list(kept.values())


def estimated(
    given: Sequence[tuple[Settings, Recording]],
    repeatability: Repeatability,
    what: str = "estimating",
) -> list[BedRun]:
    """The runs, with a sign of life. Each is replayed alone, and all but the first with what the
    ones before it know.
    """
    names = [recording.path.name for _, recording in given]
    sizes = [recording.path.stat().st_size for _, recording in given]
    work = sum(sizes) + sum(sizes[1:])
    runs: list[BedRun] = []
    before = again = 0.0
    with Progress(what) as progress:

        def advanced(done: int, total: int) -> None:
            nonlocal before, again
            at, share = len(runs), done / max(total, 1)
            again, before = again + (share < before), share
            through = sum(sizes[:at]) + sum(sizes[1:at]) + sizes[at] * (again + share)
            progress.at(names[at], through / work)

        for run in bed_runs(given, repeatability, advance=advanced):
            runs.append(run)
            before = again = 0.0
    return runs


def configurations_of(recordings: Sequence[Recording], arguments: Namespace) -> list[Configuration]:
    """The given configuration for all, or each recording's own. Raises CommandError where the given
    one is of another testbed, unless that is meant; ConfigError.
    """
    configurations = [configuration_of(each, arguments.config) for each in recordings]
    if arguments.config is not None and not arguments.other_rig:
        check_rig(recordings, configurations[0].settings, arguments.config)
    return configurations


def configuration_of(recording: Recording, path: str | None) -> Configuration:
    """The given configuration, or the recording's own. Raises CommandError, ConfigError."""
    if path is not None:
        return load(path)
    if recording.config_yaml is None:
        raise CommandError(
            f"{recording.path}: holds no configuration; give one with --config", USAGE
        )
    return loads(recording.config_yaml, f"{recording.path}: gritd.config")


def settings_of(configuration: Configuration, recording: Recording) -> Settings:
    return settings_of_run(without_absent(configuration.settings, recording), recording.run)


def check_same_rig(given: Sequence[Settings], recordings: Sequence[Recording]) -> None:
    """Raises CommandError where two runs differ in prior, calibration or effects: errors that are
    the same in all of them could not be distinguished from those that are not.
    """
    first = fingerprint(given[0])

    for settings, recording in zip(given, recordings, strict=True):
        if fingerprint(settings) != first:
            raise CommandError(
                f"{recording.path}: has another prior, calibration, set of sensors or effects than "
                f"{recordings[0].path}; expected the same, or one for all with --config",
                USAGE,
            )


def _repeatability(configured: Repeatability, arguments: Namespace) -> Repeatability:
    """The configured one, with the values of the command line in their place. Raises
    CommandError.
    """
    for text in arguments.repeatability:
        name, _, value = text.partition("=")
        if name not in REPEATABILITY:
            raise CommandError(
                f"--repeatability {text}: found {name!r}{did_you_mean(name, REPEATABILITY)}; "
                f"expected one of {', '.join(REPEATABILITY)}",
                USAGE,
            )

        field, unit = REPEATABILITY[name]
        try:
            configured = replace(configured, **{field: _positive(value, unit)})
        except units.UnitError as error:
            raise CommandError(f"--repeatability {text}: {error}", USAGE) from None

    return configured


def _positive(text: str, unit: str) -> float:
    value = units.parse(text, unit)
    if value < 0.0:
        raise units.UnitError("a standard deviation is 0 or more")
    return value


# --- what is said ---


def lines(runs: Sequence[BedRun], repeatability: Repeatability) -> Iterator[str]:
    """A line a run, why one is not believed, then what they know together, and whether they are of
    one bed.
    """
    width = max(len(_name(run)) for run in runs)
    yield f"{'':{width}}   {'load':>8}   {'alone: c':>14}  {'tan φ':>15}   {'so far: c':>14}  tan φ"
    for run in runs:
        alone = _pair(run.alone.estimate) if run.alone.believed else ("not believed", "")
        so_far = _pair(run.known.estimate) if run.counts else ("not used", "")
        yield (
            f"{_name(run):{width}}   {_load(run):>8}   {alone[0]:>14}  "
            f"{alone[1]:>15}   {so_far[0]:>14}  {so_far[1]}"
        ).rstrip()

    yield ""
    yield from _refused(runs)
    reason = doubted(runs)
    used = [run for run in runs if run.counts]
    if reason.why:
        yield f"not sure of c and tan φ: {reason}"
    elif used:
        yield from _together(used)
    yield _stated(repeatability)
    yield from _strained(used)


def _refused(runs: Sequence[BedRun]) -> Iterator[str]:
    """Why runs are not used, each reason once."""
    reasons: dict[str, list[str]] = {}
    for run in runs:
        if not run.counts:
            reasons.setdefault(str(run.reason), []).append(_name(run))
    for reason, names in reasons.items():
        yield f"{', '.join(names)}: not used: {reason}"


def _name(run: BedRun) -> str:
    return run.recording.path.name


def _load(run: BedRun) -> str:
    """As stated of the run; of one that states none, where a sensor measured it, that it did."""
    if run.recording.run.nominal_load is None and run.settings.wrench is not None:
        return "measured"
    return f"{run.settings.load.nominal.value:g} N"


def _pair(estimate: Estimate) -> tuple[str, str]:
    """c and tan φ with their standard deviations."""
    c, c_sigma, tan_phi, tan_phi_sigma = _values(estimate)[:4]
    return f"{c:.0f} ± {c_sigma:.0f} Pa", f"{tan_phi:.4f} ± {tan_phi_sigma:.4f}"


def _values(estimate: Estimate) -> tuple[float, float, float, float, float, float, float]:
    """c ± σ [Pa], tan φ ± σ, k ± σ [m], correlation of c and tan φ."""
    x, P = estimate.x, estimate.soil_P
    sigma = [sqrt(max(P[i][i], 0.0)) for i in range(len(P))]
    k = exp(x[LN_K])

    product = sigma[C] * sigma[TAN_PHI]
    correlation = P[C][TAN_PHI] / product if product else 0.0

    return (
        x[C] * KPA,
        sigma[C] * KPA,
        x[TAN_PHI],
        sigma[TAN_PHI],
        k,
        k * sigma[LN_K],
        correlation,
    )


def _together(runs: Sequence[BedRun]) -> Iterator[str]:
    c, c_sigma, tan_phi, tan_sigma, k, k_sigma, correlation = _values(runs[-1].known.estimate)
    count = f"{len(runs)} runs together" if len(runs) > 1 else "one run"
    yield (
        f"{count}: c {c:.0f} ± {c_sigma:.0f} Pa, tan φ {tan_phi:.4f} ± {tan_sigma:.4f} "
        f"(correlation {correlation:+.2f}), k {k * 1e3:.1f} ± {k_sigma * 1e3:.1f} mm"
    )

    if len(runs) > 1:
        alone = [_values(run.alone.estimate) for run in runs if run.alone.believed]
        if not alone:
            return
        yield (
            f"σ of the best single run over σ of all: c {min(a[1] for a in alone) / c_sigma:.1f}, "
            f"tan φ {min(a[3] for a in alone) / tan_sigma:.1f}"
        )


def _stated(repeatability: Repeatability) -> str:
    if repeatability == Repeatability():
        return (
            "repeatability between preparations: none stated; the soil is taken as the same in "
            "all runs"
        )
    return (
        f"repeatability between preparations, σ: c {repeatability.cohesion:g} Pa, "
        f"tan φ {repeatability.tan_phi:g}, k {repeatability.shear_modulus:.2g}"
    )


def _strained(runs: Sequence[BedRun]) -> Iterator[str]:
    """The runs that do not fit those before them."""
    for run in runs[1:]:
        if run.surprise > UNUSUAL:
            yield (
                f"{_name(run)} does not fit the runs before it (χ² {run.surprise:.0f} of 3 degrees "
                "of freedom): another soil, or a larger repeatability than stated"
            )


# --- JSON ---


def _write(path: Path, runs: Sequence[BedRun], repeatability: Repeatability) -> None:
    """Raises CommandError."""
    content = {
        "repeatability": vars(repeatability),
        "runs": [_run_json(run) for run in runs],
        "believed": not doubted(runs).why,
        "reason": str(doubted(runs)),
        "together": _json(runs[-1].known),
    }
    with os_errors(path):
        path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _run_json(run: BedRun) -> dict[str, Any]:
    return {
        "file": str(run.recording.path),
        "load": run.settings.load.nominal.value,
        "used": run.counts,
        "reason": str(run.reason),
        "alone": _json(Known(run.alone.bank, 1)),
        "together": _json(run.known),
        "chi_square": run.surprise,
    }


def _json(known: Known) -> dict[str, Any]:
    """SI."""
    c, c_sigma, tan_phi, tan_sigma, k, k_sigma, correlation = _values(known.estimate)
    return {
        "c": {"value": c, "sigma": c_sigma},
        "tan_phi": {"value": tan_phi, "sigma": tan_sigma},
        "k": {"value": k, "sigma": k_sigma},
        "correlation": correlation,
        "runs": known.runs,
    }


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd estimate",
        description="The soil of a bed from several runs, handed from run to run by the filter.",
    )

    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="recordings of one bed, in their order"
    )
    add_configuration(parser, "for all runs, instead of the recorded configurations")
    parser.add_argument(
        "--repeatability",
        action="append",
        default=[],
        metavar="NAME=SIGMA",
        help="of preparations: c, tan_phi or k (relative); default: bed.repeatability",
    )
    parser.add_argument("--json", type=Path, metavar="OUT", help="the same in SI units")

    return parser
