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
from typing import Any


def hypothesis(name: str, probability: float, *like: str, accepted: bool = False) -> dict[str, Any]:
    return {
        "effect": name,
        "probability": probability,
        "accepted": accepted,
        "parameters": {},
        "indistinguishable_from": list(like),
    }


def main(arguments: list[str]) -> int:
    files = [name for name in arguments if name.endswith(".mcap")]
    out = Path(arguments[arguments.index("--json") + 1])
    seen = sorted(str(path.relative_to(Path.cwd())) for path in Path.cwd().rglob("*"))
    if not files or any(not Path(name).exists() for name in files):
        return 2
    quantity = {"value": 1000.0, "sigma": 100.0}
    soil = {"c": quantity, "tan_phi": {"value": 0.6, "sigma": 0.05}}
    said = {
        "verdict": "explained",
        "summary": "stub",
        "seen": seen,
        "asked": arguments,
        "environment": sorted(os.environ),
        "hypotheses": [
            hypothesis("coulomb_friction", 0.7, "current_offset", accepted=True),
            hypothesis("bed_slope", 0.2),
        ],
        "soil": {"before": soil, "after": soil},
    }
    out.write_text(json.dumps(said), encoding="utf-8")

    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
