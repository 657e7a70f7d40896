"""The plant's bed of strips beside a simulator that nobody here wrote: orders of magnitude."""

import numpy as np

from tests.real_recordings import REAL, needs
from tests.tools.proof.blind.strips_beside_chrono import stretches


@needs("chrono")
def test_the_strips_are_of_the_same_kind_as_scm() -> None:
    found = list(stretches(REAL / "chrono"))
    assert len(found) >= 25
    chrono, strips, paper = (
        np.array([getattr(one, name) for one in found]) for name in ("chrono", "strips", "paper")
    )
    sinkage = strips[:, 0] / chrono[:, 0]
    assert np.all((sinkage > 0.75) & (sinkage < 1.15))  # the paper's is 1.3 to 1.8 times SCM's
    assert np.all(paper[:, 0] / chrono[:, 0] > 1.25)
    torque = strips[:, 1] / chrono[:, 1]
    assert np.all((torque > 0.3) & (torque < 1.0))
    # pull rises with slip alike, where the paper's stays below nothing
    assert np.corrcoef(strips[:, 2], chrono[:, 2])[0, 1] > 0.9
    assert (
        np.abs(strips[:, 2] - chrono[:, 2]).max() < 0.5 * np.abs(paper[:, 2] - chrono[:, 2]).max()
    )
