"""How large an effect is that goes along what no law tells of: a hub, a rim, a zero."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.explain.result import Quantity
from gritd.tools.diagnose.fit.form_error import added_by
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem


def profile_of(problem: Problem, model: Model, name: str) -> dict[str, Quantity]:
    """What an effect of a model moves a channel by, from lowest to highest, in each channel where
    its profile is more than noise; the parameters of the effect state a part of that only.
    """
    stack, rig = problem.stack, problem.stack.rig
    profile, _ = model.profiles(name)
    whole = profile + added_by(stack, model.fitted, model.names.index(name))
    found = {}
    for channel, colour in zip(rig.channels, problem.noise.colours, strict=True):
        own = stack.of(channel)
        if own.any() and float(np.mean(profile[own] ** 2)) > colour.sigma**2:
            found[channel] = Quantity(float(np.ptp(whole[own])), np.nan, rig.units[channel])
    return found
