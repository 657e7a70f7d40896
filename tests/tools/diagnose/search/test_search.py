"""An effect is judged beside smaller discrepancies of form too: one learnt without the effect may
have taken its part.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.effects import make
from gritd.tools.diagnose.fit.settings import _smaller, settings_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import _bare, _tried, begin, extended, promises
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

SIZES = st.lists(st.integers(0, 5), max_size=4).map(tuple)


@given(SIZES)
def test_settings_are_smaller_and_begin_with_the_models_own(sizes: tuple[int, ...]) -> None:
    found = _smaller(sizes)
    assert found[0] == sizes
    assert len(set(found)) == len(found)
    assert all(0 <= a <= b for other in found for a, b in zip(other, sizes, strict=True))
    assert tuple(0 for _ in sizes) in found


def test_fits_have_the_same_bits_for_any_number_of_processes() -> None:
    """Also where another fit stood between: a prediction begins at the one before."""
    rig = WheelRig(record(plan(), (make("bulldozing", {"share": 0.75}),)), settings())
    rng = np.random.default_rng(0)
    search = begin(prepare_screening(fit_base(rig, rng), rng))
    bare = _bare(search, search.base)
    found = []
    for jobs in (1, 2):
        with rig.aside():
            found.append(extended(search, [bare], 3, jobs).models[1:])

    assert len(found[0]) == 3
    assert [m.evidence for m in found[0]] == [m.evidence for m in found[1]]
    for alone, beside in zip(*found, strict=True):
        assert alone.fitted.u.tobytes() == beside.fitted.u.tobytes()
        assert alone.fitted.x.tobytes() == beside.fitted.x.tobytes()


def test_an_effect_that_the_discrepancy_took_keeps_its_promise() -> None:
    effect = make("bulldozing", {"share": 0.75})
    rig = WheelRig(record(plan(), (effect,)), settings())
    rng = np.random.default_rng(0)
    search = begin(prepare_screening(fit_base(rig, rng), rng))
    bare = _bare(search, search.base)
    assert max(bare.sizes) > 0

    kind, every = rig.effects["bulldozing"], settings_of(search.problem, bare)
    assert (every.sizes[0], every.costs[0]) == (bare.sizes, 0.0)
    tried = list(_tried(search, bare, kind, every))
    as_it_is = max(p.gain for p in tried if p.sizes == bare.sizes)
    best = next(p for p in promises(search, bare) if p.effect is kind)
    assert best.gain > as_it_is + 5.0
    assert max(best.sizes) < max(bare.sizes)


def test_where_a_ripple_alone_raised_the_alarm_only_what_ripples_is_tried() -> None:
    """A friction may gain by chance what a ripple left over: it is not what stood out."""
    rig = WheelRig(record(plan(), ()), settings())
    rng = np.random.default_rng(0)
    quiet = begin(prepare_screening(fit_base(rig, rng), rng))
    bare = _bare(quiet, quiet.base)
    assert not quiet.first.on_grid

    rippling = replace(quiet, first=replace(quiet.first, ripple=1e-9))
    assert rippling.first.alarmed
    tried = {promise.effect.name for promise in promises(rippling, bare)}
    assert tried <= {"gear_ripple", "grousers", "hub_runout", "wheel_eccentricity"}
