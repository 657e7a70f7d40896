"""`gritd diagnose`: recordings and a configuration in; verdict, JSON, report and the improved
configuration out.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import json
import os
import re
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.tools.cli import configuration_file
from gritd.tools.cli.command import (
    DAMAGED,
    DONE,
    FAILED,
    USAGE,
    CommandError,
    Parser,
    add_configuration,
    os_errors,
    whole,
)
from gritd.tools.cli.files import writable
from gritd.tools.cli.progress import Progress
from gritd.tools.cli.workers import add_cluster, cluster_of
from gritd.tools.commands import diagnose_campaigns as campaigns
from gritd.tools.commands.diagnose_files import of_files
from gritd.tools.commands.diagnose_text import text
from gritd.tools.diagnose.explain.apply import is_known, rewritten
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.method import OF_REFERENCE
from gritd.tools.report import record
from gritd.tools.report import reference as references

NUMBERS = re.compile(r"\[\n[\s\d.,eEnul+-]*\]")  # a list of them, which takes one line
# step -> share of the time that is over when it begins: three campaigns of 7 to 16 s
DONE_BEFORE = {
    "screening every effect": 0.25,
    "fitting the likely effects": 0.46,
    "looking for a second effect": 0.72,
    "looking for a third effect": 0.79,
    "weighing what has no name": 0.84,
    "holding out runs and conditions": 0.92,
}
# the same of a pair of campaigns: two of 59 and 75 s; before the first, the reference by itself
DONE_BESIDE_REFERENCE = {
    "fitting the soil and the noise": 0.56,
    "screening every effect": 0.76,
    "fitting the likely effects": 0.84,
    "looking for a second effect": 0.92,
    "looking for a third effect": 0.94,
    "weighing what has no name": 0.95,
    "holding out runs and conditions": 0.97,
}

COUNTED = re.compile(r", (\d+) of (\d+)$")  # fits that are done, at the end of a step's words


def main(argv: Sequence[str]) -> int:
    """Exit 0; 2 for usage and configuration; 3 if a recording is damaged: then the result is of
    what was whole.

    With --redo, 1 if it comes out otherwise.
    """
    arguments = _given(argv)
    if arguments.data is not None and arguments.redo is None:
        raise CommandError("diagnose --data: expected --redo FILE with it", USAGE)
    if arguments.campaigns is not None and arguments.redo is None:
        return _many(arguments)

    code = _again(arguments) if arguments.redo is not None else _one(arguments)
    _tell_written(arguments)
    return code


def _given(argv: Sequence[str]) -> argparse.Namespace:
    """What is asked for, with outputs that can be written. Raises CommandError."""
    arguments = build_parser().parse_args(argv)
    _check_outputs(arguments)
    return arguments


def _one(arguments: argparse.Namespace) -> int:
    """The recordings of one campaign."""
    if arguments.scheduler is not None:
        raise CommandError("diagnose --scheduler: expected --campaigns DIR with it", USAGE)
    if not arguments.files or arguments.config is None:
        raise CommandError(
            "diagnose: expected recordings and --config F, or --redo FILE, or --campaigns DIR",
            USAGE,
        )

    if arguments.bed is not None and not arguments.reference:
        raise CommandError("diagnose --bed: expected --reference REF… with it", USAGE)
    arguments.bed = arguments.bed or "prepared"

    configuration, seed = config.load(arguments.config), arguments.seed or 0
    reference = references.given(arguments.reference, arguments.bed)

    with Progress("diagnose") as progress:
        diagnosis, damage = of_files(
            arguments.files,
            configuration,
            seed,
            _steps_of(progress, bool(reference.files)),
            arguments.jobs,
            _command(arguments, seed),
            reference,
            arguments.quick,
            own_rig=not arguments.other_rig,
            online=arguments.online,
        )

    _write(
        arguments, _with_runs(arguments, diagnosis, arguments.files, configuration), configuration
    )
    print(text(diagnosis))
    return DAMAGED if damage else DONE


def _command(arguments: argparse.Namespace, seed: int) -> str:
    """What does the same again in a shell."""
    words = [*map(str, arguments.files)]
    if arguments.reference:
        words += ["--reference", *map(str, arguments.reference), "--bed", arguments.bed]
    words += ["--config", str(arguments.config), "--seed", str(seed)]
    words += ["--quick"] if arguments.quick else []
    words += ["--online"] if arguments.online else []
    return shlex.join(["gritd", "diagnose", *words])


def _with_runs(
    arguments: argparse.Namespace,
    diagnosis: Diagnosis,
    files: Sequence[Path],
    configuration: config.Configuration,
) -> Diagnosis:
    """With what the first page of a report tells of the runs, where one is wanted."""
    if arguments.report is None:
        return diagnosis
    lab = importlib.import_module("gritd.tools.report.lab")

    diagnosed: Diagnosis = lab.with_runs(diagnosis, files, configuration)
    return diagnosed


def _again(arguments: argparse.Namespace) -> int:
    """The diagnosis of a JSON or a report once more, on the same files."""
    if arguments.files or arguments.config is not None or arguments.seed is not None:
        raise CommandError(
            "diagnose --redo: expected no recordings, --config or --seed: they are in the file",
            USAGE,
        )
    then = record.read(arguments.redo, arguments.data)
    record.check(then)
    configuration = config.loads(then.configuration, f"{arguments.redo}: configuration")

    with Progress("diagnose") as progress:
        diagnosis, _ = of_files(
            list(then.files),
            configuration,
            then.seed,
            _steps_of(progress, bool(then.reference.files)),
            arguments.jobs,
            then.command,
            then.reference,
            then.quick,
            online=arguments.online,
        )

    _write(
        arguments, _with_runs(arguments, diagnosis, list(then.files), configuration), configuration
    )
    differs = list(record.differences(then, record.Record.of(diagnosis)))
    print(text(diagnosis))
    for line in record.changed_versions(then):
        print(f"note: computed with {line}")
    print(f"redone: {'; '.join(differs) or f'the same as in {arguments.redo}'}")
    return FAILED if differs else DONE


def _many(arguments: argparse.Namespace) -> int:
    """Every campaign of a folder; 1 if one of them could not be diagnosed."""
    if arguments.files or arguments.config is not None:
        raise CommandError(
            "diagnose --campaigns: expected no recordings or --config: they are in its folders",
            USAGE,
        )

    cluster, every = cluster_of(arguments), campaigns.find(arguments.campaigns)
    failed = False
    for campaign, sentence in campaigns.diagnosed(every, _campaign, arguments.jobs, cluster):
        print(f"{campaign.folder.name}: {sentence}", flush=True)
        failed |= not campaign.done

    print(
        f"{sum(campaign.done for campaign in every)} of {len(every)} campaigns diagnosed: "
        f"{campaigns.RESULT} in each"
    )
    return FAILED if failed else DONE


def _campaign(campaign: campaigns.CampaignFiles) -> str:
    """Verdict and summary of one campaign, or the one line of what was wrong with it."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            _one(_given(campaign.arguments()))
    except (CommandError, ConfigError, RecordingError) as error:
        return f"not diagnosed: {error}"
    diagnosis = json.loads(campaign.result.read_text(encoding="utf-8"))
    return f"{diagnosis['verdict']}. {diagnosis['summary']}"


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Before the work is done. Raises CommandError."""
    if arguments.in_place and (arguments.config is None or arguments.redo is not None):
        raise CommandError("diagnose --in-place: expected --config F with it, not --redo", USAGE)
    if arguments.config is not None and (arguments.apply is not None or arguments.in_place):
        source = Path(arguments.config)
        arguments.apply = configuration_file.target(
            source, arguments.apply, arguments.in_place, "--apply"
        )

    inputs = [*arguments.files, *([arguments.redo] if arguments.redo else [])]
    for path in filter(None, (arguments.json, arguments.report, arguments.apply)):
        writable(path, replaced=path == arguments.apply)
        if any(path.resolve() == given.resolve() for given in inputs):
            raise CommandError(
                f"{path}: is read by this command; expected another name to write to", USAGE
            )


def _tell_written(arguments: argparse.Namespace) -> None:
    """A line a file; of a configuration that was changed in its place `_apply` has reported."""
    applied = None if arguments.in_place else arguments.apply
    for path in filter(None, (arguments.json, arguments.report, applied)):
        print(f"wrote {path}", file=sys.stderr)


def _write(
    arguments: argparse.Namespace, diagnosis: Diagnosis, configuration: config.Configuration
) -> None:
    with os_errors():
        if arguments.json is not None:
            written = json.dumps(diagnosis.to_json(), ensure_ascii=False, indent=1) + "\n"
            short = NUMBERS.sub(lambda each: " ".join(each[0].split()), written)
            arguments.json.write_text(short, encoding="utf-8")
        if arguments.report is not None:
            importlib.import_module("gritd.tools.report.diagnosis").write(
                diagnosis, arguments.report
            )

    if arguments.apply is not None:
        _apply(arguments, diagnosis, configuration)


def _apply(
    arguments: argparse.Namespace, diagnosis: Diagnosis, configuration: config.Configuration
) -> None:
    """Write the configuration with what was found; of an old diagnosis there is the effective text
    alone.
    """
    again = arguments.redo is not None
    source = arguments.redo if again else Path(arguments.config)
    text = configuration.text if again else config.whole_text(source)

    changed = rewritten(text, configuration, diagnosis)
    backup = configuration_file.save(changed, source, arguments.apply)

    if backup is not None:
        print(f"{arguments.apply}: changed; as it was: {backup}", file=sys.stderr)
    if diagnosis.soil is not None and not is_known(diagnosis):
        reason = f"since the verdict is {diagnosis.verdict}"
        print(
            f"{arguments.apply}: soil and discrepancy stay as they were, {reason}", file=sys.stderr
        )


def build_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="gritd diagnose",
        description=(
            "Find where model and recordings differ, name the physics left out, model it, "
            "show the fit."
        ),
    )

    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="recordings, one a run")
    add_configuration(parser, "the testbed and what is known of the soil")
    parser.add_argument(
        "--reference",
        nargs="+",
        type=Path,
        default=[],
        metavar="REF",
        help="recordings of the same rig with nothing new, or the JSON of an earlier diagnosis:"
        " then what is named is what is new",
    )
    parser.add_argument(
        "--bed",
        choices=("same", "prepared"),
        help="with --reference: FILEs were driven in the bed of the reference as it was left, or in"
        " one prepared anew; default: prepared",
    )

    parser.add_argument("--json", type=Path, metavar="OUT", help="the whole result")
    parser.add_argument("--report", type=Path, metavar="OUT.html", help="a page to read")
    parser.add_argument(
        "--apply",
        type=Path,
        metavar="NEW.yaml",
        help="write the configuration with effects, soil and discrepancy of form as found",
    )
    parser.add_argument(
        "--in-place",
        action="store_true",
        help="change the file of --config itself; as it was it stays beside, as F.bak",
    )
    parser.add_argument(
        "--redo", type=Path, metavar="FILE", help="do a diagnosis again from its JSON or its report"
    )
    parser.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        help="with --redo: the recordings are in DIR, not in the folder of FILE",
    )
    parser.add_argument(
        "--campaigns",
        type=Path,
        metavar="DIR",
        help="each folder in DIR: its *.mcap and its *.yaml",
    )

    add_cluster(parser, "with --campaigns: ")
    parser.add_argument(
        "--seed", type=whole(0), help="of earlier versions: nothing is drawn any more"
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="a first answer: only the likeliest effects, one at a time",
    )
    parser.add_argument(
        "--online",
        action="store_true",
        help="run the on-line filter over the recordings too, with what was found and without",
    )
    parser.add_argument(
        "--jobs",
        type=whole(1, 1024),
        default=os.cpu_count() or 1,
        help="processes, or campaigns at once; default: one a core",
    )

    return parser


def _steps_of(progress: Progress, referred: bool) -> Callable[[str], None]:
    """What shows the user that a step begins, or how far it is."""

    def step(what: str) -> None:
        progress.at(what, _done_of_pair(what) if referred else _done(DONE_BEFORE, what))

    return step


def _done_of_pair(what: str) -> float:
    """Share of the time that is over, of a campaign with a reference."""
    if what.startswith(OF_REFERENCE):
        own = _done(DONE_BEFORE, what.removeprefix(OF_REFERENCE))
        return own * next(iter(DONE_BESIDE_REFERENCE.values()))
    return _done(DONE_BESIDE_REFERENCE, what)


def _done(before: Mapping[str, float], what: str) -> float:
    """Share of the time that is over when a step begins, or so many of its fits are done."""
    counted = COUNTED.search(what)
    part = int(counted[1]) / int(counted[2]) if counted else 0.0
    starts = [*before.items(), ("", 1.0)]
    for (beginning, share), (_, end) in pairwise(starts):
        if what.startswith(beginning):
            return share + part * (end - share)
    return 0.0
