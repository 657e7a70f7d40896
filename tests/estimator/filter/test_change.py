"""A change of the soil is reported from a wrong calibration and from noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gritd.estimator.filter.change import judge
from gritd.estimator.filter.estimate import made, rows
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.tuning import CHANGE

SIGMA = (0.3, 0.06, 0.1)  # of the prior, and of a change
NUISANCES = (0.004**2, 0.1**2)  # offsets of torque [N·m] and of drawbar pull [N]
PRIOR = made((1.0, 0.577, -3.7, 0.0, 0.0), np.diag([*np.square(SIGMA), *NUISANCES]))
NOISE, LASTING = (0.003, 0.06), (0.002, 0.03)  # of a window, and of a stretch [N·m, N]
LENGTHS = (5, 5, 20, 40, 5, 5, 10, 5)


def drawn_lines(rng, change=None, at=4, offset=None, components=2):
    """Stretches at several loads, in a soil from the prior that may change before stretch `at`."""
    soil = np.array(PRIOR.x[:3]) + SIGMA * rng.normal(size=3)
    wrong = np.sqrt(NUISANCES) * rng.normal(size=2) if offset is None else np.array(offset)
    lines = []
    for number, windows in enumerate(LENGTHS):
        load = rng.uniform(0.5, 1.5)
        H = np.array([[0.16, 1.6 * load, -0.3 * load], [1.5, 21.0 * load, -4.0 * load]])
        x = soil if change is None or number < at else soil + change
        D, R = np.diag(np.square(LASTING)), np.diag(np.square(NOISE))
        noise = np.linalg.cholesky(R / windows + D) @ rng.normal(size=2)
        y = H @ x + np.eye(2) @ wrong + noise
        kept = slice(components)
        arrays = (np.hstack((H, np.eye(2)))[kept], R[kept, kept], D[kept, kept])
        lines.append(Line(tuple(y[kept].tolist()), *map(rows, arrays), (0.1, 1.0)[kept]))
    return lines


def judged(lines):
    return judge(PRIOR, SIGMA, lines, LENGTHS)


@pytest.mark.parametrize("components", [1, 2])
def test_the_evidence_is_the_ratio_of_the_densities(components):
    """The closed form against the densities of the whole record, written out."""
    rng = np.random.default_rng(1)
    lines = drawn_lines(rng, change=(0.2, -0.02, 0.0), components=components)
    y = np.concatenate([line.y for line in lines])
    H = np.concatenate([line.H for line in lines])
    noise = np.zeros((y.size, y.size))
    for number, (line, windows) in enumerate(zip(lines, LENGTHS, strict=True)):
        at = slice(number * components, (number + 1) * components)
        noise[at, at] = np.array(line.R) / windows + np.array(line.D)
    same = H @ np.array(PRIOR.P) @ H.T + noise
    mean = H @ np.array(PRIOR.x)

    found = judged(lines)
    for at in range(1, len(lines)):
        since = np.repeat(np.arange(len(lines)) >= at, components)[:, None] * H[:, :3]
        changed = same + since @ np.diag(np.square(SIGMA)) @ since.T
        ratio = multivariate_normal(mean, changed).logpdf(y) - multivariate_normal(
            mean, same
        ).logpdf(y)
        assert found.evidence[at] == pytest.approx(ratio, abs=1e-5)


def test_the_best_fit_of_one_soil_is_that_of_least_squares():
    rng = np.random.default_rng(2)
    lines = drawn_lines(rng)
    sigma = np.sqrt(np.diag(PRIOR.P))
    parts, right = [np.diag(1.0 / sigma)], [np.array(PRIOR.x) / sigma]
    for line, windows in zip(lines, LENGTHS, strict=True):
        white = np.linalg.inv(np.linalg.cholesky(np.array(line.R) / windows + np.array(line.D)))
        parts.append(white @ np.array(line.H))
        right.append(white @ np.array(line.y))
    best = np.linalg.lstsq(np.vstack(parts), np.concatenate(right), rcond=None)[0]
    np.testing.assert_allclose(judged(lines).x, best, atol=1e-6)


def test_a_record_without_a_change_is_hardly_ever_said_to_have_one():
    """By Ville's inequality fewer than 7 · e⁻³ of 300 records reach 3 nats; none the alarm."""
    rng = np.random.default_rng(3)
    found = [judged(drawn_lines(rng)) for _ in range(300)]
    assert not any(each.change for each in found)
    assert sum(each.evidence[1:].max() > 3.0 for each in found) < 300 * 7 * np.exp(-3.0)


@pytest.mark.parametrize("offset", [(0.012, 0.0), (-0.012, 0.3), (0.0, -0.3)])
def test_a_calibration_three_sigma_wrong_is_no_change(offset):
    rng = np.random.default_rng(4)
    assert not any(judged(drawn_lines(rng, offset=offset)).change for _ in range(50))


@pytest.mark.parametrize("change", [(0.15, 0.0, 0.0), (0.0, 0.03, 0.0), (-0.2, -0.02, 0.05)])
def test_a_change_is_found_where_it_is(change):
    rng = np.random.default_rng(5)
    found = [judged(drawn_lines(rng, change=change)).change for _ in range(50)]
    assert np.mean(np.array(found) == 4) > 0.9


def test_one_stretch_alone_cannot_tell_of_a_change():
    lines = drawn_lines(np.random.default_rng(6))[:1]
    assert judge(PRIOR, SIGMA, lines, LENGTHS[:1]).change == 0


def test_what_is_known_exactly_is_no_obstacle():
    """A soil parameter of sigma 0: nothing to learn of it, and no division by it."""
    P = np.array(PRIOR.P)
    P[2] = P[:, 2] = 0.0
    exact = made(PRIOR.x, P)
    lines = drawn_lines(np.random.default_rng(7), change=(0.3, 0.0, 0.0))
    found = judge(exact, (*SIGMA[:2], 0.0), lines, LENGTHS)
    assert found.change == 4 and found.x[2] == pytest.approx(PRIOR.x[2])
    assert CHANGE.alarm < found.evidence[4] < np.inf


def test_two_stretches_of_one_condition_are_one():
    one, other = drawn_lines(np.random.default_rng(8))[:2]
    mixed = one.mixed(other, 0.25)
    np.testing.assert_allclose(mixed.y, 0.75 * np.array(one.y) + 0.25 * np.array(other.y))
    assert mixed.mixed(mixed, 0.5) == mixed
