"""The configuration: what is refused, and in which words."""

from __future__ import annotations

import re
import time
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from tests.estimator.config.rig import HOSTILE, MINIMAL, changed, message

TESTBED = packaged().read_text(encoding="utf-8")


# (old, new, line, key path, words that must stand in the message)
REFUSED = [
    (
        "radius: 72 mm",
        "radius: -72 mm",
        2,
        "wheel.radius",
        "found -72 mm; expected a quantity in m above 0 m",
    ),
    ("radius: 72 mm", "radius: 72", 2, "wheel.radius", "expected a quantity in m"),
    ("radius: 72 mm", "radius: 72 N", 2, "wheel.radius", "found 72 N"),
    ("radius: 72 mm", "radius: .nan", 2, "wheel.radius", "found .nan"),
    ("radius: 72 mm", "radius: .inf m", 2, "wheel.radius", "found .inf m"),
    ("radius: 72 mm", "radius: [72 mm]", 2, "wheel.radius", "found a list of 1"),
    ("radius: 72 mm", "radius: ", 2, "wheel.radius", "found nothing"),
    ("radius: 72 mm", "raduis: 72 mm", 2, "wheel.raduis", "did you mean radius?"),
    (
        "radius: 72 mm",
        "radius: 72 mm, radius: 73 mm",
        2,
        "wheel.radius",
        "the key again (first on line 2)",
    ),
    ("width: 71 mm", "width: 0 mm", 2, "wheel.width", "above 0 m"),
    ("tan_phi: 0.6", "tan_phi: [0.6]", 6, "soil.tan_phi", "found a list of 1; expected a number"),
    (
        "scale: 25 mm/V",
        "scale: 0 mm/V",
        18,
        "channels.sinkage_pot.scale",
        "expected a scale other than 0",
    ),
    (
        "scale: 25 mm/V",
        "scale: {value: 25 mm/V, sigma: 26 mm/V}",
        18,
        "channels.sinkage_pot.scale.sigma",
        "expected no more than the scale itself",
    ),
    ("radius: 72 mm", 'radius: ""', 2, "wheel.radius", "found empty text"),
    ("pulley_radius: 20 mm\n", "", 1, "pulley_radius", "found nothing"),
    ("sigma: 300 Pa", "sigma: -300 Pa", 5, "soil.cohesion.sigma", "from 0 Pa"),
    ("sigma: 300 Pa", "sigma: 300 N", 5, "soil.cohesion.sigma", "found 300 N"),
    (", sigma: 300 Pa", "", 5, "soil.cohesion.sigma", "found nothing"),
    ("tan_phi: 0.6", "tan_phi: 30 deg", 6, "soil.tan_phi", "expected a number"),
    (
        "tan_phi: 0.6",
        "tan_phi: 6e1",
        6,
        "soil.tan_phi",
        "which YAML reads as text; expected a number",
    ),
    ("tan_phi: 0.6", "tan_phi: '0.6'", 6, "soil.tan_phi", "without quotes"),
    ("tan_phi: 0.6", "tan_phi: 2.0", 6, "soil.tan_phi", "inside filter.tan_phi_bounds"),
    ("tan_phi: 0.6", "tan_phi: no", 6, "soil.tan_phi", "found no, which YAML reads as false"),
    ("tan_phi: 0.6", "tan_phi: 1:30", 6, "soil.tan_phi", "found 1:30"),
    ("  k1: 0 kPa\n", "", 4, "soil.k1", "k_c and k_phi or k1 and k2"),
    ("  k1: 0 kPa\n  k2: 1500 kN/m^3\n", "", 4, "soil.k_c", "k_c and k_phi or k1 and k2"),
    ("  k1: 0 kPa\n", "  k1: 0 kPa\n  k_c: 0 kN/m^(n+1)\n", 9, "soil.k1", "in one form"),
    ("k2: 1500 kN/m^3", "k2: -1500 kN/m^3", 10, "soil.k2", "positive pressure"),
    ("load: {nominal: 70 N}", "load: {nominal: 4 N}", 12, "load.minimum", "less than load.nominal"),
    ("kind: serial", "kind: serail", 14, "devices.rig.kind", "did you mean serial?"),
    ("kind: serial, ", "", 14, "devices.rig.kind", "one of serial, can"),
    ("port: /dev/ttyACM0", "port: 3", 14, "devices.rig.port", "in quotes"),
    (
        "port: /dev/ttyACM0",
        "port: /dev/ttyACM0, baud: 12.5",
        14,
        "devices.rig.baud",
        "a whole number",
    ),
    (
        "kind: serial, port: /dev/ttyACM0",
        "kind: can",
        14,
        "devices.rig.dbc",
        "either a CAN database or signals",
    ),
    (
        "device: rig, signal: wheel",
        "device: rigg, signal: wheel",
        16,
        "channels.wheel_encoder.device",
        "found rigg",
    ),
    ("scale: 25 mm/V", "scale: 25 A/V", 18, "channels.sinkage_pot.scale", "found 25 A/V"),
    ("scale: 25 mm/V", "scale: 0 mm/V", 18, "channels.sinkage_pot.scale", "a scale other than 0"),
    (
        "z, scale: 25 mm/V, noise: 2 mV, range: [0 V, 5 V]",
        "z, scale: 25 mm/V, noise: 2 mV, range: [5 V, 0 V]",
        18,
        "channels.sinkage_pot.range",
        "found [5 V, 0 V]; expected the low end below",
    ),
    (
        "scale: 2 A/V, noise: 2 mV",
        "scale: 2 A/V, noise: 2 mV, latency: 60 ms",
        19,
        "channels.motor_shunt.latency",
        "less than rates.horizon",
    ),
    (
        "25 mm/V, noise: 2 mV",
        "25 mm/V, noise: 0 mV",
        18,
        "channels.sinkage_pot.noise",
        "found 0 mV; expected",
    ),
    (
        "25 mm/V, noise: 2 mV",
        "25 mm/V, noise: 1e-200 V",
        18,
        "channels.sinkage_pot.noise",
        "above 1e-09 V",
    ),
    (
        "0.1 mrad/count, noise: 0.3 count",
        "0.1 mrad/count, noise: 0 count",
        16,
        "channels.wheel_encoder.noise",
        "above",
    ),
    (
        "0.1 mrad/count, noise",
        "0.1 mrad/count, range: [0 count, 9 count], noise",
        16,
        "channels.wheel_encoder.range",
        "found a list of 2; expected unlimited: no count is impossible",
    ),
    (
        "25 mm/V, noise",
        "25 mm/V, max_rate: 3 V/s, noise",
        18,
        "channels.sinkage_pot.max_rate",
        "found 3 V/s; expected unlimited: only an encoder's counts can jump",
    ),
    (
        "drive: {torque_constant: 2 N*m/A}",
        "drive: {torque_constant: 2 N*m/A, torque_source: wrench}",
        11,
        "drive.torque_source",
        "there is no channel wrench",
    ),
    (
        "testbed: bench",
        "testbed: off",
        1,
        "testbed",
        "found off, which YAML reads as false; expected a name in quotes",
    ),
    ("testbed: bench", "testbed: *x", 1, "testbed", "without anchors and aliases"),
    ("testbed: bench", "testbed: &x bench", 1, "testbed", "found &x"),
    (
        "testbed: bench",
        "testbed: !!python/object/apply:os.system [echo]",
        1,
        "testbed",
        "a value without a tag",
    ),
    ("testbed: bench", "testbed: !x bench", 1, "testbed", "found the tag !x"),
    ("testbed: bench", "testbed: 'bench", 1, "testbed", "found unexpected end of stream"),
    ("testbed: bench", "testbed: bench\n<<: {wheel: 1}", 2, "<<", "an unknown key"),
    ("testbed: bench", "? [a]\n: b", 1, "document", "a list or mapping as a key"),
]


