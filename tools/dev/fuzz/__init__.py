"""Inputs that nobody meant, at every place where bytes or values come in."""

from gritd.tools.dev.fuzz.targets import TARGETS, Target, run

__all__ = ["TARGETS", "Target", "run"]
