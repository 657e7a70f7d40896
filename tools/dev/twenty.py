"""Twenty campaigns whose diagnoses must be the same, byte for byte, before and after a change.

    python tools/dev/twenty.py make FOLDER --gritd PATH/TO/gritd [--real DIR]
    python tools/dev/twenty.py diagnose FOLDER OUT --gritd PATH/TO/gritd [--jobs 2] [--only NAME …]
    python tools/dev/twenty.py compare A B

Fifteen campaigns are simulated, five are imported from other laboratories' recordings in DIR. Make
them once, with the version before the change, and diagnose them with both versions. Nothing of the
project is imported: `gritd` is an executable here, so the layout of its code does not matter.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TIMES = "times.json"
KEPT = ("PATH", "HOME", "LANG", "LC_ALL", "TMPDIR")  # of the environment
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUTF8": "1"}
SHOWN = 3  # keys that differ, of each campaign

Edits = tuple[tuple[str, str], ...]

# --- what is simulated ---

# All sensors on one serial port, so that no path of a CAN database comes into a recording.
TESTBED = """\
testbed: twenty

wheel: {radius: 72 mm, width: 71 mm, c1: 0.5, c2: 0.0}
pulley_radius: 20 mm

soil:
  cohesion: {value: 1.0 kPa, sigma: 300 Pa}
  tan_phi: {value: 0.577, sigma: 0.06}
  shear_modulus: {value: 25 mm, sigma: 2.5 mm}
  exponent: {value: 1.1, sigma: 0.03}
  k_c: 0.9 kN/m^(n+1)
  k_phi: 1523.4 kN/m^(n+2)
  modulus_sigma: 5 %

drive:
  torque_constant: {value: 2.0 N*m/A, sigma: 0.01 N*m/A}
  torque_source: motor_shunt

load: {nominal: {value: 70 N, sigma: 0.5 N}, minimum: 5 N}

devices:
  board: {kind: serial, port: recorded}

channels:
  wheel_encoder:
    device: board
    signal: wheel_encoder
    scale: 0.0958738 mrad/count
    noise: 0.3 count
  carriage_encoder:
    device: board
    signal: carriage_encoder
    scale: 0.7669904 mrad/count
    noise: 0.3 count
  sinkage_pot:
    device: board
    signal: pot
    scale: {value: 25 mm/V, sigma: 0.05 mm/V}
    offset: {value: -12.5 mm, sigma: 0.1 mm}
    noise: 2 mV
    range: [0.1 V, 4.9 V]
  motor_shunt:
    device: board
    signal: shunt
    scale: {value: 2.0 A/V, sigma: 0.005 A/V}
    offset: {value: -5.0 A, sigma: 2 mA}
    noise: 2 mV
    range: [0.1 V, 4.9 V]
"""
WRENCH = """\
  wrench:
    device: board
    signal: wrench
    load: {scale: {value: 1.0, sigma: 0.002}, offset: {value: 0 N, sigma: 0.1 N}}
    drawbar_pull: {scale: {value: 1.0, sigma: 0.002}, offset: {value: 0 N, sigma: 0.1 N}}
    torque: {scale: {value: 1.0, sigma: 0.002}, offset: {value: 0 N*m, sigma: 5 mN*m}}
    force_noise: 0.3 N
    torque_noise: 20 mN*m
    max_force: 500 N
    max_torque: 50 N*m
"""
EFFECTS = "effects: {stress_linearisation: {share: 1.0}}\n"

PRIOR = {  # mean and standard deviation, SI, from which the true soil is drawn
    "cohesion": (1000.0, 300.0),
    "tan_phi": (0.577, 0.04),
    "shear_modulus": (0.025, 0.0025),
    "exponent": (1.1, 0.02),
    "modulus_factor": (1.0, 0.05),
}


@dataclass(frozen=True)
class Held:
    """One condition that is held: slip, rim speed [mm/s], load [N] if not the run's, time [s]."""

    slip: float
    speed: float = 20.0
    load: float | None = None
    seconds: float = 5.0


