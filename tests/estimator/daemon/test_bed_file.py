"""The bed on disk: what it keeps, when it is of no use, and what is wrong with a file."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import pytest

from gritd.estimator.config.settings import BedSettings
from gritd.estimator.daemon import bed_file
from gritd.estimator.daemon.bed_file import BedError
from gritd.estimator.filter.estimate import covariance, made
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.service.bed_keeper import bed_of_run
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


def stored(folder, settings=SETTINGS, now=0.0):
    """A bed after one run, on disk."""
    bed = bed_file.after(bed_file.begin(folder, "a", 0.0), settings, learnt(settings), 0.0, now)
    bed_file.save(folder, bed)
    return bed_file.path_of(folder)


def test_a_bed_from_the_future_is_stale_too(tmp_path):
    limit = SETTINGS.bed.stale_after
    stored(tmp_path, now=DAY)
    bed = bed_file.load(tmp_path)
    assert bed_file.useless(bed, SETTINGS, DAY - limit + 1.0) == ""
    assert "ahead" in bed_file.useless(bed, SETTINGS, DAY - limit - 1.0)
    assert bed_file.start_of(bed, SETTINGS, DAY - limit - 1.0) is None


def test_what_is_no_bed_is_one_line(tmp_path):
    path = stored(tmp_path)
    good = path.read_bytes()
    digits = [at for at, byte in enumerate(good) if byte in b"0123456789"]

    cuts = [good[: len(good) * share // 20] for share in range(20)]
    changed = [good[:at] + b"37"[good[at] == 51 :][:1] + good[at + 1 :] for at in digits[::97]]
    unlike = [b"[]", b"{}", b"\xff", b"[" * 100_000, b'{"name": 1}', good * 2, bytes(2 << 20)]
    for content in (*cuts, *changed, *unlike):
        path.write_bytes(content)
        with pytest.raises(BedError, match=r"bed\.json: is no file of a bed"):
            bed_file.load(tmp_path)

    path.unlink()
    os.mkfifo(path)
    with pytest.raises(BedError, match=r"bed\.json: is no file of a bed"):
        bed_file.load(tmp_path)


IMPOSSIBLE = {
    "name": ["../../a", "a/b", "", 3, "\n"],
    "updated": [-1.0, 1e300, float("nan"), float("inf"), "now", 10**400],
    "runs": [0, -1, 10**9, 1e300, "many"],
    "x.0": [900e3, -1.0, float("nan"), float("inf"), 1e300],
    "x.1": [-0.5, 50.0],
    "x.2": [3.0, 710.0],
    "x.5": [1e6, float("inf"), 1e300],
    "P.0.0": [-1.0, 0.0, float("nan"), 1e300],
    "P.0.1": [1e3],
    "P.5.5": [-1e-9, 1e3],
    "log_evidence": [float("nan"), float("-inf"), "x"],
}


@pytest.mark.parametrize("key", IMPOSSIBLE)
def test_no_run_begins_with_what_no_run_left(tmp_path, key):
    """Values of any kind, sealed anew: the stated prior instead."""
    good = stored(tmp_path).read_text()
    name, *at = key.split(".")
    for value in IMPOSSIBLE[key]:
        plain = json.loads(good)
        del plain[bed_file.SEAL]
        for holder in [plain] if name in plain else plain["members"]:
            put(holder, [name, *map(int, at)], value)
        bed_file.path_of(tmp_path).write_text(json.dumps(bed_file._sealed(plain)))

        try:
            bed = bed_file.load(tmp_path)
        except BedError as error:
            assert "\n" not in str(error)
        else:
            assert bed_file.start_of(bed, SETTINGS, 0.0) is None, value
            assert bed_file.useless(bed, SETTINGS, 0.0), value


def put(holder, path, value):
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value


def test_what_cannot_be_used_is_put_aside_and_the_run_says_so(tmp_path):
    path = stored(tmp_path)
    path.write_bytes(path.read_bytes()[:100])
    bed = bed_of_run(tmp_path, SETTINGS, RunInfo("run"))
    assert bed.start is None and "is no file of a bed" in bed.announced()
    assert "stated prior" in bed.announced() and "\n" not in bed.announced()
    (aside,) = tmp_path.glob("bed-unreadable-*.json")
    assert len(aside.read_bytes()) == 100
    assert bed_file.load(tmp_path).runs == 0
