"""The topics of a recording: names, message types and fields. See docs/recording.md."""

from __future__ import annotations

from collections.abc import Iterator

from gritd.estimator.messages.readings import WRENCH_FIELDS
from gritd.estimator.messages.tick import LOOP_FIELDS, TICK_FIELDS, TickRow
from gritd.estimator.messages.update import UPDATE_FIELDS, update_of
from gritd.estimator.recording.cdr import STRING, TIME, Field, Topic

_STAMP: Field = ("stamp", TIME, "when the sample was taken")


def _raw(channel: str, schema: str, *fields: Field) -> Topic:
    return Topic(f"/raw/{channel}", f"gritd_msgs/msg/{schema}", (_STAMP, *fields))


_COUNT: Field = ("count", "int64", "encoder counts as read, unwrapped")
_VOLTS: Field = ("volts", "float64", "as read by the ADC [V]")
_FORCE = ("drawbar pull", "lateral force", "vertical load")

RAW_TOPICS: tuple[Topic, ...] = (
    _raw("wheel_encoder", "EncoderCount", _COUNT),
    _raw("carriage_encoder", "EncoderCount", _COUNT),
    _raw("sinkage_pot", "Voltage", _VOLTS),
    _raw("motor_shunt", "Voltage", _VOLTS),
    _raw(
        "wrench",
        "Wrench",
        *(
            (name, "float64", f"{doc} [N]")
            for name, doc in zip(WRENCH_FIELDS[:3], _FORCE, strict=True)
        ),
        *((name, "float64", f"moment about {name[1]} [N·m]") for name in WRENCH_FIELDS[3:]),
    ),
    _raw(
        "motor_temperature",
        "Temperature",
        ("celsius", "float64", "winding or housing temperature [°C]"),
    ),
)

# Text for people; the ROS log message, so that Foxglove's and rqt's log panels show it.
LOG_TOPIC = Topic(
    "/log",
    "rcl_interfaces/msg/Log",
    (
        ("stamp", TIME, ""),
        ("level", "uint8", "10 debug, 20 info, 30 warning, 40 error, 50 fatal"),
        ("name", "string", "who says it"),
        ("msg", "string", ""),
        ("file", "string", ""),
        ("function", "string", ""),
        ("line", "uint32", ""),
    ),
)

TICK_TOPIC = Topic("/tick", "gritd_msgs/msg/Tick", TICK_FIELDS)
UPDATE_TOPIC = Topic("/update", "gritd_msgs/msg/Update", UPDATE_FIELDS)
LOOP_TOPIC = Topic("/loop", "gritd_msgs/msg/Loop", LOOP_FIELDS)
CHECKPOINT_TOPIC = Topic(
    "/checkpoint",
    "gritd_msgs/msg/Checkpoint",
    (
        ("stamp", TIME, "time of the tick before"),
        ("configuration", STRING, "effective YAML from here on"),
        ("state", STRING, "what the next tick begins with: estimator/online/checkpoint.py"),
    ),
)

TOPICS = (
    TICK_TOPIC,
    LOOP_TOPIC,
    CHECKPOINT_TOPIC,
    UPDATE_TOPIC,
)  # in addition to the raw ones and /log
TICK, CHECKPOINT = TICK_TOPIC.name, CHECKPOINT_TOPIC.name


def messages_of(tick: TickRow) -> Iterator[tuple[str, int, TickRow]]:
    """What is recorded of a tick, itself and the update it made: topic, log time [ns], values."""
    stamp = int(tick[0])
    yield TICK, stamp, tick
    if (update := update_of(tick)) is not None:
        yield UPDATE_TOPIC.name, stamp, update
