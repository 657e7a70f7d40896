"""From the bytes of a message to its fields, by the definition that stands in its file; needs
rosbags, or protobuf, but for JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

Decoder = Callable[[bytes], Any]
MSG, IDL = ("ros1msg", "ros2msg"), ("ros2idl",)
PART = "=" * 80 + "\n"  # stands before each type that a definition needs
READ = "ros1, cdr (ros2msg, ros2idl), protobuf and json"


class Undecodable(Exception):
    """Messages cannot be decoded; the message says of what kind they are, and what is read."""


def decoder(
    kind: str, encoding: str, schema: str, definition: bytes, own: Mapping[str, str]
) -> Decoder:
    """What decodes messages of a type.

    kind: the type's name, package/msg/Name. encoding: of messages, as MCAP names it. schema: of the
    definition. own: further definitions by name, where the file has none. What it returns
    raises ValueError at bytes that are no such message. Raises Undecodable.
    """
    if encoding == "json":
        return json.loads
    if encoding == schema == "protobuf":
        return _of_protobuf(kind, definition)
    if encoding not in ("cdr", "ros1"):
        raise Undecodable(
            f"found messages in {encoding[:20] or 'no encoding'}; expected {READ}; or the topic "
            "saved as CSV, as PlotJuggler can"
        )

    try:
        store, name = _store(kind, schema, definition.decode(errors="replace"), own)
    except Undecodable:
        raise
    except Exception as error:  # of a definition that is none
        raise _no_definition(kind, error) from None
    read = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    return lambda data: _decoded(read, data, name)


def _no_definition(kind: str, error: Exception) -> Undecodable:
    reason = " ".join(str(error).split())[:100]
    return Undecodable(f"the definition of {kind} cannot be read: {reason}")


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


# --- protobuf ---


def _of_protobuf(kind: str, definition: bytes) -> Decoder:
    """definition: a FileDescriptorSet. Raises Undecodable."""
    try:
        sets = import_module("google.protobuf.descriptor_pb2").FileDescriptorSet
        pool = import_module("google.protobuf.descriptor_pool").DescriptorPool()
        class_of = import_module("google.protobuf.message_factory").GetMessageClass
    except ImportError:
        install = "pip install 'gritd[formats]'"
        raise Undecodable(f"found no protobuf; expected it installed: {install}") from None

    try:
        files = {file.name: file for file in sets.FromString(definition).file}
        for name in list(files):
            _add(pool, files, name)
        message = class_of(pool.FindMessageTypeByName(kind))
    except Exception as error:  # of a definition that is none
        raise _no_definition(kind, error) from None
    return lambda data: _plain(_decoded(lambda body, _: message.FromString(body), data, kind))


def _add(pool: Any, files: dict[str, Any], name: str) -> None:
    """Add a file after those that it needs."""
    file = files.pop(name, None)
    if file is not None:
        for other in file.dependency:
            _add(pool, files, other)
        pool.AddSerializedFile(file.SerializeToString())


def _plain(value: Any) -> Any:
    """A message as a dictionary of its fields; parts that it does not hold are left out."""
    if hasattr(value, "DESCRIPTOR"):
        fields = [field.name for field in value.DESCRIPTOR.fields]
        there = {field.name for field, _ in value.ListFields()}
        found = {name: getattr(value, name) for name in fields}
        return {
            name: _plain(each)
            for name, each in found.items()
            if name in there or not hasattr(each, "DESCRIPTOR")
        }
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [_plain(each) for each in value]
    return value
