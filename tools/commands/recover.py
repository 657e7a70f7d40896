"""`gritd recover FILE [-o OUT]`: a clean, indexed recording of all that a damaged or unclosed one
still holds.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gritd.estimator.messages.readings import NS
from gritd.estimator.recording.blocks import Damaged
from gritd.estimator.recording.mcapfile import McapFile, RecordingError, opened, reported
from gritd.estimator.recording.metadata import RECOVERED, sealed
from gritd.estimator.recording.salvage import Recording, read
from gritd.estimator.visible import visible
from gritd.tools.cli.command import DAMAGED, DONE, CommandError, Parser
from gritd.tools.cli.files import unread, unwritten, vacant
from gritd.tools.cli.progress import Progress

LIBRARY = "gritd recover"
LONGEST = 18  # digits of a number of messages


def main(argv: Sequence[str]) -> int:
    """Exit code: 0 nothing lost, 3 saved in part. Raises CommandError."""
    arguments = build_parser().parse_args(argv)
    source: Path = arguments.file

    try:
        recording = read(source, topics=())
    except RecordingError as error:
        raise unread(source, error) from None

    target = arguments.output or source.with_suffix(f".recovered{source.suffix}")
    try:
        lost = _check_attachments(recording)
        span = recover(recording, vacant(target))
    except RecordingError as error:
        raise unwritten(error) from None

    for line in recording.damage:
        print(visible(f"{source}: {line}"), file=sys.stderr)
    if span is None:
        raise CommandError(f"{source}: found nothing to recover; no file is written", DAMAGED)

    print(f"{target}: {summary(recording, span)}")
    return DONE if recording.saved and not lost else DAMAGED


def recover(recording: Recording, target: Path) -> float | None:
    """Write every intact message, in file order, every intact metadata record and attachment to a
    new file.
    Returns the time from the first message to the last [s]; None, and makes no file, where a
    recording that is not whole has neither.

    Messages of topics that we cannot decode are kept as they are. Raises
    RecordingError where the file cannot be written. Whatever stops it, no part of a file is left.
    """
    some = recording.counts.total() or recording.metadata or recording.attachments
    if not (recording.complete or some):
        return None

    first, last = np.iinfo(np.uint64).max, 0  # [ns]
    file = McapFile(target, library=LIBRARY)
    with file.beginning():
        for source in recording.sources.values():
            file.define(source.schema, source.channel)
        for name, entries in recording.metadata.items():
            if name != RECOVERED:
                file.add_metadata(
                    name, sealed(name, entries) if name.startswith("gritd.") else entries
                )
        for name, entries in recording.repeated:
            file.add_metadata(name, entries)
        file.add_metadata(RECOVERED, sealed(RECOVERED, _note(recording)))
        _copy_attachments(recording, file)
        with Progress("recovering messages", recording.counts.total()) as progress:
            for chunk in recording.chunks():
                file.add_chunk(*chunk.records())
                if (times := chunk.heads["log_time"]).size:
                    first, last = min(first, int(times.min())), max(last, int(times.max()))
                progress.advance(len(chunk.starts))
        file.close()
    return max(last - first, 0) / NS


def _check_attachments(recording: Recording) -> int:
    """Leave out those that are not whole, and say so among the damage; returns how many."""
    found, whole = recording.attachments, []
    with reported(recording.path, "read"), opened(recording.path, buffering=0) as source:
        for place in recording.attachments:
            try:
                place.checked(source)
                whole.append(place)
            except Damaged as why:
                recording.damage.append(f"byte {place.start}: {why}; left out")
    recording.attachments = whole
    return len(found) - len(whole)


def _copy_attachments(recording: Recording, file: McapFile) -> None:
    with reported(recording.path, "read"), opened(recording.path, buffering=0) as source:
        for place in recording.attachments:
            file.add_attachment(place.checked(source), place.pieces(source))


def summary(recording: Recording, span: float) -> str:
    """One line: what was saved, and what is known to be lost. span: from the first message to the
    last [s].
    """
    saved = f"saved {recording.counts.total()} messages of {len(recording.counts)} topics"
    if recording.attachments:
        saved += f" and {len(recording.attachments)} attachments"
    if recording.complete:
        return f"{saved}; the recording was complete"

    end = f"not closed: it ends {span:.3f} s after its beginning, what came later is not in it"
    ending = "closed" if recording.closed else end
    if recording.misplaced:
        ending += f", {recording.misplaced} chunks in a wrong place or twice"

    if recording.saved:
        what = "in it" if recording.closed else "before that"
        return f"{saved}; it was {ending}; nothing {what} is lost"
    count = f"{recording.lost}" if recording.counted else f"{recording.lost} or more"
    return f"{saved}; it was {ending}; {count} messages are lost"


def _note(recording: Recording) -> dict[str, str]:
    """What is not in the new file, with what an earlier recovery noted."""
    earlier = recording.recovered
    damage = [line for line in (earlier.get("damage", ""), *recording.damage) if line]
    lost = recording.lost + _lost(earlier)
    return {"from": recording.path.name, "lost": str(lost), "damage": "\n".join(damage)}


def _lost(earlier: Mapping[str, str]) -> int:
    """Messages that an earlier recovery missed; 0 where it does not say so in figures."""
    text = earlier.get("lost", "")
    return int(text) if text.isdecimal() and len(text) <= LONGEST else 0


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd recover",
        description="Write a clean, indexed recording of what a damaged one still holds.",
    )
    parser.add_argument("file", type=Path, help="the recording; it is not changed")
    parser.add_argument(
        "-o", "--output", type=Path, help="default: FILE with .recovered before its suffix"
    )

    return parser
