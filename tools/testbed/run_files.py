"""The files of a simulated run: its recording, and the truth beside it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import Settings
from gritd.estimator.effects.base import Effect
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.terramechanics.soil import Soil
from gritd.tools.testbed.simulation import SimulatedRun


def write(path: Path, configuration: Configuration, info: RunInfo, run: SimulatedRun) -> None:
    """The recording, raw topics only. Raises RecordingError."""
    writer = RunWriter(path, (), configuration.text, info)
    try:
        for reading in run.readings:
            writer.reading(reading)
    finally:
        writer.close()


def write_truth(
    path: Path,
    settings: Settings,
    soil: Soil,
    acting: Sequence[Effect],
    run: SimulatedRun,
    seed: int,
) -> None:
    """PATH.truth.json with soil, effects and seed; PATH.truth.npz with the true arrays."""
    truth = {
        "wheel": asdict(settings.wheel),
        "soil": asdict(soil),
        "effects": {effect.name: asdict(effect) for effect in acting},
        "discrepancy": settings.discrepancy and asdict(settings.discrepancy),
        "seed": seed,
        "overloaded_samples": int(run.response.overloaded.sum()),
    }
    path.with_suffix(".truth.json").write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")

    sensed = {f"sensed_{name}": value for name, value in vars(run.response.sensed).items()}
    arrays = {**sensed, **vars(run.motion), **vars(run.response)}
    kept = {name: value for name, value in arrays.items() if name != "sensed" and value is not None}
    np.savez_compressed(path.with_suffix(".truth.npz"), **kept)
