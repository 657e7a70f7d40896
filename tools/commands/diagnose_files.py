"""From files and a configuration to a diagnosis, for the command and for Python."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from gritd.estimator.config import configuration as config
from gritd.estimator.recording.metadata import versions
from gritd.tools.cli.command import DAMAGED, CommandError
from gritd.tools.diagnose.explain.innovations import with_innovations
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.signals import distinct, in_order, read_all, read_one
from gritd.tools.recordings import provenance
from gritd.tools.report import reference as references


def of_files(
    files: Sequence[Path],
    configuration: config.Configuration,
    seed: int,
    step: Callable[[str], None] = lambda _: None,
    jobs: int = 1,
    command: str = "",
    reference: references.Given = references.NONE,
    quick: bool = False,
    own_rig: bool = False,
    online: bool = False,
) -> tuple[Diagnosis, list[str]]:
    """The diagnosis, and what was damaged in the files. Raises CommandError.

    step: is given what begins; jobs: processes; command: what does the same again in a shell;
    quick: a first answer.
    own_rig: recordings of another testbed than the configuration's are refused; online: the on-line
    filter runs over them too, before and after.
    """
    settings = configuration.settings
    recordings, known = read_all(in_order(files)), read_all(in_order(reference.files))
    if own_rig:
        provenance.check_rig([*recordings, *known], settings, configuration.source)

    redo = _redo(files, configuration, command, reference, quick)
    rig, rate = rig_of(recordings, settings, known, reference.bed)
    if not rig.channels:
        raise CommandError(
            f"{files[0]}: found no sinkage, current or force; expected one to compare with", DAMAGED
        )

    redo |= {"grid_hz": rate, "versions": versions()}
    damage = [f"{r.path}: {line}" for r in (*recordings, *known) for line in r.damage]
    remarks = [*provenance.remarks(recordings, settings), *(f"Damaged: {d}" for d in damage)]

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        del recordings, known  # long ones are large, and read again where they are needed
        diagnosis = diagnose(rig, seed, redo, step, jobs, quick)
        if online:
            reads = [partial(read_one, path) for path in in_order(files)]
            diagnosis = with_innovations(diagnosis, configuration, reads, jobs)

    if reference.files:
        diagnosis = references.with_reference(diagnosis, reference)
    return replace(diagnosis, caveats=(*diagnosis.caveats, *remarks)), damage


def _redo(
    files: Sequence[Path],
    configuration: config.Configuration,
    command: str,
    reference: references.Given,
    quick: bool,
) -> dict[str, Any]:
    """What doing it again needs. Raises CommandError where a file is given twice."""
    hashes = distinct([*files, *reference.files])

    return {
        **({"command": command} if command else {}),
        "files": {str(path): hashes[str(path)] for path in files},
        **reference.kept(hashes),
        **({"quick": True} if quick else {}),
        "configuration": configuration.text,
    }
