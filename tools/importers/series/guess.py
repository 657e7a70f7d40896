"""A proposal for a map, from the names of the columns and from what they hold.

What a file does not show is asked, with the choices, in a line that is marked `# ?`: which
unit a time is in, on which side a torque was measured, a sign. What is proposed can be read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from gritd.tools.importers.series.columns import SeriesTable
from gritd.tools.importers.series.convert import ANALOGUE
from gritd.tools.importers.series.encoders import CHANNELS
from gritd.tools.importers.series.mapping import DATE, TIME
from gritd.tools.importers.series.proposals import Option, Proposal, even, of_day, proposal, shown
from gritd.tools.importers.series.trial import refusal

HEAD = """\
# A proposal of `gritd import series --guess`: check every line, then import with --map.
# A line with `# ?` asks: choose. Channels: docs/importing.md. Noise is estimated where not stated.
"""
WHEEL_LINES = """\
# Without --config the wheel has to be stated here:
# wheel: {radius: 72 mm, width: 71 mm}
"""
RATE = "# ? rate: 100 Hz # no time was found: state how many rows a second has"
GROUPS = (*CHANNELS.values(), *ANALOGUE.values())  # of each, one channel
BETTER = ("wheel_angle", "wheel_count", "rim_speed", "carriage_position", "carriage_count")
ELEMENT = re.compile(r"(.*)\[\d+\]")
MANY = 4  # elements of an array that each get a line
REASON = 160  # characters of a refusal that are shown
WORDS_OF_YAML = ("yes", "no", "y", "n", "on", "off", "true", "false", "null")


@dataclass(frozen=True)
class _Choice:
    """What is proposed of the tables of a file: of each the columns that are used, by name."""

    used: tuple[dict[str, Proposal], ...]
    taken: dict[str, str]  # channel -> column
    timeless: bool  # whether rows of some table have no time

    @property
    def names(self) -> list[str]:
        return [name for used in self.used for name in used]

    def text(self, other: Mapping[str, Option]) -> str:
        """The map with the first answer to each question, or another one in the place of what
        excludes it.
        """
        given = {
            name: other.get(name, each.options[0])
            for used in self.used
            for name, each in used.items()
            if name in other or len(each.options) == 1 or not self.rival(each.options[0])
        }
        replaced = {self.rival(option) for option in other.values()} - set(other)
        lines = [
            f"  {_quoted(name)}: {{{option.text}}}"
            for name, option in given.items()
            if name not in replaced
        ]
        return "\n".join(["columns:", *lines, *["rate: 100 Hz"] * self.timeless, ""])

    def rival(self, option: Option) -> str:
        """The column that has the channel of an option, or one that excludes it; '' for none."""
        channel = option.text.split(",")[0].removeprefix("channel: ")
        group = next((group for group in GROUPS if channel in group), (channel,))
        return next((self.taken[other] for other in group if other in self.taken), "")

    def refusal(self, tables: Sequence[SeriesTable], other: Mapping[str, Option]) -> str:
        """Why an import would not take it; '' where it would."""
        if not self.taken:  # times alone
            return ""
        whole = not any("# ?" in line for line in _lacking(self.taken))
        return refusal(self.text(other), tables, whole)


def guessed(tables: Sequence[SeriesTable]) -> str:
    """YAML text of a map for files with the columns of the first; a file may hold several tables,
    each with a clock of its own.
    """
    first = [table for table in tables if table.path == tables[0].path]
    others = [table for table in tables if table.path != tables[0].path]
    proposals = [_proposals(table, others) for table in first]
    refused: dict[str, str] = {}
    choice = _accepted(first, proposals, tables, refused)

    lines = [HEAD + "columns:"]
    for table, used in zip(first, choice.used, strict=True):
        arrays = _arrays(table, used)
        for name in table.columns:
            if name in used:
                lines += _lines(_takeable(used[name], choice, tables), choice)
            elif (more := arrays.get(name, "")) is not None:
                lines.append(_unused(table, name, proposals, others, refused, more))

    lines += ["", RATE] * choice.timeless
    lines += _lacking(choice.taken)
    lines += ["", WHEEL_LINES + "# torque_constant: {value: 2.0 N*m/A, sigma: 0.02 N*m/A}"]
    if not {"load", "nominal_load"} & set(choice.taken):
        lines += ["", "# load: 70 N # weights of every run; or for each:"]
    names = dict.fromkeys(table.path.name for table in tables)
    lines += ["# runs:", *(f"#   {_quoted(name)}: {{load: 70 N, pass: 1}}" for name in names)]
    return "\n".join(lines) + "\n"


# --- what is chosen ---


def _accepted(
    first: Sequence[SeriesTable],
    proposals: Sequence[dict[str, Proposal]],
    tables: Sequence[SeriesTable],
    refused: dict[str, str],
) -> _Choice:
    """The columns that an import takes; the others go to `refused`, each with the reason."""
    choice = _choice(first, proposals, refused)
    while why := choice.refusal(tables, {}):
        without = {name: _choice(first, proposals, {**refused, name: why}) for name in choice.names}
        left = {
            name: each.refusal(tables, {})
            for name, each in sorted(without.items(), key=lambda pair: _is_needed(choice, pair[0]))
        }
        put_right = (name for name, rest in left.items() if not rest)
        changed = (name for name, rest in left.items() if rest != why)
        name = next(put_right, None) or next(changed, choice.names[-1])
        refused[name] = why
        choice = without[name]
    return choice


def _is_needed(choice: _Choice, name: str) -> bool:
    """Whether a column is that of an encoder: without it, less of a map is tried."""
    return any(choice.taken.get(channel) == name for own in CHANNELS.values() for channel in own)


def _choice(
    first: Sequence[SeriesTable],
    proposals: Sequence[dict[str, Proposal]],
    refused: Mapping[str, str],
) -> _Choice:
    """Of what is proposed, but for what is refused."""
    left = [{name: each for name, each in own.items() if name not in refused} for own in proposals]
    taken = _taken([each for own in left for each in own.values()])

    used, timeless = [], False
    for table, own in zip(first, left, strict=True):
        times = _times(table, own, refused)
        timeless |= not times and table.clock is None
        chosen = {
            name for name, each in own.items() if name in times or taken.get(each.channel) == name
        }
        used.append({name: own[name] for name in table.columns if name in chosen})
    return _Choice(tuple(used), taken, timeless)


def _takeable(each: Proposal, choice: _Choice, tables: Sequence[SeriesTable]) -> Proposal:
    """A proposal with those of its answers that an import takes."""
    first, *others = each.options
    kept = [other for other in others if not choice.refusal(tables, {each.name: other})]
    return replace(each, options=(first, *kept))


def _proposals(table: SeriesTable, others: Sequence[SeriesTable]) -> dict[str, Proposal]:
    """By column, those that every file has."""
    made = {}
    for name in table.columns:
        alike = [other for other in others if name in other.columns]
        if len({other.path for other in alike}) == len({other.path for other in others}):
            each = proposal([table, *alike], name)
            if each is not None:
                made[name] = each
    return made


def _times(
    table: SeriesTable, proposals: dict[str, Proposal], refused: Mapping[str, str]
) -> set[str]:
    """The columns that tell when the rows of a table were taken; one that rises evenly, where no
    name does.
    """
    times = [each for each in proposals.values() if each.channel == TIME]
    dates = [each for each in proposals.values() if each.channel == DATE]
    if not times:
        unnamed = even(table)
        if unnamed is None or unnamed.name in refused or table.clock is not None:
            return set()
        proposals[unnamed.name] = unnamed
        return {unnamed.name}

    time = max(times, key=lambda each: (each.sure, not each.asks))
    if dates and of_day(table.columns[time.name]):
        return {time.name, dates[0].name}
    return {time.name}


def _taken(proposals: Sequence[Proposal]) -> dict[str, str]:
    """Channel -> column: of several the surest, and of channels that exclude each other the
    one that tells more.
    """
    best: dict[str, Proposal] = {}
    for each in proposals:
        if each.channel in (TIME, DATE):
            continue
        before = best.get(each.channel)
        if before is None or each.sure > before.sure:
            best[each.channel] = each

    for group in GROUPS:
        rivals = [best[channel] for channel in group if channel in best]
        if len(rivals) > 1:
            kept = max(rivals, key=lambda each: (each.sure, each.channel in BETTER))
            for each in rivals:
                if each is not kept:
                    del best[each.channel]
    return {channel: each.name for channel, each in best.items()}


# --- the text ---


def _lines(each: Proposal, choice: _Choice) -> Iterator[str]:
    """A line, or a question and a line for each answer that leaves the other lines as they are."""
    name = _quoted(each.name)
    if len(each.options) == 1:
        (option,) = each.options
        asks = f"? {each.asks}; " if each.asks else ""
        yield f"  {name}: {{{option.text}}} # {asks}{option.why}"
        return
    yield f"  # ? {name}: {each.asks}; take one of these lines, without its first '#':"
    for option in each.options:
        rival = choice.rival(option)
        other = f" # in the place of {_quoted(rival)}:" if rival else ""
        yield f"  #{other} {name}: {{{option.text}}} # {option.why}"


def _arrays(table: SeriesTable, used: Mapping[str, Proposal]) -> dict[str, str | None]:
    """For the elements of long arrays of which none is used: how many are like the first, None for
    these.
    """
    elements: dict[str, list[str]] = {}
    for name in table.columns:
        if name.endswith("]") and (match := ELEMENT.fullmatch(name)):
            elements.setdefault(match[1], []).append(name)

    found: dict[str, str | None] = {}
    for names in elements.values():
        if len(names) > MANY and not used.keys() & set(names):
            found |= dict.fromkeys(names)
            found[names[0]] = f" and {len(names) - 1} more of it"
    return found


def _unused(
    table: SeriesTable,
    name: str,
    proposals: Sequence[dict[str, Proposal]],
    others: Sequence[SeriesTable],
    refused: Mapping[str, str],
    more: str,
) -> str:
    """Why a column is left out; more: of which others the same is true."""
    why = "not used"
    having = {other.path for other in others if name in other.columns}
    lacking = next((other.path for other in others if other.path not in having), None)
    each = next((own[name] for own in proposals if name in own), None)
    if lacking is not None:
        why = f"not in {lacking.name}"
    elif name in refused:
        why = f"not used, the import would say: {refused[name][:REASON]}"
    elif each is not None:
        why = f"not used, another column is the {each.channel.rstrip('?')}"
    return f"  # {_quoted(name)}{more}: {why}, {shown(table.columns[name])}"


def _lacking(taken: dict[str, str]) -> list[str]:
    """Questions about what an import needs and no column was taken for. A motor and its angle alone
    can be imported.
    """
    lacking = {e: channels for e, channels in CHANNELS.items() if not set(channels) & set(taken)}
    if list(lacking) == ["carriage_encoder"] and set(ANALOGUE["motor_shunt"]) & set(taken):
        return ["# no column was taken for the carriage: as it stands, a drive alone"]
    return [
        f"# ? no column was taken for the {encoder}: one with channel: {' or '.join(channels)}"
        for encoder, channels in lacking.items()
    ]


def _quoted(name: str) -> str:
    """A column's name as a key of YAML."""
    if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name) and name.lower() not in WORDS_OF_YAML:
        return name
    return "'" + name.replace("'", "''") + "'"
