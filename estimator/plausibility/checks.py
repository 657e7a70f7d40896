"""What physics or the configuration forbids in a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.plausibility import forces, motion
from gritd.estimator.plausibility.contradiction import Contradiction
from gritd.estimator.plausibility.driven import DrivenRun
from gritd.estimator.plausibility.mistakes import Sources

Check = Callable[[DrivenRun, Settings, Sources], Iterator[Contradiction]]


@np.errstate(all="ignore")  # numbers that are none stay none
def contradictions(
    run: DrivenRun, settings: Settings, sources: Sources
) -> tuple[Contradiction, ...]:
    """What cannot be, each with the likeliest remedy. What follows from another is left out."""

    def found(*checks: Check) -> tuple[Contradiction, ...]:
        return tuple(chain.from_iterable(check(run, settings, sources) for check in checks))

    timed = found(motion.clock, motion.wrap)
    moved = found(motion.slip) or found(motion.speed) or found(motion.hidden)
    placed = found(forces.sinkage, forces.load)
    pulled = () if moved or placed else found(forces.torque) or found(forces.pull)
    return (*timed, *moved, *placed, *pulled)