@pytest.mark.parametrize(("old", "new", "line", "path", "words"), REFUSED)
def test_refusal_names_line_key_found_and_expected(
    old: str, new: str, line: int, path: str, words: str
) -> None:
    text = message(changed(old, new))
    assert text.startswith(f"rig.yaml:{line}: {path}: found ")
    assert "; expected " in text and words in text


APPENDED = [
    (
        "rates: {tick: 250 Hz, update: 12 Hz}",
        "rates.tick",
        "a whole multiple of rates.update (12 Hz)",
    ),
    ("rates: {tick: 10 Hz, update: 10 Hz}", "rates.tick", "at least twice it"),
    ("rates: {horizon: 5 s}", "rates.horizon", "to 1 s"),
    ("rates: {horizon: 0 s}", "rates.horizon", "above 0 s"),
    ("filter: {cohesion_bounds: [9 kPa, 1 kPa]}", "filter.cohesion_bounds", "the low end below"),
    ("filter: {cohesion_bounds: [9 kPa]}", "filter.cohesion_bounds", "[low, high]"),
    ("filter: {engine: plane}", "filter.engine", "did you mean plain?"),
    (
        "logging: {compression: off}",
        "logging.compression",
        "found off, which YAML reads as false; expected one of zstd",
    ),
    ("logging: {directory: }", "logging.directory", "found nothing"),
    ("effects: {bulldozing: [1]}", "effects.bulldozing", "a mapping of parameters"),
    ("effects: {bulldozing: {share: 1 parsec}}", "effects.bulldozing.share", "unknown unit"),
    (
        "effects: {stress_linearisation: {share: 7}}",
        "effects.stress_linearisation.share",
        "found 7; expected a number",
    ),
    (
        "effects: {stress_linearisation: {share: {value: -1, sigma: 0}}}",
        "effects.stress_linearisation.share.value",
        "found -1; expected a number from 0",
    ),
    ("efects: {}", "efects", "did you mean effects?"),
    ("run: {pass: 0}", "run.pass", "from 1"),
    ("---\na: 1", "document", "one document a file"),
    ("\x07", "document", "printable UTF-8 text"),
]


