"""From the bytes of a message to its fields, by the definition that stands in its file; needs
rosbags, but for JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

Decoder = Callable[[bytes], Any]
MSG, IDL = ("ros1msg", "ros2msg"), ("ros2idl",)
PART = "=" * 80 + "\n"  # stands before each type that a definition needs
READ = "ros1, cdr (ros2msg, ros2idl) and json"


class Undecodable(Exception):
    """Messages cannot be decoded; the message says of what kind they are, and what is read."""


def decoder(kind: str, encoding: str, schema: str, text: str, own: Mapping[str, str]) -> Decoder:
    """What decodes messages of a type.

    kind: the type's name, package/msg/Name. encoding: of messages, as MCAP names it. schema: of the
    definition `text`. own: further definitions by name, where the file has none. What it returns
    raises ValueError at bytes that are no such message. Raises Undecodable.
    """
    if encoding == "json":
        return json.loads
    if encoding not in ("cdr", "ros1"):
        raise Undecodable(
            f"found messages in {encoding[:20] or 'no encoding'}; expected {READ}; or the topic "
            "saved as CSV, as PlotJuggler can"
        )

    try:
        store, name = _store(kind, schema, text, own)
    except Undecodable:
        raise
    except Exception as error:  # of a definition that is none
        reason = " ".join(str(error).split())[:100]
        raise Undecodable(f"the definition of {kind} cannot be read: {reason}") from None
    read = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    return lambda data: _decoded(read, data, name)


def _decoded(read: Callable[[bytes, str], Any], data: bytes, name: str) -> Any:
    try:
        return read(data, name)
    except Exception as error:  # rosbags raises many kinds at bytes that do not fit
        raise ValueError(f"no {name}: {error}") from None


def _store(kind: str, schema: str, text: str, own: Mapping[str, str]) -> tuple[Any, str]:
    """The types that a definition speaks of, and the name of its own."""
    types = import_module("rosbags.typesys")
    name = kind if "/msg/" in kind else kind.replace("/", "/msg/", 1)

    if schema in MSG:
        found = types.get_types_from_msg(text, name)
    elif schema in IDL:
        found = _of_idl(text)
    else:
        return _known(name, own), name

    store = types.get_typestore(types.Stores.EMPTY)
    store.register(found)
    return store, name


def _of_idl(text: str) -> dict[str, Any]:
    types = import_module("rosbags.typesys")
    parts = text.split(PART)[1:] if text.startswith(f"{PART}IDL: ") else [f"IDL:\n{text}"]
    return {
        k: v for part in parts for k, v in types.get_types_from_idl(part.split("\n", 1)[1]).items()
    }


def _known(name: str, own: Mapping[str, str]) -> Any:
    """The types that come with ROS 2, and further ones. Raises Undecodable."""
    types = import_module("rosbags.typesys")
    store = types.get_typestore(types.Stores.LATEST)
    found: dict[str, Any] = {}
    for other, text in own.items():
        found |= types.get_types_from_msg(text, other)
    store.register({key: value for key, value in found.items() if key not in store.fielddefs})

    if name not in store.fielddefs:
        package, _, last = name.rpartition("/msg/")
        raise Undecodable(
            f"the bag does not define {name}; expected {package}/msg/{last}.msg beside the bag"
        )
    return store
