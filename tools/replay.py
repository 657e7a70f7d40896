"""`gritd replay`: the on-line filter over recordings, to check them or to recompute them."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import isnan, sqrt
from pathlib import Path

import numpy as np

from estimator.config import Configuration, load, loads
from estimator.course import Course
from estimator.daemon import TICK_TOPIC, TOPICS
from estimator.pipeline import TickRecord
from estimator.playback import RecordedTick, played, settings_for, without_absent
from estimator.record import TICK_NAMES, Status
from estimator.recording import RecordingError, RunWriter, parts
from estimator.salvage import Recording, read
from estimator.settings import Settings
from tools.command import DAMAGED, DONE, FAILED, USAGE, CommandError, Parser
from tools.progress import Progress

INDEX = {name: place for place, name in enumerate(TICK_NAMES)}
SHOWN = 5  # differing fields named in full


def main(argv: Sequence[str]) -> int:
    """Exit 0; 1 if a verified replay differs; 2 for usage and configuration; 3 if a recording is damaged."""
    arguments = _parser().parse_args(argv)
    if arguments.verify and (arguments.config or arguments.output or arguments.engine):
        raise CommandError("--verify replays a recording as it was made: without --config, --engine, --output", USAGE)
    codes = [_replay(Path(name), arguments) for name in arguments.files]
    return max(codes)


def _replay(path: Path, arguments: Namespace) -> int:
    recordings = [_read(part) for part in parts(path)]
    for recording in recordings:
        for line in recording.damage or ([] if recording.closed else ["was not closed: replayed as far as it goes"]):
            print(f"{recording.path}: {line}", file=sys.stderr)
    damaged = any(recording.damage for recording in recordings)
    configuration = _configuration(recordings[0], arguments.config)
    if arguments.verify:
        return max(_verify(recordings, configuration), DAMAGED if damaged else DONE)
    _recompute(recordings, configuration, arguments)
    return DAMAGED if damaged else DONE


def _read(path: Path) -> Recording:
    try:
        return read(path)
    except RecordingError as error:
        raise CommandError(error, DAMAGED if path.exists() else USAGE) from None


def _configuration(recording: Recording, path: str | None) -> Configuration:
    """The given configuration, or the one the recording was made with."""
    if path is not None:
        return load(path)
    if recording.config_yaml is None:
        raise CommandError(f"{recording.path}: holds no configuration; give one with --config", USAGE)
    return loads(recording.config_yaml, f"{recording.path}: gritd.config")


# --- verification ---------------------------------------------------------------------------------------------------


def _verify(recordings: list[Recording], configuration: Configuration) -> int:
    """Recompute every tick and compare it, bit for bit, with the logged one."""
    first = recordings[0]
    if not first.counts["/tick"]:
        raise CommandError(f"{first.path}: holds no /tick to verify against", USAGE)
    if first.topics["/tick"].names != TICK_TOPIC.names:
        version = first.versions.get("gritd", "another version")
        raise CommandError(f"{first.path}: its /tick was written by gritd {version} and has other fields", USAGE)
    course = _course(recordings, configuration, None)
    if first.run.part:
        course.lose()
    differing = Differences()
    for recording, tick in _ticks(recordings, configuration, "verifying"):
        if recording.run.lost_before and recording is not differing.recording:
            course.lose()
        differing.recording = recording
        if tick.checkpoint is not None:
            differing.resumed(tick.stamp, course.resume(tick.checkpoint))
        record = course.step(tick)
        if tick.logged is not None and course.known:
            differing.compare(tick.logged, record)
        elif tick.logged is not None:
            differing.unknown += 1
    print(f"{first.path}: {differing.compared} ticks, {len(TICK_NAMES)} fields each: {differing}")
    if not differing.compared:
        raise CommandError(f"{first.path}: its first state is not known; verify from the run's first part", USAGE)
    return FAILED if differing.ticks else DONE


@dataclass
class Differences:
    """Fields of /tick that a replay did not reproduce."""

    ticks: int = 0
    compared: int = 0
    unknown: int = 0  # after a loss, before the next checkpoint
    recording: Recording | None = None  # the last part looked at
    lines: list[str] = field(default_factory=list)

    def resumed(self, stamp: int, same: bool) -> None:
        """A checkpoint was met from the ticks before it."""
        if not same:
            self.ticks += 1
            self.lines.append(f"checkpoint before the tick at {stamp}: not the state that the ticks before it lead to")

    def compare(self, logged: TickRecord, computed: TickRecord) -> None:
        self.compared += 1
        encode = TICK_TOPIC.codec.encode
        if encode(logged) == encode(computed):
            return
        self.ticks += 1
        for name, was, now in zip(TICK_NAMES, logged, computed, strict=True):
            if repr(was) != repr(now) and float(was) != float(now) and len(self.lines) < SHOWN:
                self.lines.append(f"tick {self.compared}: {name}: logged {was!r}, replayed {now!r}")

    def __str__(self) -> str:
        if not self.ticks:
            after = f"; {self.unknown} more after lost messages not comparable" if self.unknown else ""
            return f"identical bit for bit{after}"
        return "\n  ".join([f"{self.ticks} ticks differ", *self.lines])


# --- recomputation --------------------------------------------------------------------------------------------------


def _recompute(recordings: list[Recording], configuration: Configuration, arguments: Namespace) -> None:
    first = recordings[0]
    writer = None
    if arguments.output:
        writer = RunWriter(_target(arguments), TOPICS, configuration.text, first.run)
    records = []
    course = _course(recordings, configuration, arguments.engine)
    for _, tick in _ticks(recordings, configuration, "replaying"):
        if tick.checkpoint is not None and not arguments.config:
            course.reconfigure(tick.checkpoint)
        record = course.step(tick)
        records.append(record)
        if writer is not None:
            for reading in tick.readings:
                writer.reading(reading)
            writer.message(TICK_TOPIC.name, tick.stamp, record)
    if writer is not None:
        writer.close()
        print(f"wrote {writer.path}")
    if not records:
        raise CommandError(f"{first.path}: holds no readings", DAMAGED)
    print(report(first.path, np.array(records, dtype=float)))


def _target(arguments: Namespace) -> Path:
    """The output file; a folder where there are several recordings."""
    output = Path(arguments.output)
    if len(arguments.files) > 1 and not output.is_dir():
        raise CommandError(f"{output}: several recordings need a folder to be written to", USAGE)
    return output / Path(arguments.files[0]).name if output.is_dir() else output


def _course(recordings: list[Recording], configuration: Configuration, engine: str | None) -> Course:
    first = recordings[0]
    settings = _settings(first, configuration)
    if settings.wrench is None and configuration.settings.wrench is not None:
        print(f"{first.path}: no /raw/wrench: replayed with the configured load", file=sys.stderr)
    return Course(configuration, lambda given: _settings(first, given), engine)


def _settings(first: Recording, configuration: Configuration) -> Settings:
    return settings_for(without_absent(configuration.settings, first), first.run)


def _ticks(
    recordings: list[Recording], configuration: Configuration, what: str
) -> Iterator[tuple[Recording, RecordedTick]]:
    """Every tick of a run, its parts one after the other."""
    total = sum(recording.counts["/tick"] for recording in recordings)
    with Progress(f"{what} {recordings[0].path.name}", total) as progress:
        for recording in recordings:
            for tick in played(recording, configuration.settings.rates.tick):
                progress.advance()
                yield recording, tick


def report(path: Path, ticks: np.ndarray) -> str:
    """What the filter made of a recording; ticks (n, fields) in the order of TICK_NAMES."""
    last = dict(zip(TICK_NAMES, ticks[-1].tolist(), strict=True))
    seconds = (ticks[-1, 0] - ticks[0, 0]) * 1e-9
    return "\n".join(
        [
            f"{path}: {seconds:.1f} s, {len(ticks)} ticks, {int(last['updates'])} filter updates, "
            f"{int(last['resets'])} resets",
            f"  status     {_statuses(ticks)}",
            f"  c          {last['cohesion']:.0f} ± {last['cohesion_sigma']:.0f} Pa",
            f"  tan φ      {last['tan_phi']:.4f} ± {last['tan_phi_sigma']:.4f}   correlation with c "
            f"{_correlation(last):+.3f}; weakest direction {last['separability']:.0%} of the prior's σ",
            f"  k          {last['shear_modulus'] * 1e3:.1f} ± {last['shear_modulus_sigma'] * 1e3:.1f} mm",
            *_side_by_side(ticks),
            f"  innovations squared over their variance, last 2 s: {last['consistency']:.2f} (1 when honest)",
        ]
    )


def _statuses(ticks: np.ndarray) -> str:
    values, counts = np.unique(ticks[:, INDEX["status"]], return_counts=True)
    shares = sorted(zip(counts.tolist(), values.tolist(), strict=True), reverse=True)
    return ", ".join(f"{Status(int(value)).name} {count / len(ticks):.0%}" for count, value in shares)


def _correlation(tick: dict[str, float]) -> float:
    product = tick["cohesion_sigma"] * tick["tan_phi_sigma"]
    return tick["cov_c_tan_phi"] / product if product else 0.0


def _side_by_side(ticks: np.ndarray) -> Iterator[str]:
    """Measured and predicted torque, drawbar pull and load while tracking."""
    tracking = ticks[ticks[:, INDEX["status"]] == Status.TRACKING]
    for name, unit in (("torque", "N·m"), ("drawbar_pull", "N"), ("load", "N")):
        measured, predicted = tracking[:, INDEX[name]], tracking[:, INDEX[f"{name}_predicted"]]
        if not len(tracking) or isnan(measured.mean()):
            continue
        difference = sqrt(np.mean((measured - predicted) ** 2))
        sigma = tracking[:, INDEX[f"{name}_predicted_sigma"]].mean()
        yield (
            f"  {name.replace('_', ' '):13}measured {measured.mean():7.3f} {unit}, predicted {predicted.mean():7.3f} "
            f"± {sigma:.3f}, rms difference {difference:.3f}"
        )


def _parser() -> Parser:
    parser = Parser(prog="gritd replay", description="Run the on-line filter over recordings.")
    parser.add_argument("files", nargs="+", metavar="FILE", help="recordings (.mcap); parts of a run are found")
    parser.add_argument("--config", metavar="F", help="recompute with this configuration instead of the recorded one")
    parser.add_argument("--verify", action="store_true", help="compare every field of every /tick, bit for bit")
    parser.add_argument("--engine", choices=("filterpy", "plain"), help="instead of the configured filter engine")
    parser.add_argument("-o", "--output", metavar="OUT", help="write readings and recomputed ticks to a recording")
    return parser
