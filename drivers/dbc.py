"""A CAN database file (DBC), read as far as the messages that are listened to need it.

The messages are found in the text; those that are wanted are checked and given to cantools in
plain form. Comments, units, attributes and all other messages are left aside: what is wrong there
harms nobody, and `amiss_elsewhere` tells it.
"""

from __future__ import annotations

import os
import re
import stat
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from math import isfinite

from gritd.drivers.can_libraries import Database, cantools
from gritd.estimator.config.nearest import did_you_mean

MAX_DBC_BYTES = 8 << 20
MAX_MESSAGE = 64  # [bytes] of CAN FD
MAX_MESSAGES = 50_000
MAX_SIGNALS = 4096  # of one message
BYTE_ORDER_MARK = "\xef\xbb\xbf"  # of UTF-8, a character a byte
EXTENDED_ID = 1 << 31
UNASSIGNED = 0xC0000000  # of the message that editors keep unused signals in

_MESSAGE = re.compile(r"\s*(\d{1,10})\s+([A-Za-z_]\w*)\s*:\s*(\d{1,12})\b", re.ASCII)
_SIGNAL = re.compile(
    r"SG_\s+(?P<name>[A-Za-z_]\w*)\s*(?P<role>M|m\d{1,6}M?|)\s*:"
    r"\s*(?P<start>-?\d{1,12})\s*\|\s*(?P<bits>-?\d{1,12})\s*@\s*(?P<order>[01])\s*(?P<sign>[+-])"
    r"\s*\(\s*(?P<scale>[^,()]{1,40})\s*,\s*(?P<offset>[^,()]{1,40})\)",
    re.ASCII,
)
_ABOUT = re.compile(r"\s*(\d{1,10})\s[\w\s,:-]*;", re.ASCII)
_J1939 = re.compile(r'BA_\s+"ProtocolType"\s+"J1939"', re.IGNORECASE)
_J1939_MESSAGE = re.compile(r'BA_\s+"VFrameFormat"\s+BO_\s+(\d{1,10})\s+"?(?:3|J1939PG)"?')


class DbcError(ValueError):
    """What is wrong with a database, without its name and without quoting what it holds."""


