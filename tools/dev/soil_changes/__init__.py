"""Is σ honest when the soil changes under the wheel?"""

from gritd.tools.dev.soil_changes.cases import UNCHANGED, Case, case, packaged_rig
from gritd.tools.dev.soil_changes.followed import BACK, Track, Verdict, begun, followed, judged
from gritd.tools.dev.soil_changes.tables import unchanged, verdicts

__all__ = [
    "BACK",
    "UNCHANGED",
    "Case",
    "Track",
    "Verdict",
    "begun",
    "case",
    "followed",
    "judged",
    "packaged_rig",
    "unchanged",
    "verdicts",
]
