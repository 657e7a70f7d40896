"""`gritd example DIR`: a small campaign of the simulated testbed, to try the other commands on."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.effects.base import Effect
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.tools.cli.command import DONE, Parser
from gritd.tools.cli.files import unwritten, vacant
from gritd.tools.cli.progress import Progress
from gritd.tools.commands.init import write as write_files
from gritd.tools.commands.simulate import acting_effects
from gritd.tools.testbed import run_files
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import simulate_run, soil_of

LOADS = (40.0, 70.0, 100.0)  # [N], one a run
DRIVEN = (  # slip, speed of the rim [m/s]; two speeds tell frictions of the drive apart
    (0.10, 0.02),
    (0.25, 0.02),
    (0.40, 0.02),
    (0.60, 0.02),
    (0.25, 0.06),
)
REST, STEADY = 2.0, 4.0  # [s]
SOIL = {"cohesion": 1200.0, "tan_phi": 0.55}  # [Pa], [-]: not what testbed.yaml states
NOTES = "gritd example: simulated"


def main(argv: Sequence[str]) -> int:
    """Write configuration and recordings. Raises CommandError, also where a file is there."""
    arguments = build_parser().parse_args(argv)
    folder: Path = arguments.folder
    acting = acting_effects(config.load(packaged()).settings, arguments.effect)

    names = ("testbed.yaml", "testbed.dbc")
    write_files(folder, {name: packaged(name).read_bytes() for name in names})
    configuration = config.load(folder / names[0])
    paths = [vacant(folder / f"run-{load:03.0f}N.mcap") for load in LOADS]

    with Progress("simulating runs", len(LOADS)) as progress:
        for seed, path in enumerate(paths):
            _write_run(path, configuration, LOADS[seed], acting, seed)
            progress.advance()

    print("\n".join(_summary(folder, arguments.effect)))
    return DONE


def _write_run(
    path: Path, configuration: Configuration, load: float, acting: Sequence[Effect], seed: int
) -> None:
    settings = configuration.settings

    rest = Segment(REST, load, DRIVEN[0][0], speed=0.0)
    steady = (Segment(STEADY, load, slip, speed) for slip, speed in DRIVEN)
    motion = motion_of(Schedule((rest, *steady), 0.5), settings.wheel.radius, settings.rates.tick)

    run = simulate_run(settings, soil_of(settings, SOIL), motion, acting, seed)
    info = RunInfo(name=path.stem, nominal_load=load, notes=NOTES)
    try:
        run_files.write(path, configuration, info, run)
    except RecordingError as error:
        raise unwritten(error) from None


def _summary(folder: Path, effects: Sequence[str]) -> Iterator[str]:
    loads = ", ".join(f"{load:.0f}" for load in LOADS)
    yield f"{folder}: testbed.yaml, and a run under each of {loads} N"

    c, tan_phi = SOIL["cohesion"], SOIL["tan_phi"]
    yield f"the true soil, which testbed.yaml does not state: c {c:.0f} Pa, tan φ {tan_phi:g}"
    if effects:
        yield f"nor does it state {', '.join(effects)}"
        yield f"next: gritd diagnose {folder}/run-*.mcap --config {folder}/testbed.yaml"
    else:
        yield f"next: gritd estimate {folder}/run-*.mcap"


def build_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="gritd example",
        description="Write a small campaign of the simulated testbed: a configuration, and a run "
        "under each of three loads on one soil. The seeds are fixed, so it is always the same.",
    )
    parser.add_argument(
        "folder", type=Path, metavar="DIR", help="made where it is missing; no file is replaced"
    )
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="NAME.PARAMETER=VALUE",
        help="physics that acts in the runs and is not stated: see gritd effects",
    )

    return parser