@dataclass(frozen=True)
class Run:
    """A run at one load [N], and what is true in it beyond what is true in the campaign."""

    load: float
    held: tuple[Held, ...]
    effects: tuple[str, ...] = ()

    @property
    def schedule(self) -> str:
        """For `gritd simulate`, with a rest before and after."""
        rest = Held(self.held[0].slip, 0.0, self.held[0].load, 2.0)
        lines = (self._segment(held) for held in (rest, *self.held, rest))
        return "\n".join(["ramp: 500 ms", "segments:", *lines, ""])

    def _segment(self, held: Held) -> str:
        load = self.load if held.load is None else held.load
        parts = f"duration: {held.seconds:g} s, load: {load:g} N, slip: {held.slip:g}"
        return f"  - {{{parts}, speed: {held.speed:g} mm/s}}"


@dataclass(frozen=True)
class Simulated:
    """A campaign: runs, effects that the diagnosis is not told of, and edits of two configurations.

    world: that of the testbed as it is; told: the one that is handed to the diagnosis.
    """

    name: str
    runs: tuple[Run, ...]
    effects: tuple[str, ...] = ()
    world: Edits = ()
    told: Edits = ()
    wrench: bool = True
    linearised: bool = True


SWEPT = (Held(0.1), Held(0.3), Held(0.5, 30.0))
FINE = (Held(0.1), Held(0.25), Held(0.4), Held(0.55), Held(0.2, 40.0))
LONG = (Held(0.2, seconds=12.0), Held(0.4, seconds=12.0), Held(0.2, 30.0, seconds=8.0))
STEADY = (Held(0.25, seconds=18.0),)
LIFTED = Held(0.1, load=0.0, seconds=4.0)
MIXED = tuple(Held(slip, load=load) for load in (40.0, 70.0, 100.0) for slip in (0.15, 0.45))
BOTH_WAYS = (*SWEPT, Held(0.3, -20.0))
CREEPING = (Held(0.2, 8.0, seconds=6.0),)

TWO = (Run(40.0, SWEPT), Run(80.0, SWEPT))
THREE = (Run(40.0, SWEPT), Run(70.0, SWEPT), Run(100.0, SWEPT))
BETWEEN = (
    Run(50.0, FINE),
    Run(90.0, FINE, ("coulomb_friction.loss=0.3",)),
    Run(70.0, FINE, ("force_crosstalk.from_load=0.03",)),
)
REPLICATES = tuple(
    Run(60.0, STEADY, (f"sinkage_datum.offset={offset}",)) for offset in (4e-4, -5e-4, 1e-4)
)
UNLISTED = (
    "empirical_law.pull_slip_squared=-8",
    "empirical_law.torque_speed=0.3",
    "empirical_law.depth_speed=-0.0006",
)

NOISY_VOLTS: Edits = (("noise: 2 mV", "noise: 6 mV"),)
NOISIER: Edits = (
    *NOISY_VOLTS,
    ("force_noise: 0.3 N", "force_noise: 1.5 N"),
    ("torque_noise: 20 mN*m", "torque_noise: 80 mN*m"),
)
WIDE: Edits = (("sigma: 300 Pa", "sigma: 900 Pa"), ("modulus_sigma: 5 %", "modulus_sigma: 40 %"))

SIMULATED = (
    Simulated("nothing", THREE),
    Simulated("nothing-noisy", TWO, world=NOISIER),
    Simulated("drivetrain-loss", TWO, ("coulomb_friction.loss=0.4",)),
    Simulated(
        "gear-ripple",
        TWO,
        ("gear_ripple.ripple_cos=0.08", "gear_ripple.ripple_sin=0.05", "gear_ripple.order=23"),
    ),
    Simulated("slip-sinkage", THREE, ("slip_sinkage.growth=0.15",)),
    Simulated(
        "soil-patch",
        (Run(50.0, FINE), Run(90.0, FINE)),
        ("soil_patch.cohesion_change=0.6", "soil_patch.centre=0.2", "soil_patch.length=0.12"),
    ),
    Simulated("sinkage-datum", TWO, ("sinkage_datum.offset=0.003",)),
    Simulated("bed-slope", THREE, ("bed_slope.angle=0.03",)),
    Simulated(
        "motor-heating-no-wrench",
        (Run(60.0, LONG), Run(100.0, LONG)),
        ("motor_heating.fall=0.08", "motor_heating.duration=20"),
        wrench=False,
    ),
    Simulated("rear-contact-unlinearised", THREE, ("rear_contact.ratio=0.3",), linearised=False),
    Simulated(
        "two-effects-both-ways",
        (Run(40.0, BOTH_WAYS), Run(80.0, BOTH_WAYS)),
        ("coulomb_friction.loss=0.3", "slip_sinkage.growth=0.2"),
    ),
    Simulated(
        "single-run-load-unstated", (Run(70.0, (*MIXED, LIFTED)),), ("pulley_slip.share=0.05",)
    ),
    Simulated("single-load", (Run(70.0, CREEPING),), world=NOISY_VOLTS, told=WIDE, wrench=False),
    Simulated("replicates-unlisted", (*REPLICATES, Run(90.0, SWEPT)), UNLISTED),
    Simulated("between-runs", BETWEEN),
)

