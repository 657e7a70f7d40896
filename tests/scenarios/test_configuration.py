"""Configuration files that are wrong, read at start or while the daemon runs."""

from __future__ import annotations

import random
import re
import shutil
import signal
import time
import tracemalloc

import numpy as np
import pytest
import yaml

from gritd.config import packaged
from gritd.estimator.config.configuration import ConfigError, load, loads, reload
from gritd.estimator.config.yamltree import dumped
from gritd.tools.cli.configuration_file import edited, save
from tests.estimator.config.rig import HOSTILE
from tests.scenarios.recorded import log_lines, recordings, rows, verified
from tests.scenarios.rig import TESTBED, WIRES, driven, service

BAD_RELOAD = "SIGHUP with bad YAML"
CUT = "YAML cut at every byte"
BOMB = "YAML bomb, unsafe tag, duplicate key, 1e3 as text, no as false, NaN"


def broken(text, rng):
    """The file with one mistake that a person might make."""
    lines = text.splitlines()
    at = rng.randrange(1, len(lines))
    mistake = rng.choice(("unknown", "value", "indent", "twice", "cut", "tag"))
    if mistake == "unknown":
        lines.insert(at, f"key_{rng.randrange(1000)}: 1")
    elif mistake == "value":
        places = [n for n, line in enumerate(lines) if re.search(r": [\d.]+", line)]
        at = rng.choice(places)
        lines[at] = re.sub(
            r": [\d.]+.*",
            f": {rng.choice(('.nan', '.inf', 'no', 'soft', '1 furlong', '1e3 kg'))}",
            lines[at],
        )
    elif mistake == "indent":
        lines[at] = "\t" + lines[at]
    elif mistake == "twice":
        lines.insert(at, lines[1])
    elif mistake == "cut":
        lines = [*lines[:at], lines[at][: len(lines[at]) // 2] + ": {"]
    else:
        lines[at] += " !!python/object/apply:os.system ['true']"
    return "\n".join(lines) + "\n"


def test_a_hundred_bad_files_change_nothing(tmp_path, seed, figure):
    """34 a seed: each refused in one line with its place, the estimates as if nothing had been
    asked.
    """
    rng, cases = random.Random(seed), 34
    with service(tmp_path, driven(40.0, seed, skip=1.0)) as (wires, daemon):
        good = wires.config.read_text()
        accepted = refused = 0
        while refused < cases:
            text = broken(good, rng)
            if readable(text, tmp_path):
                accepted += 1
                continue
            wires.config.write_text(text)
            daemon.signal(signal.SIGHUP)
            refused += 1
            daemon.heard("the old configuration is kept", refused)
        daemon.stop()
    lines = [
        line for line in log_lines(daemon.path()) if line.endswith("the old configuration is kept")
    ]
    unplaced = [
        line
        for line in lines
        if not re.match(rf"{re.escape(str(wires.config))}:\d+: \S+.*: found .+; expected", line)
    ]
    figure(BAD_RELOAD, WIRES, "files refused", len(lines), "")
    figure(BAD_RELOAD, WIRES, "refusals without file, line and key", len(unplaced), "", 0)
    figure(
        BAD_RELOAD, WIRES, "parts of the recording begun", len(recordings(daemon.path())) - 1, "", 0
    )
    assert verified(daemon.path())


@pytest.mark.parametrize("every", [7, pytest.param(1, marks=pytest.mark.slow)])
def test_a_file_cut_at_any_byte(tmp_path, every, figure):
    """The packaged file, one that `--apply` wrote and one by hand: no cut is taken for a whole."""
    path = tmp_path / "testbed.yaml"
    shutil.copy(packaged().with_suffix(".dbc"), tmp_path)
    by_hand = TESTBED.text.removeprefix("---\n").removesuffix("...\n")
    explained = applied(path, f"{by_hand}...\n")
    texts = {
        "reload": (packaged().read_text(), reload),
        "after --apply": (explained, load),
        "reload of a file by hand": (by_hand, reload),
    }
    for name, (text, take) in texts.items():
        data = text.encode()
        whole = None if take is reload and "by hand" in name else loads(text, "x", tmp_path).text
        cuts = range(0, len(data), every)
        wrong = sum(taken(path, data[:cut], take) not in (None, whole) for cut in cuts)
        figure(CUT, "configuration reader", f"cuts, {name}", len(cuts))
        figure(CUT, "configuration reader", f"cuts taken for another file, {name}", wrong, limit=0)


def applied(path, text):
    """What `--apply` makes of the text."""
    path.write_text(text)
    document = edited(path)
    document.set(("effects", "bulldozing", "share"), "0.5")
    save(document.text(), path, path)
    return path.read_text()


def taken(path, data, take):
    """What a file of these bytes means; None where it is refused with file and line."""
    path.write_bytes(data)
    try:
        return take(path).text
    except ConfigError as error:
        assert re.match(rf"{re.escape(str(path))}:\d+: .+: found .+; expected .+", str(error))
        return None


def test_a_reload_of_a_file_that_is_being_written(tmp_path, seed, figure):
    """SIGHUP at twenty moments of a slow save: the old configuration is kept until all is there."""
    rng = random.Random(seed)
    with service(tmp_path, driven(40.0, seed, skip=1.0)) as (wires, daemon):
        good = wires.config.read_bytes()
        cuts = sorted(rng.sample(range(len(good) - 5), 20))
        for number, cut in enumerate(cuts, start=1):
            wires.config.write_bytes(good[:cut])
            daemon.signal(signal.SIGHUP)
            daemon.heard("the old configuration is kept", number)
        wires.config.write_bytes(good)
        daemon.signal(signal.SIGHUP)
        daemon.heard("unchanged")
        daemon.stop()
    begun = len(recordings(daemon.path())) - 1
    figure(CUT, WIRES, "parts of the recording begun", begun, limit=0)


def readable(text, folder):
    try:
        loads(text, "x", folder)
    except ConfigError:
        return False
    return True


def test_a_good_file_is_taken_over_between_two_ticks(tmp_path, seed, figure):
    """Another calibration and another prior: a new part with the new configuration, verified
    through the change.
    """
    with service(tmp_path, driven(40.0, seed, skip=1.0)) as (wires, daemon):
        daemon.wait_status(
            lambda report: report["status"] == "TRACKING" and report["tick"]["updates"] > 5
        )
        change(
            wires,
            lambda d: d["drive"].update(
                torque_constant={"value": "2.1 N*m/A", "sigma": "0.01 N*m/A"}
            ),
        )
        daemon.signal(signal.SIGHUP)
        daemon.heard("reloaded")
        daemon.notified("RELOADING=1")
        daemon.notified("READY=1")
        daemon.wait_status(
            lambda report: report["log"]["files"] == 2 and report["status"] == "TRACKING"
        )
        change(wires, lambda d: d["soil"].update(cohesion={"value": "500 Pa", "sigma": "200 Pa"}))
        daemon.signal(signal.SIGHUP)
        daemon.heard("reloaded", 2)
        daemon.wait_status(
            lambda report: report["log"]["files"] == 3 and report["status"] == "TRACKING"
        )
        change(wires, lambda d: d["rates"].update(tick="500 Hz"))
        daemon.signal(signal.SIGHUP)
        daemon.heard("rates: changed, which needs a restart; the old configuration is kept")
        daemon.stop()
    first, second, third = recordings(daemon.path())
    constants = [
        loads(r.config_yaml, "x").settings.drive.torque_constant.value
        for r in (first, second, third)
    ]
    assert constants == [2.0, 2.1, 2.1]
    ticks = second.arrays("/tick")
    assert abs(ticks["cohesion"][0] - first.arrays("/tick")["cohesion"][-1]) < 1e-9, (
        "the estimate is kept"
    )
    assert ticks["cohesion_sigma"][0] == pytest.approx(TESTBED.settings.soil.cohesion.sigma)
    assert third.arrays("/tick")["cohesion"][0] == pytest.approx(500.0)
    gap = np.max(np.diff(rows(daemon.path(), "/tick")["stamp"])) * 1e-9
    figure("SIGHUP with good YAML", WIRES, "largest gap between ticks at a reload", gap * 1e3, "ms")
    assert verified(daemon.path())


def change(wires, how):
    document = yaml.safe_load(wires.config.read_text())
    how(document)
    wires.config.write_text(dumped(document))


def test_the_same_file_again_changes_nothing(tmp_path, figure):
    """A comment more, or nothing: no new part, and the estimate goes on to the bit."""
    with service(tmp_path, driven(40.0, 1, skip=1.0)) as (wires, daemon):
        daemon.wait_status(
            lambda report: report["status"] == "TRACKING" and report["tick"]["updates"] > 5
        )
        daemon.signal(signal.SIGHUP)
        daemon.heard("unchanged")
        wires.config.write_text("# looked at\n" + wires.config.read_text())
        daemon.signal(signal.SIGHUP)
        daemon.heard("unchanged", 2)
        time.sleep(0.5)
        daemon.stop()
    parts = len(recordings(daemon.path())) - 1
    figure(
        "SIGHUP with good YAML",
        WIRES,
        "parts of the recording begun for the same file",
        parts,
        "",
        0,
    )
    assert verified(daemon.path())


MISREAD = {
    "unsafe tag": ("testbed: !!python/object/apply:os.system [id]", "tag"),
    "duplicate key": ("testbed: a\ntestbed: b", "expected each key once"),
    "1e3 as text": (TESTBED.text.replace("gate: 5.0", "gate: 1e3"), "reads as text"),
    "no as false": (TESTBED.text.replace("compression: zstd", "compression: no"), "false"),
    "NaN": (TESTBED.text.replace("gate: 5.0", "gate: .nan"), "found .nan"),
}


@pytest.mark.parametrize("name", [*HOSTILE, *MISREAD])
def test_hostile_and_misread_files(name, figure):
    text, words = {**HOSTILE, **MISREAD}[name]
    tracemalloc.start()
    with pytest.raises(ConfigError) as error:
        loads(text, "rig.yaml")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "\n" not in str(error.value) and words in str(error.value)
    spent = min(processor_time(text) for _ in range(3))
    figure(
        BOMB,
        "configuration reader",
        "processor time to the refusal",
        spent * 1e3,
        "ms",
        100,
        real=True,
    )
    figure(BOMB, "configuration reader", "memory", peak / 1e6, "MB", 16)


def processor_time(text):
    start = time.thread_time()
    with pytest.raises(ConfigError):
        loads(text, "rig.yaml")
    return time.thread_time() - start
