"""The twenty campaigns: fifteen that are simulated, five that are imported."""

from __future__ import annotations

from dataclasses import dataclass

Edits = tuple[tuple[str, str], ...]

# ---- what is simulated ----

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
class HeldInRun:
    """One condition that is held: slip, rim speed [mm/s], load [N] if not the run's, time [s]."""

    slip: float
    speed: float = 20.0
    load: float | None = None
    seconds: float = 5.0


@dataclass(frozen=True)
class PlannedRun:
    """A run at one load [N], and what is true in it beyond what is true in the campaign."""

    load: float
    held: tuple[HeldInRun, ...]
    effects: tuple[str, ...] = ()

    @property
    def schedule(self) -> str:
        """For `gritd simulate`, with a rest before and after."""
        rest = HeldInRun(self.held[0].slip, 0.0, self.held[0].load, 2.0)
        lines = (self._segment(held) for held in (rest, *self.held, rest))
        return "\n".join(["ramp: 500 ms", "segments:", *lines, ""])

    def _segment(self, held: HeldInRun) -> str:
        load = self.load if held.load is None else held.load
        parts = f"duration: {held.seconds:g} s, load: {load:g} N, slip: {held.slip:g}"
        return f"  - {{{parts}, speed: {held.speed:g} mm/s}}"


@dataclass(frozen=True)
class Simulated:
    """A campaign: runs, effects that the diagnosis does not know, and edits of two configurations.

    world: that of the testbed as it is; configured: the one that is handed to the diagnosis.
    """

    name: str
    runs: tuple[PlannedRun, ...]
    effects: tuple[str, ...] = ()
    world: Edits = ()
    configured: Edits = ()
    wrench: bool = True
    linearised: bool = True


SWEPT = (HeldInRun(0.1), HeldInRun(0.3), HeldInRun(0.5, 30.0))
FINE = (HeldInRun(0.1), HeldInRun(0.25), HeldInRun(0.4), HeldInRun(0.55), HeldInRun(0.2, 40.0))
LONG = (
    HeldInRun(0.2, seconds=12.0),
    HeldInRun(0.4, seconds=12.0),
    HeldInRun(0.2, 30.0, seconds=8.0),
)
STEADY = (HeldInRun(0.25, seconds=18.0),)
LIFTED = HeldInRun(0.1, load=0.0, seconds=4.0)
MIXED = tuple(HeldInRun(slip, load=load) for load in (40.0, 70.0, 100.0) for slip in (0.15, 0.45))
BOTH_WAYS = (*SWEPT, HeldInRun(0.3, -20.0))
CREEPING = (HeldInRun(0.2, 8.0, seconds=6.0),)

TWO = (PlannedRun(40.0, SWEPT), PlannedRun(80.0, SWEPT))
THREE = (PlannedRun(40.0, SWEPT), PlannedRun(70.0, SWEPT), PlannedRun(100.0, SWEPT))
BETWEEN = (
    PlannedRun(50.0, FINE),
    PlannedRun(90.0, FINE, ("coulomb_friction.loss=0.3",)),
    PlannedRun(70.0, FINE, ("force_crosstalk.from_load=0.03",)),
)
REPLICATES = tuple(
    PlannedRun(60.0, STEADY, (f"sinkage_datum.offset={offset}",)) for offset in (4e-4, -5e-4, 1e-4)
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
        (PlannedRun(50.0, FINE), PlannedRun(90.0, FINE)),
        ("soil_patch.cohesion_change=0.6", "soil_patch.centre=0.2", "soil_patch.length=0.12"),
    ),
    Simulated("sinkage-datum", TWO, ("sinkage_datum.offset=0.003",)),
    Simulated("bed-slope", THREE, ("bed_slope.angle=0.03",)),
    Simulated(
        "motor-heating-no-wrench",
        (PlannedRun(60.0, LONG), PlannedRun(100.0, LONG)),
        ("motor_heating.fall=0.08", "motor_heating.duration=20"),
        wrench=False,
    ),
    Simulated("rear-contact-unlinearised", THREE, ("rear_contact.ratio=0.3",), linearised=False),
    Simulated(
        "two-effects-both-ways",
        (PlannedRun(40.0, BOTH_WAYS), PlannedRun(80.0, BOTH_WAYS)),
        ("coulomb_friction.loss=0.3", "slip_sinkage.growth=0.2"),
    ),
    Simulated(
        "single-run-load-unstated",
        (PlannedRun(70.0, (*MIXED, LIFTED)),),
        ("pulley_slip.share=0.05",),
    ),
    Simulated(
        "single-load",
        (PlannedRun(70.0, CREEPING),),
        world=NOISY_VOLTS,
        configured=WIDE,
        wrench=False,
    ),
    Simulated("replicates-unlisted", (*REPLICATES, PlannedRun(90.0, SWEPT)), UNLISTED),
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
