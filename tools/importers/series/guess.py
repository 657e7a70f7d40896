"""A proposal for a map, from the names of the columns and from what they hold.

What cannot be told from a file is asked, with the choices, in a line that is marked `# ?`: which
unit a time is in, on which side a torque was measured, a sign. What is proposed can be read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from gritd.tools.importers.series.columns import SeriesTable
from gritd.tools.importers.series.convert import ANALOGUE
from gritd.tools.importers.series.encoders import CHANNELS
from gritd.tools.importers.series.mapping import DATE, TIME
from gritd.tools.importers.series.proposals import Proposal, even, of_day, proposal, shown

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
WORDS_OF_YAML = ("yes", "no", "y", "n", "on", "off", "true", "false", "null")


def guessed(tables: Sequence[SeriesTable]) -> str:
    """YAML text of a map for files with the columns of the first; a file may hold several tables,
    each with a clock of its own.
    """
    first = [table for table in tables if table.path == tables[0].path]
    others = [table for table in tables if table.path != tables[0].path]
    proposals = [_proposals(table, others) for table in first]
    taken = _taken([each for of_table in proposals for each in of_table.values()])

    lines = [HEAD + "columns:"]
    timeless = False
    for table, of_table in zip(first, proposals, strict=True):
        times = _times(table, of_table)
        timeless |= not times and table.clock is None
        for name in table.columns:
            each = of_table.get(name)
            used = each is not None and (name in times or taken.get(each.channel) == name)
            lines += _lines(each, taken) if each and used else [_unused(table, name, each, others)]

    lines += ["", RATE] * timeless
    lines += _lacking(taken)
    lines += ["", WHEEL_LINES + "# torque_constant: {value: 2.0 N*m/A, sigma: 0.02 N*m/A}"]
    if not {"load", "nominal_load"} & set(taken):
        lines += ["", "# load: 70 N # weights of every run; or for each:"]
    names = dict.fromkeys(table.path.name for table in tables)
    lines += ["# runs:", *(f"#   {_quoted(name)}: {{load: 70 N, pass: 1}}" for name in names)]
    return "\n".join(lines) + "\n"


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


def _times(table: SeriesTable, proposals: dict[str, Proposal]) -> set[str]:
    """The columns that tell when the rows of a table were taken; one that rises evenly, where no
    name does.
    """
    times = [each for each in proposals.values() if each.channel == TIME]
    dates = [each for each in proposals.values() if each.channel == DATE]
    if not times:
        if (unnamed := even(table)) is None or table.clock is not None:
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


def _lines(each: Proposal, taken: dict[str, str]) -> Iterator[str]:
    """A line, or a question and a line for each answer that leaves the other lines as they are."""
    name = _quoted(each.name)
    if len(each.options) == 1:
        (option,) = each.options
        asks = f"? {each.asks}; " if each.asks else ""
        yield f"  {name}: {{{option.text}}} # {asks}{option.why}"
        return
    yield f"  # ? {name}: {each.asks}; take one of these lines, without its first '#':"
    for option in each.options:
        rival = _rival(option.text, taken)
        other = f" # in the place of {_quoted(rival)}:" if rival else ""
        yield f"  #{other} {name}: {{{option.text}}} # {option.why}"


def _rival(text: str, taken: dict[str, str]) -> str:
    """The column that has the channel of an option's text, or one that excludes it; '' for none."""
    channel = text.split(",")[0].removeprefix("channel: ")
    group = next((group for group in GROUPS if channel in group), (channel,))
    return next((taken[other] for other in group if other in taken), "")


def _unused(
    table: SeriesTable, name: str, each: Proposal | None, others: Sequence[SeriesTable]
) -> str:
    """Why a column is left out."""
    why = "not used"
    having = {other.path for other in others if name in other.columns}
    lacking = next((other.path for other in others if other.path not in having), None)
    if lacking is not None:
        why = f"not in {lacking.name}"
    elif each is not None:
        why = f"not used, another column is the {each.channel.rstrip('?')}"
    return f"  # {_quoted(name)}: {why}, {shown(table.columns[name])}"


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
