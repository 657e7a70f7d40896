"""What a diagnosis of a wheel loads before it reads anything."""

from __future__ import annotations

import subprocess
import sys


def test_neither_signal_processing_nor_distributions_of_scipy_are_loaded() -> None:
    """Together they take a second and 60 MB, for one filter and three tails."""
    code = (
        "import sys, gritd.tools.commands.diagnose;"
        "print(*{'scipy.signal', 'scipy.stats'} & sys.modules.keys())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
