"""Packaged defaults: the testbed's configuration, its CAN database, the service unit and the udev
rules.
"""

from pathlib import Path


def packaged(name: str = "testbed.yaml") -> Path:
    """Path of a packaged file; it need not exist."""
    return Path(__file__).resolve().parent / name
