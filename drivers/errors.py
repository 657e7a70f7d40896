"""The two things that can go wrong with a device: what is configured, and what the hardware
does.
"""

from __future__ import annotations


class DeviceError(Exception):
    """The hardware failed: the one exception a link raises. One line, with the device's name."""

    def __init__(self, device: str, reason: object) -> None:
        self.device = device
        self.reason = one_line(reason)
        super().__init__(f"{device}: {self.reason}")


class DeviceSettingsError(ValueError):
    """The configuration of a device or of a channel cannot work. One line: where, and what was
    expected.
    """

    def __init__(self, where: str, reason: object) -> None:
        super().__init__(f"{where}: {one_line(reason)}")


def one_line(reason: object) -> str:
    """The reason as one line of at most 200 characters; an exception without a text gives its
    type.
    """
    text = " ".join(str(reason).split())
    return (text or type(reason).__name__)[:200]
