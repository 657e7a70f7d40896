"""`gritd info FILE…`: what a recording is and holds: run, channels, rates, gaps, configuration,
health.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gritd.estimator.config.configuration import ConfigError, loads
from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.plausibility.mistakes import OF_A_RECORDING
from gritd.estimator.plausibility.recorded import driven_recording
from gritd.estimator.plausibility.words import sentences
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.salvage import Recording
from gritd.tools.cli import files
from gritd.tools.cli.command import DAMAGED, DONE, Parser
from gritd.tools.cli.progress import Progress
from gritd.tools.commands.demo_targets import punctuality
from gritd.tools.commands.replay_report import report
from gritd.tools.commands.replay_verify import lost_of
from gritd.tools.commands.rig_reach import reach
from gritd.tools.recordings.summary import RunSummary, summary

INDENT = " " * 15


def main(argv: Sequence[str]) -> int:
    """Exit 0; 3 where a recording is damaged. Raises CommandError."""
    given = build_parser().parse_args(argv).files

    damaged = False
    with Progress("reading", len(given)) as progress:
        for path in given:
            progress.at(path.name)
            recordings = [files.recording(part) for part in parts(path)]
            progress.advance()
            print("\n".join(in_lines(recordings)), end="\n\n" if len(given) > 1 else "\n")
            damaged |= any(recording.damage for recording in recordings)
    return DAMAGED if damaged else DONE


def in_lines(recordings: Sequence[Recording]) -> Iterator[str]:
    """A run over all its parts, in lines."""
    first, of_run = recordings[0], summary(recordings)
    size = sum(recording.path.stat().st_size for recording in recordings)

    yield (
        f"{first.path}: {_clock(of_run)}, {of_run.duration:.1f} s, "
        f"{sum(topic.messages for topic in of_run.topics)} messages, {size / 1e6:.1f} MB"
        + (f", {len(recordings)} parts" if len(recordings) > 1 else "")
    )

    yield from _run(first)
    yield from _configuration(first)
    yield ""
    yield from _topics(of_run)
    yield ""
    yield from _driven(first)
    yield from _condition(recordings)
    yield from _filter(first)


def _clock(of_run: RunSummary) -> str:
    """When the run began, as a date."""
    if not of_run.topics:
        return "no messages"
    if of_run.start <= 0:
        return "no date"
    return time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(of_run.start / 1e9))


def _run(recording: Recording) -> Iterator[str]:
    """What the run was said to be."""
    run = recording.run
    load = "load not stated" if run.nominal_load is None else f"load {run.nominal_load:g} N"
    yield (
        f"run            {run.name or 'unnamed'}, {load}, pass {run.pass_number}, "
        f"start {run.start_position:g} m"
    )

    if run.operator:
        yield f"operator       {run.operator}"
    if run.notes:
        yield f"notes          {run.notes}"
    if made := ", ".join(f"{name} {text}" for name, text in recording.versions.items()):
        yield f"made with      {made}"


def _configuration(recording: Recording) -> Iterator[str]:
    """The testbed that the recording was made with."""
    if recording.config_yaml is None:
        yield "configuration  none in the recording"
        return
    try:
        settings = loads(recording.config_yaml, str(recording.path)).settings
    except ConfigError as error:
        yield f"configuration  cannot be read: {error}"
        return
    yield from _testbed(settings)


def _testbed(settings: Settings) -> Iterator[str]:
    soil, wheel = settings.soil, settings.wheel
    effects = ", ".join(effect.name for effect in settings.effects) or "none"
    yield (
        f"configuration  {settings.testbed}: wheel r {wheel.radius * 1e3:g} mm, "
        f"b {wheel.width * 1e3:g} mm; effects: {effects}"
    )

    yield (
        f"{INDENT}prior: c {soil.cohesion.value:g} ± {soil.cohesion.sigma:g} Pa, "
        f"tan φ {soil.tan_phi.value:.4g} ± {soil.tan_phi.sigma:.2g}, "
        f"k {soil.shear_modulus.value * 1e3:g} ± {soil.shear_modulus.sigma * 1e3:g} mm"
    )
    yield f"{INDENT}{reach(settings)}"


def _driven(first: Recording) -> Iterator[str]:
    """What was driven in the first part, and what of it cannot be."""
    if first.config_yaml is None or not first.counts["/raw/wheel_encoder"]:
        return
    try:
        settings = loads(first.config_yaml, str(first.path)).settings
        given = [driven_recording(first, settings)]
    except (ConfigError, RecordingError):  # reported elsewhere
        return
    yield from sentences(given, OF_A_RECORDING)
    yield ""


def _topics(of_run: RunSummary) -> Iterator[str]:
    """Rate and gaps of every topic; a gap is more than five usual distances of two messages."""
    yield f"{'topic':24}{'messages':>10}{'rate':>12}{'gaps':>6}   longest"
    for topic in of_run.topics:
        rate = f"{topic.rate:.4g} Hz" if topic.rate else "–"
        longest = f"{topic.longest * 1e3:.0f} ms from {topic.at:.1f} s" if topic.rate else ""
        yield (
            f"{topic.topic:24}{topic.messages:>10}{rate:>12}{topic.gaps:>6}   {longest}".rstrip()
        )


def _condition(recordings: Sequence[Recording]) -> Iterator[str]:
    """Whether the files are whole."""
    for recording in recordings:
        lost, lines = lost_of(recording), [*recording.damage]

        if not recording.closed:
            lines.append("not closed; `gritd recover` makes a closed one of it")
        if lost and not any("missing" in line for line in lines):
            lines.append(f"{lost} messages are missing, as `gritd recover` noted")
        if recording.run.lost_before:
            lines.append(f"{recording.run.lost_before} messages are missing before this part")

        for line in lines:
            yield f"{'damage':15}{recording.path.name}: {line}"
        if not lines:
            yield f"{'file':15}{recording.path.name}: closed and whole"


def _filter(first: Recording) -> Iterator[str]:
    """What the daemon's filter said, where the recording holds its ticks."""
    if not first.counts["/tick"] or first.topics["/tick"].names != TICK_NAMES:
        yield "filter         no /tick of this version in the recording: `gritd replay` makes them"
        return
    yield ""
    yield report(Path("logged"), first.arrays("/tick"), "ticks")
    if first.counts["/loop"] > 1:
        yield from (f"  {line}" for line in punctuality(np.asarray(first.arrays("/loop"))))


def build_parser() -> Parser:
    parser = Parser(prog="gritd info", description="What recordings are and hold.")
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="recordings (.mcap); parts of a run are found",
    )

    return parser
