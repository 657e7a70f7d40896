"""Is σ honest when the soil changes under the wheel?"""

from gritd.tools.dev.soil_changes.cases import UNCHANGED, SoilChangeCase, case, packaged_rig
from gritd.tools.dev.soil_changes.followed import BACK, FollowedCase, Track, begun, followed, judged
from gritd.tools.dev.soil_changes.tables import unchanged, verdicts

__all__ = [
    "BACK",
    "UNCHANGED",
    "FollowedCase",
    "SoilChangeCase",
    "Track",
    "begun",
    "case",
    "followed",
    "judged",
    "packaged_rig",
    "unchanged",
    "verdicts",
]
