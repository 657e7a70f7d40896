"""`gritd simulate`: the recording holds what the configured sensors would have sent."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from gritd.config import packaged
from gritd.estimator import effects
from gritd.estimator.config import configuration as config
from gritd.estimator.config.yamltree import ConfigError
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import CommandError
from gritd.tools.commands.simulate import main
from gritd.tools.testbed import schedule as schedules
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import simulate_run, soil_of

SHORT = """
ramp: 200 ms
segments:
  - {duration: 1 s, load: 40 N, slip: 0.1, speed: 0 mm/s}
  - {duration: 2 s, load: 40 N, slip: 0.2, speed: 20 mm/s}
  - {duration: 2 s, load: 80 N, slip: 0.5, speed: 20 mm/s}
  - {duration: 1 s, load: 60 N, slip: -0.1, speed: -20 mm/s}
  - {duration: 1 s, load: 0 N, slip: 0.5, speed: 20 mm/s}
"""


@pytest.fixture
def schedule(tmp_path: Path) -> Path:
    path = tmp_path / "schedule.yaml"
    path.write_text(SHORT)
    return path


def messages(path: Path) -> dict[str, list[object]]:
    """Messages by topic, read by another library than ours."""
    found: dict[str, list[object]] = {}
    with path.open("rb") as stream:
        for _, channel, _, message in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found.setdefault(channel.topic, []).append(message)
    return found


def test_recording_holds_the_truth_through_the_calibration(schedule: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.mcap"
    assert (
        main(["--schedule", str(schedule), "--effect", "coulomb_friction.loss=0.5", "-o", str(out)])
        == 0
    )

    settings = config.load(packaged()).settings
    truth, found = np.load(tmp_path / "run.truth.npz"), messages(out)

    for name, expected in (
        ("wheel_encoder", truth["wheel_angle"]),
        ("carriage_encoder", truth["carriage_position"] / settings.pulley_radius),
        ("sinkage_pot", truth["sensed_sinkage"]),
        ("motor_shunt", truth["sensed_current"]),
    ):
        channel = settings.channels[name]
        raw = np.array(
            [getattr(m, "count", None) or getattr(m, "volts", 0.0) for m in found[f"/raw/{name}"]]
        )
        error = raw * channel.calibration.scale.value + channel.calibration.offset.value - expected
        # an encoder's includes rounding
        expected_spread = abs(channel.calibration.scale.value) * channel.noise
        assert np.std(error) == pytest.approx(expected_spread, rel=0.1), name
        assert abs(np.mean(error)) < 5.0 * expected_spread / np.sqrt(raw.size)

    wrench = found["/raw/wrench"]
    assert np.mean([m.fz for m in wrench] - truth["sensed_load"]) == pytest.approx(0.0, abs=0.05)  # type: ignore[attr-defined]
    assert np.mean([m.ty for m in wrench] - truth["sensed_torque"]) == pytest.approx(0.0, abs=0.005)  # type: ignore[attr-defined]


def test_truth_names_soil_effects_and_seed(schedule: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.mcap"
    options = [
        "--effect",
        "coulomb_friction.loss=1800 mN*m",
        "--soil",
        "cohesion=1.2 kPa",
        "--seed",
        "4",
    ]
    main(["--schedule", str(schedule), *options, "-o", str(out)])
    truth = json.loads((tmp_path / "run.truth.json").read_text())

    assert truth["effects"] == {"coulomb_friction": {"loss": 1.8}}
    assert truth["soil"]["cohesion"] == 1200.0 and truth["seed"] == 4


def test_what_is_on_line_alone_is_not_part_of_the_truth(schedule: Path, tmp_path: Path) -> None:
    assert "stress_linearisation" in packaged().read_text(encoding="utf-8")
    main(["--schedule", str(schedule), "-o", str(tmp_path / "run.mcap")])
    assert json.loads((tmp_path / "run.truth.json").read_text())["effects"] == {}


def test_the_recording_does_not_tell_the_effect(schedule: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.mcap"
    main(["--schedule", str(schedule), "--effect", "rear_contact.ratio=0.3", "-o", str(out)])
    assert b"rear_contact" not in out.read_bytes()


def test_same_seed_same_bytes(schedule: Path, tmp_path: Path) -> None:
    for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        main(["--schedule", str(schedule), "--seed", seed, "-o", str(tmp_path / f"{name}.mcap")])
    first, again, other = (
        messages(tmp_path / f"{name}.mcap")["/raw/sinkage_pot"] for name in "abc"
    )
    volts = [[m.volts for m in run] for run in (first, again, other)]  # type: ignore[attr-defined]
    assert volts[0] == volts[1] and volts[0] != volts[2]


def test_motion_follows_the_schedule() -> None:
    schedule = Schedule((Segment(4.0, 50.0, 0.25, 0.02), Segment(4.0, 80.0, -0.2, -0.03)), 0.5)
    motion = motion_of(schedule, 0.1, 100.0)
    early, late = 100, -100

    assert motion.wheel_speed[early] == pytest.approx(0.2) and motion.carriage_speed[
        early
    ] == pytest.approx(0.015)
    assert motion.wheel_speed[late] == pytest.approx(-0.3) and motion.carriage_speed[
        late
    ] == pytest.approx(-0.0375)
    assert motion.load[early] == 50.0 and motion.load[late] == 80.0
    np.testing.assert_allclose(
        np.gradient(motion.wheel_angle, motion.time)[1:-1], motion.wheel_speed[1:-1], atol=5e-3
    )


def test_packaged_schedule_drives_three_loads_and_five_slips() -> None:
    schedule = schedules.read(packaged("schedule.yaml"))
    driving = [s for s in schedule.segments if s.speed > 0.0]
    assert {s.load for s in driving} == {40.0, 70.0, 100.0} and len({s.slip for s in driving}) == 5


def test_library_call_gives_readings_in_order_of_receipt() -> None:
    settings = config.load(packaged()).settings
    motion = motion_of(
        Schedule((Segment(1.0, 50.0, 0.2, 0.02),), 0.1), settings.wheel.radius, 250.0
    )
    run = simulate_run(
        settings,
        soil_of(settings),
        motion,
        [effects.make("sinkage_datum", {"offset": 0.001})],
        seed=1,
    )
    received = [reading.received for reading in run.readings]

    assert received == sorted(received) and len(received) == 5 * 250 + 1
    assert all(reading.received > reading.stamp for reading in run.readings)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("segments: []", "segments: found a list of 0; expected a list of segments"),
        (
            "segments:\n  - {duration: 1 s, load: 40 N, slip: 2, speed: 0 m/s}",
            ":2: segments.0.slip: found 2",
        ),
        ("segments:\n  - {duration: 1 s, load: 40 N, slip: 0.1}", "speed: found nothing"),
        ("segments:\n  - {duration: 1 s, load: 40, slip: 0.1, speed: 0 m/s}", "load: found 40"),
        ("parts: 3", "found an unknown key"),
    ],
)
def test_wrong_schedule_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        schedules.read(path)
    assert (
        str(error.value).startswith(str(path))
        and said in str(error.value)
        and "\n" not in str(error.value)
    )


def test_what_is_no_schedule_file_is_said_in_words(tmp_path: Path) -> None:
    (tmp_path / "photo.png").write_bytes(b"\x89PNG\xff")
    for name, said in (
        (".", "found a directory; expected a schedule file"),
        ("photo.png", "found a byte that is not UTF-8; expected UTF-8 text"),
        ("no.yaml", "found no such file or directory; expected a schedule file"),
        ("/dev/zero", "found something that is no regular file; expected a schedule file"),
    ):
        with pytest.raises(ConfigError) as error:
            schedules.read(tmp_path / name)
        assert str(error.value).endswith(said)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ["--effect", "gremlins.size=3"],
            "--effect gremlins.size=3: found 'gremlins'; expected one of",
        ),
        (
            ["--effect", "coulomb_friction"],
            "found no parameter; expected coulomb_friction.PARAMETER=VALUE, PARAMETER one of "
            "loss [N·m], as in coulomb_friction.loss=0.8",
        ),
        (
            ["--effect", "bulldozing.=3"],
            "one of share, unit_weight [N/m^3], as in bulldozing.share=",
        ),
        (["--effect", "coulomb_friction.loss"], "found no value; expected coulomb_friction.PARAM"),
        (["--effect", "rear_contact.c3=0.2"], "found 'c3'; expected one of ratio"),
        (["--effect", "rear_contact.ratio=9"], "9 is outside 0 … 1"),
        (["--effect", "coulomb_friction.loss=2 mm"], "found '2 mm'"),
        (["--effect", "coulomb_friction.loss=much"], "found 'much'"),
        (["--soil", "moisture=3"], "found 'moisture'; expected one of cohesion"),
        (["--soil", "cohesion=-3"], "found -3; expected a quantity in Pa from 0 Pa to 1e+06 Pa"),
        (
            ["--soil", "cohesion=1e300 Pa"],
            "found 1e300 Pa; expected a quantity in Pa from 0 Pa to 1e+06 Pa",
        ),
        (["--soil", "tan_phi=0"], "found 0; expected a number above 0 up to 5"),
        (["--soil", "modulus_factor=1e9"], "found 1e9; expected a number above 0 up to 100"),
    ],
)
def test_wrong_option_is_one_line(tmp_path: Path, options: list[str], said: str) -> None:
    with pytest.raises(CommandError) as error:
        main([*options, "-o", str(tmp_path / "x.mcap")])
    assert said in str(error.value) and "\n" not in str(error.value)
    assert not (tmp_path / "x.mcap").exists()


@pytest.mark.parametrize(("second", "stated"), [(60.0, 60.0), (80.0, None)])
def test_a_run_at_one_load_states_it(second: float, stated: float | None, tmp_path: Path) -> None:
    """Else a diagnosis would take the configuration's nominal load for the run's."""
    path = tmp_path / "schedule.yaml"
    segment = "  - {{duration: 1 s, load: {} N, slip: 0.1, speed: 20 mm/s}}\n"
    path.write_text("segments:\n" + segment.format(60) + segment.format(second))
    assert main(["--schedule", str(path), "-o", str(tmp_path / "run.mcap")]) == 0
    assert read(tmp_path / "run.mcap").run.nominal_load == stated


def test_a_recording_drives_it_again(schedule: Path, tmp_path: Path) -> None:
    """The run simulated from the measured motion of a run feels what that run felt."""
    main(["--schedule", str(schedule), "-o", str(tmp_path / "first.mcap")])
    main(["--motion", str(tmp_path / "first.mcap"), "-o", str(tmp_path / "again.mcap")])
    first, again = (np.load(tmp_path / f"{name}.truth.npz") for name in ("first", "again"))
    driving = (again["time"] > 1.5) & (again["time"] < 4.8)
    expected = np.interp(again["time"], first["time"], first["torque"])
    assert np.sqrt(np.mean((again["torque"] - expected)[driving] ** 2)) < 0.05


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--seed", "-1"], "argument --seed: found '-1'; expected a whole number from 0"),
        (["--pass", "-3"], "argument --pass: found '-3'; expected a whole number from 1 to 1000"),
        (["--pass", "0"], "found '0'"),
        (["--pass", "9999999999999999"], "found '9999999999999999'"),
    ],
)
def test_impossible_numbers_are_usage(
    options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main([*options, "-o", str(tmp_path / "x.mcap")])
    streams = capsys.readouterr()
    assert stop.value.code == 2 and streams.out == ""
    assert (
        said in streams.err and streams.err.count("\n") == 1 and not (tmp_path / "x.mcap").exists()
    )


def test_a_file_in_the_way_stays_as_it_is(schedule: Path, tmp_path: Path) -> None:
    (tmp_path / "taken.mcap").write_bytes(b"mine")
    with pytest.raises(CommandError, match=r"taken\.mcap: is there already") as error:
        main(["--schedule", str(schedule), "-o", str(tmp_path / "taken.mcap")])
    assert error.value.code == 2 and (tmp_path / "taken.mcap").read_bytes() == b"mine"
    assert not (tmp_path / "taken.truth.json").exists()


def test_a_motion_that_is_missing_or_no_recording_is_told_apart(tmp_path: Path) -> None:
    (tmp_path / "photo.png").write_bytes(b"\x89PNG" + bytes(500))
    for name, code in (("nowhere.mcap", 2), ("photo.png", 3), (".", 3)):
        with pytest.raises(CommandError) as error:
            main(["--motion", str(tmp_path / name), "-o", str(tmp_path / "x.mcap")])
        assert error.value.code == code and str(error.value).startswith(str(tmp_path / name))


def test_a_run_too_long_for_memory_is_refused_before_it_is_made(tmp_path: Path) -> None:
    path = tmp_path / "day.yaml"
    path.write_text("segments:\n  - {duration: 24 h, load: 40 N, slip: 0.2, speed: 20 mm/s}")

    with pytest.raises(
        CommandError,
        match=r"day\.yaml: found 86400 s, 21600000 samples at 250 Hz; expected at most",
    ):
        main(["--schedule", str(path), "-o", str(tmp_path / "x.mcap")])

    writer = RunWriter(tmp_path / "day.mcap", (), "", RunInfo())

    for channel, value in (
        ("wheel_encoder", 1),
        ("carriage_encoder", 1),
        ("sinkage_pot", 1.0),
        ("motor_shunt", 2.5),
    ):
        for stamp in (0, 86_400_000_000_000):
            writer.reading(Reading(stamp, channel, value, stamp))

    writer.close()
    with pytest.raises(CommandError, match=r"day\.mcap: found 86400 s, 21600000 samples") as error:
        main(["--motion", str(tmp_path / "day.mcap"), "-o", str(tmp_path / "x.mcap")])
    assert error.value.code == 2
