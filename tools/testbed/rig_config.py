"""The configuration of a run on simulated wires: the testbed's own, with other devices and another
log folder.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import Device
from gritd.estimator.config.yamltree import dumped
from gritd.tools.testbed.plant import PlantKind

LINEARISATION = (
    "stress_linearisation"  # what the linear plant does not have and the original one does
)
NAME = "testbed.yaml"


def write(
    configuration: Configuration, devices: Mapping[str, Device], plant: PlantKind, folder: Path
) -> Path:
    """Write the configuration into the folder, with all it refers to; its path.

    devices: by name, where the wires are; everything else about a device stays as configured.
    plant:   the linear one obeys the closed forms, so the daemon must not correct them.
    """
    document: dict[str, Any] = yaml.safe_load(configuration.text)
    for name, device in devices.items():
        document["devices"][name].update(_address(device))
        if device.dbc:
            document["devices"][name]["dbc"] = _copied(Path(device.dbc), folder)

    if plant == "linear":
        document["effects"][LINEARISATION] = {"share": 0.0}
    document["logging"]["directory"] = str(folder)

    path = folder / NAME
    path.write_text(dumped(document), encoding="utf-8")
    return path


def _address(device: Device) -> dict[str, object]:
    if device.kind == "serial":
        return {"port": device.port}
    return {
        "interface": device.interface,
        "channel": device.channel,
        "options": dict(device.options),
    }


def _copied(file: Path, folder: Path) -> str:
    """The name of a copy in the folder."""
    shutil.copyfile(file, folder / file.name)
    return file.name