# --- what is imported ---


@dataclass(frozen=True)
class Real:
    """A campaign of another laboratory: importer, its files and arguments, what of it is kept."""

    name: str
    importer: str
    files: tuple[str, ...]
    recordings: str
    configuration: str
    arguments: tuple[str, ...] = ()


MGST = ("--begin", "3", "--conceal", "lateral_force")
CMU = (
    "cmu/smooth_all_trials_steady_state.csv",
    "cmu/grouser_first_trial_steady_state.csv",
    "cmu/penetration",
)

REAL = (
    Real("emps", "emps", ("emps",), "data-emps.mcap", "emps.yaml"),
    Real("ding", "table", ("ding",), "ding2011_smooth.mcap", "ding2011_smooth.yaml"),
    Real(
        "mgst-drivetrain", "mgst", ("mgst",), "*.mcap", "mgst.yaml", (*MGST, "--conceal", "torque")
    ),
    Real(
        "mgst-side-wall", "mgst", ("mgst",), "*.mcap", "mgst.yaml", (*MGST, "--drawbar-pull", "raw")
    ),
    Real("cmu-smooth", "cmu", CMU, "smooth-table/*.mcap", "cmu.yaml"),
)

# --- make ---


def make(folder: Path, gritd: Path, real: Path | None) -> int:
    """Every campaign in a folder of its own: its recordings and one configuration."""
    for number, simulated in enumerate(SIMULATED, start=1):
        _simulate(_new(folder / simulated.name), simulated, number, gritd)
        print(f"{simulated.name}: {len(simulated.runs)} simulated runs", flush=True)

    for imported in REAL if real else ():
        assert real is not None
        count = _import(_new(folder / imported.name), imported, real, gritd)
        print(f"{imported.name}: {count} imported runs", flush=True)
    return 0


def _new(folder: Path) -> Path:
    if folder.exists():
        raise SystemExit(f"{folder}: found a campaign; expected none, so that none is half of two")
    folder.mkdir(parents=True)
    return folder


def _simulate(folder: Path, campaign: Simulated, number: int, gritd: Path) -> None:
    """The world's configuration, schedules and truth go to a folder that no diagnosis reads."""
    truth = folder / "truth"
    truth.mkdir()
    world = truth / "world.yaml"
    world.write_text(_configuration(campaign, campaign.world), encoding="utf-8")
    told = _configuration(campaign, campaign.told)
    (folder / "testbed.yaml").write_text(told, encoding="utf-8")

    soil = _soil(number)
    for n, run in enumerate(campaign.runs, start=1):
        schedule, recording = truth / f"run-{n}.schedule.yaml", truth / f"run-{n}.mcap"
        schedule.write_text(run.schedule, encoding="utf-8")
        acting = [a for effect in (*campaign.effects, *run.effects) for a in ("--effect", effect)]
        seed = ["--seed", str(100 * number + n)]
        where = ["--config", world.name, "--schedule", schedule.name, "-o", recording.name]
        _call([str(gritd), "simulate", *where, *soil, *acting, *seed], truth)
        recording.rename(folder / recording.name)


