"""The campaign that the recordings of a page make: computed by `gritd report` in a process of its
own, which the page does not wait for.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from threading import Thread
from typing import Any

from gritd.estimator.visible import visible
from gritd.tools.cli.offspring import ends_with_us

NICE = ("nice", "-n", "10")


class ViewedCampaign:
    """state: computing, done, or failed with a reason."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = paths
        self.answer: dict[str, Any] = {"state": "computing"}
        self._thread = Thread(target=self._run, name="campaign", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def _run(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "campaign.json"
            report = (sys.executable, "-m", "gritd", "report", *map(str, self._paths))
            done = subprocess.run(
                [*NICE, *report, "--json", str(out)],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                preexec_fn=ends_with_us(),
            )
            if out.is_file():
                self.answer = {"state": "done", **json.loads(out.read_text(encoding="utf-8"))}
            else:
                last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
                self.answer = {"state": "failed", "reason": visible(last)[:300]}
