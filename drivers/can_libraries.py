"""python-can and cantools, without what python-can loads for the log files of other programs:
asammdf brings pandas, and takes longer than all that gritd loads.
"""

from __future__ import annotations

import sys
from typing import Any

FOR_FILES = "asammdf"
modules: dict[str, Any] = sys.modules
hidden = FOR_FILES not in modules

try:
    if hidden:
        modules[FOR_FILES] = None  # is then taken for one that is not installed
    import can
    import cantools
    from can.util import CAN_FD_DLC
    from cantools.database import Database
    from cantools.database.can import Message, Signal
    from cantools.database.conversion import BaseConversion
finally:
    if hidden:
        del modules[FOR_FILES]

__all__ = ["CAN_FD_DLC", "BaseConversion", "Database", "Message", "Signal", "can", "cantools"]
