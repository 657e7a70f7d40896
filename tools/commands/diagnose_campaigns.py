"""`gritd diagnose --campaigns DIR`: every campaign in a folder, side by side on local processes or
on a cluster.

A campaign is a folder in DIR with recordings (*.mcap) and one configuration (*.yaml). Its result
and its report are written beside them; like `make`, a campaign whose result is newer than its files
is not diagnosed again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, as_completed
from dataclasses import dataclass
from pathlib import Path

from gritd.tools.cli.cluster import killed_workers
from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.cli.progress import Progress
from gritd.tools.cli.workers import workers

RESULT, REPORT = "diagnosis.json", "diagnosis.html"


@dataclass(frozen=True)
class CampaignFiles:
    """Files of one campaign. On a cluster the workers must see them under the same path."""

    folder: Path
    files: tuple[Path, ...]
    configuration: Path

    @property
    def result(self) -> Path:
        return self.folder / RESULT

    @property
    def done(self) -> bool:
        try:
            when = self.result.stat().st_mtime
        except FileNotFoundError:
            return False
        return all(path.stat().st_mtime < when for path in (*self.files, self.configuration))

    def arguments(self) -> list[str]:
        """What `gritd diagnose` is given for this campaign alone."""
        named = [*map(str, self.files), "--config", str(self.configuration)]

        return [
            *named,
            "--json",
            str(self.result),
            "--report",
            str(self.folder / REPORT),
            "--jobs",
            "1",
        ]


def find(folder: Path) -> list[CampaignFiles]:
    """The campaigns of a folder, by name. Raises CommandError where there is none, or one without a
    configuration.
    """
    if not folder.is_dir():
        raise CommandError(
            f"--campaigns {folder}: found no folder; expected one that holds a folder a campaign",
            USAGE,
        )

    campaigns = [
        _campaign(each.resolve()) for each in sorted(folder.iterdir()) if any(each.glob("*.mcap"))
    ]
    if not campaigns:
        raise CommandError(
            f"--campaigns {folder}: found no folder with recordings (*.mcap) in it", USAGE
        )

    return campaigns


def _campaign(folder: Path) -> CampaignFiles:
    configurations = sorted(folder.glob("*.yaml"))
    if len(configurations) != 1:
        raise CommandError(
            f"{folder}: found {len(configurations)} files *.yaml; expected its configuration", USAGE
        )
    return CampaignFiles(folder, tuple(sorted(folder.glob("*.mcap"))), configurations[0])


def diagnosed(
    campaigns: list[CampaignFiles],
    work: Callable[[CampaignFiles], str],
    jobs: int,
    scheduler: str | None,
) -> Iterator[tuple[CampaignFiles, str]]:
    """Each campaign that is not done, with what `work` said of it, as they come."""
    left = [campaign for campaign in campaigns if not campaign.done]
    with workers(jobs, scheduler) as (executor, _), Progress("campaigns", len(left)) as progress:
        futures = {executor.submit(work, campaign): campaign for campaign in left}
        for future in as_completed(futures):
            progress.advance()
            yield futures[future], _said(future)


def _said(future: Future[str]) -> str:
    """What was said of a campaign. One that its workers do not survive spoils no other."""
    try:
        return future.result()
    except Exception as error:
        if not killed_workers(error):
            raise
        return "not diagnosed: the workers that had it ended, perhaps for want of memory"
