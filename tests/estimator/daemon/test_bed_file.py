"""The bed on disk: what it keeps, when it is of no use, and what is wrong with a file."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gritd.estimator.config.settings import BedSettings
from gritd.estimator.daemon import bed_file
from gritd.estimator.daemon.bed_file import BedError
from gritd.estimator.filter.estimate import covariance, made
from gritd.estimator.filter.tracker import Tracker
from tests.rig import SETTINGS

DAY = 86400.0


def learnt(settings):
    """What a run leaves: the prior with half of c's standard deviation."""
    bank = []
    for member in Tracker(settings).prior_bank:
        P = covariance(member).copy()
        P[0, 0] *= 0.25
        bank.append(made(member.x, P))
    return tuple(bank)


def test_the_bed_is_kept_to_the_bit_and_the_next_run_begins_with_it(tmp_path):
    settings = SETTINGS
    assert bed_file.current(tmp_path, settings, 0.0) is None

    bed = bed_file.begin(tmp_path, "sand box 1", 0.0)
    assert bed_file.useless(bed, settings, 0.0) == "no run on it yet"
    assert bed_file.start_of(bed, settings, 0.0) is None

    bed = bed_file.after(bed, settings, learnt(settings), 0.0, 100.0)
    bed_file.save(tmp_path, bed)
    again = bed_file.current(tmp_path, settings, 100.0)
    assert again == bed and again.runs == 1
    assert bed_file.start_of(again, settings, 100.0).bank == learnt(settings)

    bed = bed_file.after(again, settings, learnt(settings), 200.0, 300.0)
    assert bed.runs == 2 and bed.updated == 300.0


def test_a_stale_bed_and_another_rig_begin_with_the_prior(tmp_path):
    settings = SETTINGS
    bed = bed_file.after(bed_file.begin(tmp_path, "a", 0.0), settings, learnt(settings), 0.0, 0.0)
    limit = settings.bed.stale_after

    assert bed_file.useless(bed, settings, limit - 1.0) == ""
    assert "its last run was" in bed_file.useless(bed, settings, limit + 1.0)

    softer = replace(settings.soil, modulus_sigma=0.3)
    assert "changed" in bed_file.useless(bed, replace(settings, soil=softer), 0.0)

    # what such a bed learns next rests on the new run alone
    late = bed_file.after(bed, settings, learnt(settings), limit + 1.0, limit + 100.0)
    assert late.runs == 1


def test_the_configured_name_begins_a_new_bed_and_the_old_one_keeps_its_file(tmp_path):
    settings = SETTINGS
    bed_file.save(
        tmp_path,
        bed_file.after(bed_file.begin(tmp_path, "old", 0.0), settings, learnt(settings), 0.0, 0.0),
    )
    named = replace(settings, bed=BedSettings(name="new"))

    assert bed_file.current(tmp_path, named, DAY).known is None
    assert bed_file.current(tmp_path, named, DAY).name == "new"
    (kept,) = tmp_path.glob("bed-old-*.json")
    assert '"runs": 1' in kept.read_text()


HEAD = '"name": "a", "updated": 0, "rig": "", "runs": 1'
SQUARE = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        f'{{{HEAD}, "x": [1], "P": [[1]], "cross": [[]]}}',
        f'{{{HEAD}, "x": [NaN, 1, 1], "P": {SQUARE}, "cross": [[], [], []]}}',
    ],
)
def test_what_is_no_bed_is_one_line(tmp_path, text):
    bed_file.path_of(tmp_path).write_text(text)
    with pytest.raises(BedError, match=r"bed\.json: is no file of a bed"):
        bed_file.load(tmp_path)