@pytest.mark.parametrize(("tail", "path", "words"), APPENDED)
def test_refusal_of_what_is_added(tail: str, path: str, words: str) -> None:
    text = message(MINIMAL + tail + "\n")
    assert re.match(rf"rig\.yaml:(20|21): {re.escape(path)}: found ", text) and words in text


def test_every_required_channel_is_missed() -> None:
    for name in ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt"):
        text = re.sub(rf"  {name}: .*\n", "", MINIMAL)
        assert message(text).startswith(
            f"rig.yaml:15: channels.{name}: found nothing; expected a mapping"
        )


@pytest.mark.parametrize("noise", ["force_noise: 0.3 N", "torque_noise: 20 mN*m"])
def test_an_exact_wrench_is_refused(noise: str) -> None:
    name, _, quantity = noise.partition(": ")
    line = message(changed(noise, f"{name}: 0 {quantity.split()[1]}", TESTBED))
    assert f"channels.wrench.{name}: found 0 " in line and "above 1e-09 N" in line


def test_a_file_that_marks_its_beginning_marks_its_end() -> None:
    assert config.loads(f"# mine\n---\n{MINIMAL}...\n# done\n", "rig.yaml").ended
    text = message(f"# mine\n---\n{MINIMAL}")
    assert text.startswith("rig.yaml:22: document: found the end of the file; expected '...'")


def test_a_file_by_hand_needs_its_end_for_a_reload_only(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(MINIMAL)
    assert not config.load(path).ended
    with pytest.raises(ConfigError, match=r":20: document: found no end; expected '\.\.\.' as"):
        config.reload(path)
    path.write_text(MINIMAL + "...\n")
    assert config.reload(path) == config.load(path)


def test_an_end_inside_a_value_is_none() -> None:
    text = MINIMAL + 'run: {notes: "... and so on"}\n'
    assert not config.loads(text, "rig.yaml").ended


@pytest.mark.parametrize("text", ["", "\n# nothing\n", "hello", "[1, 2]", "3", "null", "{}"])
def test_not_a_configuration(text: str) -> None:
    assert message(text).startswith("rig.yaml:1: ")


@pytest.mark.parametrize(
    "content",
    [b"\xff\xfe\x00", b"a: \x80", b"\x00", b"x" * 300_000, b"a: 1\n" * 60_000],
    ids=["utf16", "not utf8", "nul", "long", "many lines"],
)
def test_files_that_are_no_text(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(content)
    with pytest.raises(
        ConfigError, match=r"^[^\n]*rig\.yaml[^\n]*: found [^\n]+; expected [^\n]+$"
    ):
        config.load(path)


def test_file_above_the_limit_is_called_so(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(
        "##" + "é" * 200_000, encoding="utf-8"
    )  # the limit falls inside a character
    with pytest.raises(ConfigError, match=r"rig\.yaml: found more than 256 KiB"):
        config.load(tmp_path / "rig.yaml")


def test_missing_file_folder_and_endless_device(tmp_path: Path) -> None:
    for path in (tmp_path / "none.yaml", tmp_path, Path("/dev/zero"), tmp_path / "a\0b"):
        with pytest.raises(ConfigError, match="expected a configuration file"):
            config.load(path)
    with pytest.raises(ConfigError, match="found a directory; expected a configuration file"):
        config.load(tmp_path)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_takes_little_memory(name: str) -> None:
    text, words = HOSTILE[name]
    tracemalloc.start()
    line = message(text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert words in line and peak < 16e6


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_takes_little_time(name: str) -> None:
    """Processor time, the best of three."""
    seconds = min(_seconds(HOSTILE[name][0]) for _ in range(3))
    print(f"{name}: refused in {1e3 * seconds:.1f} ms")
    assert seconds < 0.1


def _seconds(text: str) -> float:
    start = time.thread_time()
    message(text)
    return time.thread_time() - start


@settings(max_examples=150)
@given(st.data())
def test_a_damaged_file_is_read_or_refused_in_one_line(data: st.DataObject) -> None:
    """Any edit of a good file ends in settings or in a ConfigError of one line, never in another
    exception.
    """
    text = MINIMAL
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(text)))
        cut = data.draw(st.integers(0, 6))
        text = text[:at] + data.draw(st.text(max_size=6)) + text[at + cut :]
    try:
        config.loads(text, "rig.yaml")
    except ConfigError as error:
        assert re.fullmatch(r"rig\.yaml:\d+: .+: found .+; expected .+", str(error))
