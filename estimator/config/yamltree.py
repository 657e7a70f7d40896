"""Strict YAML: text → a tree of nodes that remember their line, refusing what a configuration
never needs.

PyYAML's parser makes the events; the tree is built here because PyYAML overlooks duplicate keys,
follows aliases (a few lines can unfold to gigabytes), builds objects from tags and forgets the
lines. Scalars stay text: the schema decides what they are, and `tag` says what YAML would have
made of them. Loads in a few milliseconds, unlike the schema.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

MAX_BYTES = 256 * 1024
MAX_DEPTH = 20
MAX_NODES = 5000
TOO_DEEP = f"nesting deeper than {MAX_DEPTH}"
PARSERS_DEPTH = "maximum nesting depth"  # PyYAML from 6.0.4 on has a limit too, deeper than ours

# A text that is cut anywhere must not pass for a whole one: see docs/decisions/0008.
CLOSING = "'...' as the last line, since the first is '---'"
_WRITTEN: dict[str, Any] = {"allow_unicode": True, "explicit_start": True, "explicit_end": True}
_PARSER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_RESOLVER: Any = yaml.resolver.Resolver()


class ConfigError(Exception):
    """One line: `FILE:LINE: key.path: found …; expected …`."""


@dataclass(frozen=True)
class FilePosition:
    """Where in which file: enough to begin an error line."""

    file: str
    line: int
    path: str

    def error(self, found: str, expected: str) -> ConfigError:
        return ConfigError(
            f"{self.file}:{self.line}: {self.path or 'document'}: found {found};"
            f" expected {expected}"
        )

    def key(self, name: str, line: int | None = None) -> FilePosition:
        """The place of a key inside this one."""
        path = f"{self.path}.{name}" if self.path else name
        return FilePosition(self.file, self.line if line is None else line, path)


@dataclass(frozen=True)
class Scalar:
    place: FilePosition
    text: str
    tag: str  # str, int, float, bool, null, timestamp: what YAML reads it as


@dataclass(frozen=True)
class YamlSequence:
    place: FilePosition
    items: tuple[Node, ...]


@dataclass(frozen=True)
class Mapping:
    place: FilePosition
    items: dict[str, Node] = field(default_factory=dict)


Node = Scalar | YamlSequence | Mapping


def shown(text: str) -> str:
    """Text from a file, fit for one line of an error message."""
    clean = "".join(c if c.isprintable() else " " for c in text[:60])
    return clean + ("…" if len(text) > 60 else "")


def describe(node: Node) -> str:
    """What was found, in words."""
    if isinstance(node, YamlSequence):
        return f"a list of {len(node.items)}"
    if isinstance(node, Mapping):
        return "a mapping" if node.items else "an empty mapping"
    if not node.text:
        return "nothing" if node.tag == "null" else "empty text"
    return shown(node.text) + _reading(node)


def _reading(node: Scalar) -> str:
    """What YAML takes a word for, where that surprises."""
    if node.tag == "bool":
        truth = "true" if node.text.lower() in ("yes", "true", "on") else "false"
        return "" if node.text == truth else f", which YAML reads as {truth}"
    kinds = {"null": "nothing", "timestamp": "a date"}
    return f", which YAML reads as {kinds[node.tag]}" if node.tag in kinds else ""


def read_text(path: Path, expected: str = "a configuration file") -> str:
    """Text of a regular file of bounded size; a pipe or a device is refused without waiting for
    it.

    Raises ConfigError, which says what was expected.
    """
    try:
        with open(
            path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)
        ) as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise ConfigError(
                    f"{path}: found something that is no regular file; expected {expected}"
                )
            data = stream.read(MAX_BYTES + 1)
    except IsADirectoryError:
        raise ConfigError(f"{path}: found a directory; expected {expected}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"{path}: found {str(reason).lower()}; expected {expected}") from None

    if len(data) > MAX_BYTES:
        raise ConfigError(f"{path}: found more than {MAX_BYTES // 1024} KiB; expected {expected}")

    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"{path}:{line}: document: found a byte that is not UTF-8; expected UTF-8 text"
        ) from None


def compose(text: str, file: str) -> Node:
    """The tree of a YAML document. Raises ConfigError."""
    top = FilePosition(file, 1, "")
    if len(text.encode("utf-8", "replace")) > MAX_BYTES:
        raise top.error(f"more than {MAX_BYTES // 1024} KiB", "a configuration file")
    return _Composer(text, top).document()


def serialise(node: Node) -> str:
    """YAML text of a tree; composing it again gives the same tree, of a part of it none."""
    return str(yaml.serialize(_yaml(node), width=10_000, **_WRITTEN))


def dumped(document: AnyMapping[str, Any]) -> str:
    """YAML text of a document; a part of it is no configuration."""
    return str(yaml.safe_dump(dict(document), sort_keys=False, width=120, **_WRITTEN))


def is_ended(text: str) -> bool:
    """Whether a document that `compose` took shows its end: it is no part of another."""
    events = yaml.parse(text, Loader=_PARSER)
    return any(_marked(event) for event in events if isinstance(event, yaml.DocumentEndEvent))


def _marked(event: yaml.Event) -> bool:
    """Whether the begin or the end of a document stands in the text, as `---` or `...`."""
    return bool(getattr(event, "explicit", False))


def _yaml(node: Node) -> yaml.Node:
    if isinstance(node, Scalar):
        return yaml.ScalarNode(f"tag:yaml.org,2002:{node.tag}", node.text)
    if isinstance(node, YamlSequence):
        return yaml.SequenceNode(
            "tag:yaml.org,2002:seq", [_yaml(item) for item in node.items], flow_style=True
        )

    pairs = [
        (yaml.ScalarNode("tag:yaml.org,2002:str", key), _yaml(item))
        for key, item in node.items.items()
    ]
    return yaml.MappingNode("tag:yaml.org,2002:map", pairs, flow_style=not pairs)


class _Composer:
    """Events to nodes, with the limits."""

    def __init__(self, text: str, top: FilePosition) -> None:
        self._top = top
        self._place = top  # of the node under way: where a syntax error is reported
        self._count = 0
        self._events = self._guarded(text)

    def document(self) -> Node:
        self._next()  # stream start
        if isinstance(start := self._next(), yaml.StreamEndEvent):
            raise self._top.error("nothing", "a configuration")
        node = self._node(self._next(), self._top, 0)
        end = self._next()
        if _marked(start) and not _marked(end):
            raise self._at(end, self._top).error("the end of the file", CLOSING)
        if not isinstance(second := self._next(), yaml.StreamEndEvent):
            raise self._at(second, self._top).error("a second document", "one document a file")
        return node

    def _guarded(self, text: str) -> Iterator[yaml.Event]:
        """Parser events; every way the parser fails becomes a ConfigError."""
        try:
            yield from yaml.parse(text, Loader=_PARSER)
        except yaml.MarkedYAMLError as error:
            if PARSERS_DEPTH in (error.problem or ""):
                raise self._blamed(error).error(TOO_DEEP, "a configuration") from None
            problem = shown(error.problem or "a syntax error").removeprefix("found ")
            raise self._blamed(error).error(problem, "valid YAML") from None
        except (yaml.YAMLError, UnicodeError):
            line = _unprintable_line(text)
            raise FilePosition(self._top.file, line, "").error(
                "a character YAML forbids", "printable UTF-8 text"
            ) from None

    def _blamed(self, error: yaml.MarkedYAMLError) -> FilePosition:
        """The line of a syntax error; that of the beginning where the end is what is missing."""
        unended = "end of stream" in (error.problem or "") and error.context_mark
        mark = error.context_mark if unended else error.problem_mark
        return FilePosition(
            self._place.file, mark.line + 1 if mark else self._place.line, self._place.path
        )

    def _next(self) -> yaml.Event:
        return next(self._events)

    def _at(self, event: yaml.Event, place: FilePosition) -> FilePosition:
        """The place, on the event's own line."""
        mark = event.start_mark
        return FilePosition(place.file, mark.line + 1 if mark else place.line, place.path)

    def _node(self, event: yaml.Event, place: FilePosition, depth: int) -> Node:
        self._place = place
        self._check(event, place, depth)
        if isinstance(event, yaml.ScalarEvent):
            return Scalar(place, event.value, _tag(event))
        if isinstance(event, yaml.SequenceStartEvent):
            return YamlSequence(place, tuple(self._sequence(place, depth)))
        return self._mapping(place, depth)

    def _check(self, event: yaml.Event, place: FilePosition, depth: int) -> None:
        self._count += 1
        here = self._at(event, place)
        if self._count > MAX_NODES:
            raise here.error(f"more than {MAX_NODES} values", "a configuration")
        if depth > MAX_DEPTH:
            raise here.error(TOO_DEEP, "a configuration")

        anchor, tag = getattr(event, "anchor", None), getattr(event, "tag", None)
        if anchor is not None:
            mark = "*" if isinstance(event, yaml.AliasEvent) else "&"
            raise here.error(
                f"{mark}{shown(anchor)}", "the value written out, without anchors and aliases"
            )
        if tag is not None:
            raise here.error(f"the tag {shown(tag)}", "a value without a tag")

    def _sequence(self, place: FilePosition, depth: int) -> Iterator[Node]:
        index = 0
        while not isinstance(event := self._next(), yaml.SequenceEndEvent):
            yield self._node(event, self._at(event, place).key(str(index)), depth + 1)
            index += 1

    def _mapping(self, place: FilePosition, depth: int) -> Mapping:
        items: dict[str, Node] = {}
        while not isinstance(event := self._next(), yaml.MappingEndEvent):
            name = self._key(event, place)
            here = self._at(event, place).key(shown(name))
            self._place = here
            if name in items:
                raise here.error(
                    f"the key again (first on line {items[name].place.line})", "each key once"
                )
            items[name] = self._node(self._next(), here, depth + 1)

        return Mapping(place, items)

    def _key(self, event: yaml.Event, place: FilePosition) -> str:
        self._check(event, place, 0)
        if not isinstance(event, yaml.ScalarEvent):
            raise self._at(event, place).error("a list or mapping as a key", "a name")
        return str(event.value)


def _tag(event: yaml.ScalarEvent) -> str:
    """What YAML reads a scalar without a tag as."""
    return str(_RESOLVER.resolve(yaml.ScalarNode, event.value, event.implicit)).rpartition(":")[2]


def _unprintable_line(text: str) -> int:
    """Line of the first character YAML forbids."""
    match = yaml.reader.Reader.NON_PRINTABLE.search(text)
    return text.count("\n", 0, match.start()) + 1 if match else 1
