"""A diagnoser that knows nothing of soil: it stands for `gritd diagnose` where only the trial
around it is tested.

    python -m tests.tools.proof.blind.stub FILES --config F --json OUT

It always names coulomb_friction, and tells what it saw of its folder and environment.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path


def main(arguments: list[str]) -> int:
    files = [name for name in arguments if name.endswith(".mcap")]
    out = Path(arguments[arguments.index("--json") + 1])
    seen = sorted(path.name for path in Path.cwd().iterdir())
    if not files or any(not Path(name).exists() for name in files):
        return 2
    quantity = {"value": 1000.0, "sigma": 100.0}
    soil = {"c": quantity, "tan_phi": {"value": 0.6, "sigma": 0.05}}
    said = {
        "verdict": "explained",
        "summary": "stub",
        "seen": seen,
        "environment": sorted(os.environ),
        "hypotheses": [
            {"effect": "coulomb_friction", "probability": 0.7, "accepted": True, "parameters": {},
             "indistinguishable_from": ["current_offset"]},
            {"effect": "bed_slope", "probability": 0.2, "parameters": {},
                "indistinguishable_from": []},
        ],
        "soil": {"before": soil, "after": soil},
    }  # fmt: skip
    out.write_text(json.dumps(said), encoding="utf-8")

    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
