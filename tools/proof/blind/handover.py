"""What a testbed hands over: a configuration and recordings. What is true stays out of it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from gritd.config import packaged
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools.proof.blind import campaign
from gritd.tools.proof.blind.cases import Case
from gritd.tools.proof.blind.knowledge import Instrument, Knowledge, Stated
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.respond import drive
from gritd.tools.proof.blind.plant.scene import Felt
from gritd.tools.proof.blind.plant.sensors import readings

NS = 1_000_000_000
FIRST = 1_790_000_000 * NS  # [ns since the epoch] about when campaigns begin
CONFIGURATION = "testbed.yaml"
TRUTH_RATE = 50.0  # [Hz] of the noiseless channels that judge held-out errors


def write(case: Case, folder: Path) -> list[Path]:
    """testbed.yaml, its CAN database and run-1.mcap … in a new folder. Returns the recordings.
    Raises OSError.
    """
    folder.mkdir(parents=True)
    text = configuration(case.stated(), case.trial.runs[0].weight)
    (folder / CONFIGURATION).write_text(text, encoding="utf-8")
    shutil.copyfile(packaged("testbed.dbc"), folder / "testbed.dbc")
    rng = np.random.default_rng((case.seed, 1))
    return [_record(case, number, text, folder, rng) for number in range(len(case.trial.runs))]


def _record(case: Case, number: int, text: str, folder: Path, rng: np.random.Generator) -> Path:
    run = case.trial.runs[number]
    sent = readings(
        case.trial.chain, driven(case, number), case.trial.known.pulley, begins(case, number), rng
    )
    path = folder / f"run-{number + 1}.mcap"
    info = RunInfo(f"run-{number + 1}", run.weight, run.passes, run.start)
    _written(path, text, info, sent)
    return path


def _written(path: Path, text: str, info: RunInfo, sent: Sequence[Reading]) -> None:
    writer = RunWriter(path, (), text, info)
    try:
        for reading in sent:
            writer.reading(reading)
    finally:
        writer.close()


def begins(case: Case, number: int) -> int:
    """When a run begins [ns since the epoch]."""
    day = case.seed % 10_000_000
    return FIRST + day * NS + round(case.trial.runs[number].begins * NS)


def driven(case: Case, number: int) -> Felt:
    """One run of the concealed truth, without noise."""
    trial, run = case.trial, case.trial.runs[number]
    orders = campaign.orders(run, trial.known.radius)
    share = 1.0 + _weight_error(case, run.weight)
    return drive(trial.world, campaign.with_weight(orders, orders.weight * share))


def _weight_error(case: Case, weight: float) -> float:
    """Relative error of the weights, within their sigma: half the carriage's, half the plates'."""
    sources = ((case.seed, 2), (case.seed, 3, round(weight * 1e3)))
    drawn = [
        float(np.clip(np.random.default_rng(source).standard_normal(), -2.5, 2.5))
        for source in sources
    ]
    return case.trial.known.weight_share * sum(drawn) / float(np.sqrt(2.0))


def truth(case: Case, number: int) -> dict[str, Array]:
    """One run's noiseless channels as the configured calibration shows them, SI, at TRUTH_RATE;
    time from its start.
    """
    felt, known, chain = driven(case, number), case.trial.known, case.trial.chain
    every = round(campaign.RATE / TRUTH_RATE)
    true = {c.channel: c for c in (*chain.converters, *(chain.wrench or ()))}

    def shown(channel: str, physical: Array) -> Array:
        said, is_ = known.instruments[channel], true[channel]
        raw = (physical[::every] - is_.offset) / is_.scale
        return np.asarray(raw * said.scale.value + said.offset.value)

    current = shown("motor_shunt", felt.current)
    time = felt.scene.motion.time
    told = {
        "time": time[::every] - time[0],
        "sinkage": shown("sinkage_pot", felt.sinkage),
        "current": current,
        "torque": current * known.torque_constant.value,
    }
    if chain.wrench is not None:
        wrench = (("drawbar_pull", felt.pull), ("load", felt.load), ("torque", felt.torque))
        told |= {
            ("axle_torque" if name == "torque" else name): shown(name, values)
            for name, values in wrench
        }
    return told


# --- configuration ---


def configuration(known: Knowledge, nominal: float) -> str:
    """YAML of the testbed, after the packaged one."""
    document: dict[str, Any] = yaml.safe_load(packaged().read_text(encoding="utf-8"))
    document["testbed"] = "wheel testbed"
    document["wheel"] = {"radius": f"{known.radius!r} m", "width": f"{known.width!r} m"}
    document["pulley_radius"] = f"{known.pulley!r} m"
    document["soil"] = _soil(known.soil)
    document["drive"]["torque_constant"] = _stated(known.torque_constant, "N*m/A")
    document["load"] = {
        "nominal": _stated(Stated(nominal, known.weight_share * nominal), "N"),
        "minimum": "1 N",
    }

    _channels(document, known)

    return yaml.safe_dump(
        document,
        sort_keys=False,
        allow_unicode=True,
        width=120,
        explicit_start=True,
        explicit_end=True,
    )


def _soil(soil: dict[str, Stated]) -> dict[str, Any]:
    modulus = soil["modulus"]
    return {
        "cohesion": _stated(soil["cohesion"], "Pa"),
        "tan_phi": _stated(soil["tan_phi"], ""),
        "shear_modulus": _stated(soil["shear_modulus"], "m"),
        "exponent": _stated(soil["exponent"], ""),
        "k_c": "0 N/m^(n+1)",
        "k_phi": f"{modulus.value!r} N/m^(n+2)",
        "modulus_sigma": float(modulus.sigma / modulus.value),
    }


def _channels(document: dict[str, Any], known: Knowledge) -> None:
    channels = document["channels"]
    channels.pop("motor_temperature", None)

    units = {
        "wheel_encoder": ("rad/count", "rad", "count"),
        "carriage_encoder": ("rad/count", "rad", "count"),
        "sinkage_pot": ("m/V", "m", "V"),
        "motor_shunt": ("A/V", "A", "V"),
    }

    for name, (scale, offset, raw) in units.items():
        channels[name] |= _calibrated(known.instruments[name], scale, offset)
        channels[name]["noise"] = f"{known.instruments[name].noise!r} {raw}"

    if "load" not in known.instruments:
        del channels["wrench"]
        return

    wrench = channels["wrench"] | {
        "latency": "1 ms",
        "max_force": "5000 N",
        "max_torque": "1000 N*m",
    }

    for name, unit in (("load", "N"), ("drawbar_pull", "N"), ("torque", "N*m")):
        wrench[name] = _calibrated(known.instruments[name], "", unit)
    wrench["force_noise"] = f"{known.instruments['load'].noise!r} N"
    wrench["torque_noise"] = f"{known.instruments['torque'].noise!r} N*m"

    channels["wrench"] = wrench


def _calibrated(said: Instrument, scale: str, offset: str) -> dict[str, Any]:
    return {"scale": _stated(said.scale, scale), "offset": _stated(said.offset, offset)}


def _stated(stated: Stated, unit: str) -> Any:
    def quantity(value: float) -> Any:
        return f"{float(value)!r} {unit}" if unit else float(value)

    return (
        {"value": quantity(stated.value), "sigma": quantity(stated.sigma)}
        if stated.sigma
        else quantity(stated.value)
    )
