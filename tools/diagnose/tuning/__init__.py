"""Every tuned number of the diagnosis, a frozen dataclass for each room."""

from gritd.tools.diagnose.tuning.current import TUNING, Tuning, replaced

__all__ = ["TUNING", "Tuning", "replaced"]