def _configuration(campaign: Simulated, edits: Edits) -> str:
    text = TESTBED + WRENCH * campaign.wrench + EFFECTS * campaign.linearised
    for old, new in edits:
        if old not in text:
            raise SystemExit(f"{campaign.name}: found no '{old}' to edit")
        text = text.replace(old, new)
    return text


def _soil(number: int) -> list[str]:
    """Arguments of a soil off what is configured, of its own in each campaign."""
    drawn = random.Random(number)
    values = {name: mean + sigma * drawn.gauss(0.0, 1.0) for name, (mean, sigma) in PRIOR.items()}
    return [a for name, value in values.items() for a in ("--soil", f"{name}={value:.6g}")]


def _import(folder: Path, campaign: Real, real: Path, gritd: Path) -> int:
    """How many recordings there are."""
    imported = folder / "imported"
    files = [str(real.resolve() / file) for file in campaign.files]
    command = [str(gritd), "import", campaign.importer, *files, "-o", imported.name]
    _call([*command, *campaign.arguments], folder)

    recordings = sorted(imported.glob(campaign.recordings))
    for path in (*recordings, imported / campaign.configuration):
        path.rename(folder / path.name)
    shutil.rmtree(imported)
    return len(recordings)


def _call(command: Sequence[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, env=_environment(), capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: exit {done.returncode}: {done.stderr.strip()}")


def _environment() -> dict[str, str]:
    """Ours without what could matter, and one thread a process."""
    return {name: os.environ[name] for name in KEPT if name in os.environ} | ONE_THREAD


# --- diagnose ---


@dataclass(frozen=True)
class Spent:
    """What a diagnosis took [s], and its exit code."""

    wall_s: float
    cpu_s: float
    exit: int


def diagnose(folder: Path, out: Path, gritd: Path, jobs: int, only: Sequence[str]) -> int:
    """OUT/NAME.json and what was printed, OUT/NAME.txt. 1 if one could not be diagnosed."""
    campaigns = [f for f in sorted(folder.iterdir()) if f.is_dir() and (not only or f.name in only)]
    if missing := set(only) - {f.name for f in campaigns}:
        raise SystemExit(f"{folder}: found no campaign {', '.join(sorted(missing))}")
    out.mkdir(parents=True, exist_ok=True)

    # Threads only wait here: each diagnosis is a process of its own.
    with ThreadPoolExecutor(jobs) as pool:
        spent = list(pool.map(lambda f: _diagnosed(f, out.resolve(), gritd), campaigns))

    _write_times(out / TIMES, {f.name: vars(s) for f, s in zip(campaigns, spent, strict=True)})
    for campaign, took in zip(campaigns, spent, strict=True):
        print(_row(out / f"{campaign.name}.json", took))
    print(f"{len(spent)} campaigns, {sum(s.cpu_s for s in spent):.0f} s of processor time")
    return int(any(s.exit for s in spent))


def _diagnosed(campaign: Path, out: Path, gritd: Path) -> Spent:
    """One diagnosis, in the campaign's folder: its JSON holds the paths as they were given."""
    files = [path.name for path in sorted(campaign.glob("*.mcap"))]
    (configuration,) = campaign.glob("*.yaml")
    result = out / f"{campaign.name}.json"
    result.unlink(missing_ok=True)
    settled = ["--config", configuration.name, "--seed", "0", "--jobs", "1"]
    command = [str(gritd), "diagnose", *files, *settled, "--json", str(result)]

    began = time.monotonic()
    with (out / f"{campaign.name}.txt").open("wb") as printed:
        process = subprocess.Popen(
            command, cwd=campaign, env=_environment(), stdout=printed, stderr=subprocess.STDOUT
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.monotonic() - began
    return Spent(round(wall, 2), round(used.ru_utime + used.ru_stime, 2), process.returncode)


def _write_times(path: Path, times: Mapping[str, Any]) -> None:
    """Beside those of campaigns that were not diagnosed this time."""
    before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    text = json.dumps({**before, **times}, indent=1, sort_keys=True)
    path.write_text(text + "\n", encoding="utf-8")


def _row(result: Path, took: Spent) -> str:
    """Name, verdict, what was accepted (else what is most probable), seconds."""
    head = f"{result.stem:26} {took.wall_s:6.1f} s  "
    if not result.exists():
        return f"{head}exit {took.exit}, no result"
    diagnosis = json.loads(result.read_text(encoding="utf-8"))
    first = [h for h in diagnosis["hypotheses"] if h["accepted"]] or diagnosis["hypotheses"][:2]
    names = ", ".join(f"{h['effect']} {h['probability']:.2f}" for h in first)
    return f"{head}{diagnosis['verdict']:13} {names}"


# --- compare ---


def compare(one: Path, other: Path) -> int:
    """1 if a result or what was printed differs, other than in the version that is stated."""
    names = sorted({p.stem for f in (one, other) for p in f.glob("*.json") if p.name != TIMES})
    if not names:
        raise SystemExit(f"{one}, {other}: found no results; expected those of `diagnose`")
    differences = {name: _compared(name, one, other) for name in names}
    for name, differs in differences.items():
        print(f"{name:26} {differs or 'identical'}")

    count = sum(not _matters(differs) for differs in differences.values())
    print(f"{count} of {len(names)} the same")
    return int(count < len(names))


VERSION_ONLY = "the same but for "


def _matters(differs: str) -> bool:
    return bool(differs) and not differs.startswith(VERSION_ONLY)


def _compared(name: str, one: Path, other: Path) -> str:
    """What differs, empty if nothing does."""
    results, texts = ([f / f"{name}{end}" for f in (one, other)] for end in (".json", ".txt"))
    if absent := [str(path) for path in (*results, *texts) if not path.exists()]:
        return f"missing: {', '.join(absent)}"
    a, b = (path.read_bytes() for path in results)
    differs = "" if a == b else _differing(json.loads(a), json.loads(b))
    if not _matters(differs) and texts[0].read_bytes() != texts[1].read_bytes():
        return "what was printed differs"
    return differs


def _differing(a: dict[str, Any], b: dict[str, Any]) -> str:
    """The first keys that differ; a release has another version in it, which is no difference."""
    keys = [f"{key}: {x!s:.40} | {y!s:.40}" for key, x, y in _leaves(a, b)]
    listed = "; ".join(keys[:SHOWN])
    versions = [{**d["redo"]["versions"], "gritd": ""} for d in (a, b)]
    same = [
        {**d, "redo": {**d["redo"], "versions": v}} for d, v in zip((a, b), versions, strict=True)
    ]
    if json.dumps(same[0]) == json.dumps(same[1]):
        return VERSION_ONLY + listed
    return f"{len(keys)} values differ: {listed}" if keys else "order or layout differs"


def _leaves(a: Any, b: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Key and both values, wherever they differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        for name in dict.fromkeys((*a, *b)):
            yield from _leaves(a.get(name), b.get(name), f"{key}.{name}" if key else name)
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for n, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from _leaves(x, y, f"{key}[{n}]")
    elif repr(a) != repr(b):
        yield key, a, b


# --- command ---


def main(argv: Sequence[str]) -> int:
    """Exit 1 where a diagnosis failed or differs."""
    given = _parser().parse_args(argv)
    if given.command == "compare":
        return compare(given.one, given.other)
    gritd = given.gritd.absolute()
    if given.command == "make":
        return make(given.folder, gritd, given.real)
    return diagnose(given.folder, given.out, gritd, given.jobs, given.only)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Twenty campaigns that must be diagnosed alike.")
    commands = parser.add_subparsers(dest="command", required=True)

    making = commands.add_parser("make", help="simulate and import the campaigns")
    making.add_argument("folder", type=Path)
    making.add_argument("--real", type=Path, metavar="DIR", help="other laboratories' files")

    diagnosing = commands.add_parser("diagnose", help="diagnose every campaign of a folder")
    diagnosing.add_argument("folder", type=Path)
    diagnosing.add_argument("out", type=Path)
    diagnosing.add_argument("--jobs", type=int, default=2, help="campaigns at once")
    diagnosing.add_argument("--only", nargs="+", default=[], metavar="NAME")
    for command in (making, diagnosing):
        command.add_argument("--gritd", type=Path, required=True, help="the executable")

    comparing = commands.add_parser("compare", help="the results of two versions")
    comparing.add_argument("one", type=Path)
    comparing.add_argument("other", type=Path)
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
