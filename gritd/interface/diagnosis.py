"""The diagnosis of runs, as `gritd diagnose` makes it."""

from __future__ import annotations

import html
import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from gritd.estimator.config.configuration import Configuration
from gritd.interface.runs import Place, Run, configured
from gritd.tools.commands.diagnose_files import of_files
from gritd.tools.commands.diagnose_text import text
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.report import lab
from gritd.tools.report import reference as references

HEIGHT = 900  # [px] of the report in a notebook


@dataclass(frozen=True)
class Result:
    """What was found. A notebook shows its report; `print` shows its verdict in lines."""

    diagnosis: Diagnosis
    damage: tuple[str, ...] = ()  # what of the files could not be read

    @property
    def verdict(self) -> str:
        """consistent, explained, unlisted or insufficient."""
        return str(self.diagnosis.verdict)

    @property
    def probabilities(self) -> dict[str, float]:
        """Effect → probability, the likeliest first."""
        return {each.effect: each.probability for each in self.diagnosis.hypotheses}

    @property
    def accepted(self) -> tuple[str, ...]:
        """The effects that were accepted."""
        return tuple(each.effect for each in self.diagnosis.accepted)

    def to_json(self) -> dict[str, Any]:
        """Everything, as `gritd diagnose --json` writes it."""
        return dict(self.diagnosis.to_json())

    def report(self, path: Place) -> Path:
        """The page that `gritd diagnose --report` writes. Raises OSError."""
        importlib.import_module("gritd.tools.report.diagnosis").write(self.diagnosis, Path(path))
        return Path(path)

    def __str__(self) -> str:
        return text(self.diagnosis)

    def __repr__(self) -> str:
        return f"Result({self.verdict}: {self.diagnosis.summary})"

    def _repr_html_(self) -> str:
        page = importlib.import_module("gritd.tools.report.diagnosis").render(self.diagnosis)
        return (
            f'<iframe srcdoc="{html.escape(page)}" width="100%" height="{HEIGHT}" '
            'style="border: none"></iframe>'
        )


def diagnose(
    runs: Sequence[Run | Place],
    config: Place | Configuration,
    reference: Sequence[Run | Place] = (),
    *,
    bed: Literal["same", "prepared"] = "prepared",
    seed: int = 0,
    jobs: int = 1,
    quick: bool = False,
    other_rig: bool = False,
    online: bool = False,
    step: Callable[[str], None] = lambda what: None,
) -> Result:
    """Where runs and model differ, and which physics was left out.

    runs: recordings or their files. config: the testbed and what is known of the soil.
    reference: recordings of the same rig with nothing new; then what is named is what is new.
    bed: with a reference, "same" or "prepared". jobs: processes that fit.
    seed: of earlier versions; nothing is drawn any more.
    quick: a first answer, for which only the likeliest effects are fitted, each alone.
    other_rig: config may be of another testbed than the runs.
    online: the on-line filter runs over them too, by config and by what was found.
    step: is given what begins.

    Raises ValueError without runs, CommandError and ConfigError; one line.
    """
    if isinstance(runs, Run | str | PathLike):
        raise ValueError("runs: found a single run; expected a list of runs or files")
    if not runs:
        raise ValueError("runs: found none; expected recordings or their files")

    given = references.given([_file(each) for each in reference], bed)
    files, configuration = [_file(run) for run in runs], configured(config)
    diagnosis, damage = of_files(
        files,
        configuration,
        seed,
        step,
        jobs,
        "",
        given,
        quick,
        own_rig=not other_rig,
        online=online,
    )
    return Result(lab.with_runs(diagnosis, files, configuration), tuple(damage))


def _file(run: Run | Place) -> Path:
    return run.path if isinstance(run, Run) else Path(run)