@dataclass(frozen=True)
class DbcSignal:
    """Where a signal lies, as its line says. role: '', M of the multiplexer, or m3 of what it
    chooses.
    """

    name: str
    role: str
    start: int
    bits: int
    order: str  # 1: little-endian
    sign: str
    scale: float
    offset: float

    def amiss(self) -> str:
        """Why no value can be made of it; '' where one can."""
        if self.start < 0 or self.start >= 8 * MAX_MESSAGE:
            return f"start bit {self.start}, expected 0 to {8 * MAX_MESSAGE - 1}"
        if not 1 <= self.bits <= 64:
            return f"{self.bits} bits, expected 1 to 64"
        if not isfinite(self.scale) or self.scale == 0.0:
            return f"scale {self.scale:g}, expected a finite number other than 0"
        return "" if isfinite(self.offset) else f"offset {self.offset:g}, expected a finite number"

    def place(self) -> int:
        """Its bits in the message, as a mask."""
        if self.order == "1":
            return ((1 << self.bits) - 1) << self.start
        first = 8 * (self.start // 8) + 7 - self.start % 8  # counted from the message's first bit
        return sum(1 << (8 * (n // 8) + 7 - n % 8) for n in range(first, first + self.bits))

    def line(self) -> str:
        """Its statement, without range, unit and receivers."""
        factor = f"({_plain(self.scale)},{_plain(self.offset)})"
        place = f"{self.start}|{self.bits}@{self.order}{self.sign}"
        return f' SG_ {self.name} {self.role} : {place} {factor} [0|0] "" Vector__XXX'


@dataclass(frozen=True)
class DbcMessage:
    """One message: number with EXTENDED_ID, name, length [bytes], and the lines of its
    signals."""

    number: int
    name: str
    length: int
    lines: tuple[str, ...]

    def signals(self) -> list[DbcSignal]:
        """Raises DbcError where a line is none."""
        return list(map(_signal, self.lines))

    def amiss(self) -> str:
        """Why it cannot be decoded; '' where it can."""
        if self.number & ~EXTENDED_ID >= 1 << (29 if self.number & EXTENDED_ID else 11):
            return "its id has more bits than an identifier"
        if self.length > MAX_MESSAGE:
            return f"{self.length} bytes, expected at most {MAX_MESSAGE}"
        if len(self.lines) > MAX_SIGNALS:
            return f"more than {MAX_SIGNALS} signals"
        try:
            return _among(self.signals(), self.length)
        except DbcError as error:
            return str(error)

    def statement(self) -> str:
        return "\n".join(
            [
                f"BO_ {self.number} {self.name}: {self.length} Vector__XXX",
                *(signal.line() for signal in self.signals()),
                "",
            ]
        )


class DbcFile:
    """The messages of these names (None: all) in a file. Raises DbcError, also where it is a pipe
    or a device.

    elsewhere: whether the other messages are checked too.
    """

    def __init__(self, path: str, names: Collection[str] | None, elsewhere: bool = False) -> None:
        self._wanted, self._check_others = names, elsewhere
        self._messages: list[DbcMessage] = []
        self._names: Counter[str] = Counter()
        self._ids: dict[int, list[str]] = {}  # names of its first two messages
        self._numbers: set[int] = set()  # of the wanted messages
        self._more: list[str] = []  # further statements about them
        self._wrong = ""  # the first of the other messages that is, and why
        self._count = self._count_wrong = 0
        self._j1939: set[int] = set()
        self._all_j1939 = False
        self._head, self._signals = ("", "", ""), list[str]()  # of the message that is being read

        for line in _statements(path):
            self._take(line)
        self._end()
        if not self._names:
            raise DbcError("is not a DBC file: found no line such as 'BO_ 256 Name: 8 Node'")

    def database(self) -> Database:
        """The wanted messages. Raises DbcError."""
        self._check_names()
        for message in self._messages:
            if reason := self._amiss(message):
                raise DbcError(f"message {message.name}: {reason}")

        statements = ['VERSION ""', *(m.statement() for m in self._messages), *self._more, ""]
        try:
            made = cantools.database.load_string("\n".join(statements), "dbc", strict=True)
        except Exception as error:  # the parser's own errors share no class but this one
            names = ", ".join(message.name for message in self._messages)
            raise DbcError(f"{names}: {error}") from None

        assert isinstance(made, Database)
        for each in made.messages:
            number = each.frame_id | EXTENDED_ID
            if each.is_extended_frame and (self._all_j1939 or number in self._j1939):
                each.protocol = "j1939"
        return made

    def amiss_elsewhere(self) -> str:
        """What is wrong with messages that are not wanted, in a few words; ''."""
        if not self._wrong:
            return ""
        more = f", and {self._count_wrong - 1} more" if self._count_wrong > 1 else ""
        return f"{self._wrong}{more}; no channel listens to it"

    def _take(self, line: str) -> None:
        """One line of the file."""
        word, rest = line.split(None, 1) if " " in line or "\t" in line else (line, "")
        if word == "SG_" and self._head[0]:
            if len(self._signals) <= MAX_SIGNALS:
                self._signals.append(line)
            return

        self._end()
        if word == "BO_" and (match := _MESSAGE.match(rest)):
            self._head = (match[1], match[2], match[3])
        elif word == "BA_":
            self._attribute(line)
        elif word in ("SIG_VALTYPE_", "SG_MUL_VAL_"):
            match = _ABOUT.match(rest)
            self._more += [line] if match and int(match[1]) in self._numbers else []

    def _end(self) -> None:
        """The message that was read is complete."""
        (number, name, length), self._head = self._head, ("", "", "")
        signals, self._signals = self._signals, []
        if not name:
            return

        message = DbcMessage(int(number), name, int(length), tuple(signals))
        self._count += 1
        if self._count > MAX_MESSAGES:
            raise DbcError(f"has more than {MAX_MESSAGES} messages")
        self._names[name] += 1
        same = self._ids.setdefault(message.number, [])
        if len(same) < 2:
            same.append(name)
        if self._wanted is None or name in self._wanted:
            self._messages.append(message)
            self._numbers.add(message.number)
        elif self._check_others and message.number != UNASSIGNED:
            self._check(message)

    def _check(self, message: DbcMessage) -> None:
        """One that is not wanted."""
        if reason := self._amiss(message):
            self._count_wrong += 1
            self._wrong = self._wrong or f"{message.name} cannot be decoded ({reason})"

    def _attribute(self, line: str) -> None:
        self._all_j1939 |= bool(_J1939.match(line))
        if match := _J1939_MESSAGE.match(line):
            self._j1939.add(int(match[1]))

    def _check_names(self) -> None:
        for name in sorted(self._wanted or ()):
            if name not in self._names:
                known, meant = ", ".join(self._names), did_you_mean(name, self._names)
                raise DbcError(f"no message {name} in its database{meant}; there are {known}")

    def _amiss(self, message: DbcMessage) -> str:
        if self._names[message.name] > 1:
            return "several messages have this name"
        if len(same := self._ids[message.number]) > 1:
            return f"{' and '.join(same)} have one id, {message.number & ~EXTENDED_ID}"
        return message.amiss()


def _statements(path: str) -> Iterator[str]:
    """The lines that are not empty, without what stands in quotation marks: a comment may hold
    anything, also lines that look like statements. An attribute keeps its texts. Raises DbcError.
    """
    quoted = False
    for line in _lines(path):
        if not quoted and line.startswith("BA_ "):
            yield line
        if '"' not in line:
            if not quoted and (text := line.strip()):
                yield text
            continue
        pieces = line.replace('\\"', "").split('"')
        outside = pieces[1::2] if quoted else pieces[0::2]
        quoted ^= len(pieces) % 2 == 0
        if text := '""'.join(outside).strip():
            yield text


def _lines(path: str) -> Iterator[str]:
    """A character a byte: only names and numbers are read, which are ASCII. Raises DbcError."""
    try:
        with open(
            path,
            encoding="latin-1",
            opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK),
        ) as file:
            about = os.fstat(file.fileno())
            if not stat.S_ISREG(about.st_mode):
                raise DbcError("is no regular file; expected a DBC file")
            if about.st_size > MAX_DBC_BYTES:
                raise DbcError(f"is larger than {MAX_DBC_BYTES} bytes")
            yield file.readline().removeprefix(BYTE_ORDER_MARK)
            yield from file
    except OSError as error:
        raise DbcError(f"cannot read: {(error.strerror or '').lower()}") from None


def _signal(line: str) -> DbcSignal:
    match = _SIGNAL.match(line)
    if match is None:
        raise DbcError("found a line of it that is no signal, expected SG_ Name : 0|16@1+ (1,0) …")
    return DbcSignal(
        match["name"],
        match["role"],
        int(match["start"]),
        int(match["bits"]),
        match["order"],
        match["sign"],
        _number(match["scale"], match["name"]),
        _number(match["offset"], match["name"]),
    )


def _number(text: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise DbcError(f"signal {name}: found a scale or offset that is no number") from None


def _plain(value: float) -> str:
    """A number as cantools reads it: without a point where it is whole, so that counts stay
    whole.
    """
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def _among(signals: list[DbcSignal], length: int) -> str:
    """What is wrong with the signals of a message; ''."""
    names = Counter(signal.name for signal in signals)
    for signal in signals:
        if names[signal.name] > 1:
            return f"{names[signal.name]} signals {signal.name}"
        if reason := signal.amiss():
            return f"signal {signal.name}: {reason}"
        if signal.place() >> 8 * length:
            return f"signal {signal.name} reaches beyond its {length} bytes"
    return next(_overlaps(signals), "")


def _overlaps(signals: list[DbcSignal]) -> Iterator[str]:
    """Signals in one place; what a multiplexer chooses between may lie there."""
    taken: dict[str, list[DbcSignal]] = {}
    for signal in signals:
        always = taken.setdefault("", [])
        role = signal.role if signal.role != "M" else ""
        for other in always if not role else [*always, *taken.get(role, ())]:
            if signal.place() & other.place():
                yield f"signals {other.name} and {signal.name} overlap"
        taken.setdefault(role, []).append(signal)
