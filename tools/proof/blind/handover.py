"""What a testbed hands over: a configuration and recordings. What is true stays out of it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from gritd.config import packaged
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools.proof.blind import campaign, printed
from gritd.tools.proof.blind.cases import BlindCase
from gritd.tools.proof.blind.detect import BlindTrial
from gritd.tools.proof.blind.knowledge import Instrument, Knowledge, Stated
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.respond import Commanded, drives
from gritd.tools.proof.blind.plant.scene import Felt
from gritd.tools.proof.blind.plant.sensors import readings

NS = 1_000_000_000
FIRST = 1_790_000_000 * NS  # [ns since the epoch] about when campaigns begin
DAY = 86_400 * NS  # from a reference campaign to the new one
CONFIGURATION = "testbed.yaml"
REFERENCE, NEW = "reference", "new"  # folders of a pair's recordings
TRUTH_RATE = 50.0  # [Hz] of the noiseless channels that judge held-out errors


class DrivenCampaign(NamedTuple):
    """A campaign as it was driven: the concealed truth, without noise."""

    folder: str  # in which its recordings are handed over; none where there is one campaign alone
    trial: BlindTrial
    begins: tuple[int, ...]  # of each run [ns since the epoch]
    felt: list[Felt]  # of each run

    def name(self, number: int) -> str:
        """Of a run, counted from 0, as its recording tells it."""
        return f"{self.folder or 'run'}-{number + 1}"


def driven(case: BlindCase) -> list[DrivenCampaign]:
    """The campaigns of a case, the reference first."""
    alone = not case.reference
    campaigns = [] if case.reference is None else [_driven(case, case.reference, REFERENCE, 0)]
    return [*campaigns, _driven(case, case.trial, "" if alone else NEW, 0 if alone else DAY)]


def _driven(case: BlindCase, trial: BlindTrial, folder: str, later: int) -> DrivenCampaign:
    begun = FIRST + case.seed % 10_000_000 * NS + later
    begins = tuple(begun + round(run.begins * NS) for run in trial.runs)
    return DrivenCampaign(
        folder, trial, begins, drives(trial.world, [_orders(case, run) for run in trial.runs])
    )


def _orders(case: BlindCase, run: campaign.BlindRun) -> Commanded:
    """What the controllers are commanded, under the weights as they truly are."""
    orders = campaign.orders(run, case.trial.known.radius)
    share = 1.0 + _weight_error(case, run.weight)
    return campaign.with_weight(orders, orders.weight * share)


def write(case: BlindCase, campaigns: Sequence[DrivenCampaign], folder: Path) -> list[Path]:
    """testbed.yaml, its CAN database and run-1.mcap … of each campaign in a new folder. Returns the
    recordings. Raises OSError.
    """
    if case.assignment.printed:
        return _printed(case, campaigns, folder)
    folder.mkdir(parents=True)
    text = configuration(case.stated(), case.trial.runs[0].weight)
    (folder / CONFIGURATION).write_text(text, encoding="utf-8")
    shutil.copyfile(packaged("testbed.dbc"), folder / "testbed.dbc")

    rng = np.random.default_rng((case.seed, 1))
    return [
        _record(case, one, number, text, folder / one.folder, rng)
        for one in campaigns
        for number in range(len(one.felt))
    ]


def _printed(case: BlindCase, campaigns: Sequence[DrivenCampaign], folder: Path) -> list[Path]:
    """The tables, the recordings that the importer makes of them, and its configuration of the
    reference.
    """
    felt = {one.folder: (one.trial, one.felt) for one in campaigns}
    imported = printed.write(felt, case.noise_factor, case.seed, folder)
    shutil.copyfile(imported / f"{REFERENCE}.yaml", folder / CONFIGURATION)
    paths = []
    for one in campaigns:
        (folder / one.folder).mkdir()
        path = imported / f"{one.folder}.mcap"
        paths.append(path.rename(folder / one.folder / path.name))
    return paths


def _record(
    case: BlindCase,
    one: DrivenCampaign,
    number: int,
    text: str,
    folder: Path,
    rng: np.random.Generator,
) -> Path:
    run, trial = one.trial.runs[number], one.trial
    sent = readings(trial.chain, one.felt[number], trial.known.pulley, one.begins[number], rng)
    load = None if case.design.weighed else run.weight
    folder.mkdir(exist_ok=True)
    path = folder / f"run-{number + 1}.mcap"
    _written(path, text, RunInfo(one.name(number), load, run.passes, run.start), sent)
    return path


def _written(path: Path, text: str, info: RunInfo, sent: Sequence[Reading]) -> None:
    writer = RunWriter(path, (), text, info)
    try:
        for reading in sent:
            writer.reading(reading)
    finally:
        writer.close()


def _weight_error(case: BlindCase, weight: float) -> float:
    """Relative error of the weights, within their sigma: half the carriage's, half the plates'."""
    sources = ((case.seed, 2), (case.seed, 3, round(weight * 1e3)))
    drawn = [
        float(np.clip(np.random.default_rng(source).standard_normal(), -2.5, 2.5))
        for source in sources
    ]
    return case.trial.known.weight_share * sum(drawn) / float(np.sqrt(2.0))


def truth(one: DrivenCampaign, number: int) -> dict[str, Array]:
    """One run's noiseless channels (n,) as the configured calibration shows them, SI, at
    TRUTH_RATE; time from its start.
    """
    felt, known, chain = one.felt[number], one.trial.known, one.trial.chain
    every = round(campaign.RATE / TRUTH_RATE)
    true = {c.channel: c for c in (*chain.converters, *(chain.wrench or ()))}

    def shown(channel: str, physical: Array) -> Array:
        stated, is_ = known.instruments[channel], true[channel]
        raw = (physical[::every] - is_.offset) / is_.scale
        return np.asarray(raw * stated.scale.value + stated.offset.value)

    current = shown("motor_shunt", felt.current)
    time = felt.scene.motion.time
    stated = {
        "time": time[::every] - time[0],
        "sinkage": shown("sinkage_pot", felt.sinkage),
        "current": current,
        "torque": current * known.torque_constant.value,
    }
    if chain.wrench is not None:
        wrench = (("drawbar_pull", felt.pull), ("load", felt.load), ("torque", felt.torque))
        stated |= {
            ("axle_torque" if name == "torque" else name): shown(name, values)
            for name, values in wrench
        }
    return stated


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


def _calibrated(instrument: Instrument, scale: str, offset: str) -> dict[str, Any]:
    return {"scale": _stated(instrument.scale, scale), "offset": _stated(instrument.offset, offset)}


def _stated(stated: Stated, unit: str) -> Any:
    def quantity(value: float) -> Any:
        return f"{float(value)!r} {unit}" if unit else float(value)

    return (
        {"value": quantity(stated.value), "sigma": quantity(stated.sigma)}
        if stated.sigma
        else quantity(stated.value)
    )
