"""Packaged defaults: the testbed's configuration, its CAN database, the service unit and the udev
rules.
"""

from gritd.config.files import packaged

__all__ = ["packaged"]
