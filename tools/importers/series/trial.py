"""Whether a proposed map would be taken: it is tried on the rows that it was made from."""

from __future__ import annotations

from collections.abc import Sequence

from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from gritd.tools.cli.command import CommandError
from gritd.tools.importers.segments import START
from gritd.tools.importers.series import written
from gritd.tools.importers.series.clocks import runs_of_parts
from gritd.tools.importers.series.columns import SeriesTable
from gritd.tools.importers.series.convert import converted
from gritd.tools.importers.series.mapping import loads
from gritd.tools.importers.series.runs import check
from gritd.tools.importers.series.sources import parts_of, stem

STATED = (
    "wheel: {radius: 72 mm, width: 71 mm}\n"  # what no file holds; no import depends on its size
)


def refusal(text: str, tables: Sequence[SeriesTable], whole: bool = True) -> str:
    """Why an import would not take files by a map, in one line; '' where it would.

    whole: whether the map has wheel and carriage; else the times and the runs are tried alone.
    """
    try:
        mapped = loads(text + STATED, "map.yaml")
        runs = []
        for path in dict.fromkeys(table.path for table in tables):
            own = [table for table in tables if table.path == path]
            found = parts_of(path, own, mapped.sources[0], mapped)
            runs += list(runs_of_parts(found, mapped, stem(path.name)))
        check(runs, mapped)

        if whole:
            base, configured = written.base(mapped, None)
            imported = converted(runs, mapped, configured.settings, START)
            config.loads(written.written(base, configured.source, imported), "csv.yaml", None)
    except (CommandError, ConfigError) as error:
        return str(error)
    return ""
