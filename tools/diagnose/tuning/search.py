"""Tuned numbers of tools/diagnose/search: which models are fitted."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned


@dataclass(frozen=True)
class SearchTuning:
    """How far the search for effects goes."""

    effects_first: int = tuned(7, "effects", "fitted beside the base model", "run time")
    effects_quick: int = tuned(3, "effects", "fitted for a first answer", "run time")
    later: tuple[tuple[int, int], ...] = tuned(
        ((2, 4), (1, 2)),
        "models",
        "of one effect, of two, beside which one more is looked for, and with it are fitted",
        "run time",
    )
    together: int = tuned(
        3, "pairs", "of effects that are likeliest together by linear algebra, fitted", "run time"
    )
    again: int = tuned(
        4,
        "shapes",
        "of one effect or family, or effects, tried again, or as starts: the likeliest",
        "run time",
    )
    little: float = tuned(
        8.0,
        "nats",
        "that decide little: a third of what the verdict asks of one more effect. A model so far "
        "behind starts nothing, an effect that promises less is not fitted beside others, a fit so "
        "far below the model that it holds begins anew. Effects closer than twice it are fitted "
        "from each other's constants",
        "run time",
    )
    predicted_share: float = tuned(
        0.35, "-", "of the best gain by linear algebra, from which an effect is fitted", "run time"
    )
    predicted_less: float = tuned(6.0, "nats", "less than that share", "run time")
