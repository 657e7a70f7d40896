"""The plant's own forms of the effects, by name, and physics outside the list."""

from gritd.tools.proof.blind.plant.concealed.library import ABSORBED, LISTED, UNLISTED, drawn

__all__ = ["ABSORBED", "LISTED", "UNLISTED", "drawn"]
