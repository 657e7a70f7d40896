"""Physics that Eqs. (1)-(10) leave out: one file an effect, found by `library`."""

from gritd.estimator.effects.library import EFFECTS, in_order, make

__all__ = ["EFFECTS", "in_order", "make"]
