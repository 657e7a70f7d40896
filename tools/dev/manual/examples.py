"""An example of each command. In this order they run in one folder, with what they really print."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Example:
    """Lines for a shell, and whether the site shows what they print."""

    lines: tuple[str, ...]
    runs: bool = True


EXAMPLES = {
    "init": Example(("gritd init bench",)),
    "check-config": Example(("gritd check-config bench/testbed.yaml",)),
    "example": Example(("gritd example campaign",)),
    "estimate": Example(("gritd estimate campaign/run-*.mcap",)),
    "report": Example(("gritd report campaign/run-*.mcap -o report.html",)),
    "diagnose": Example(
        (
            "gritd example losses --effect coulomb_friction.loss=0.05",
            "gritd diagnose losses/run-*.mcap --config losses/testbed.yaml --quick"
            " --report diagnosis.html --apply explained.yaml",
        )
    ),
    "compare": Example(
        ("gritd compare campaign/run-*.mcap --config campaign/testbed.yaml --report compare.html",)
    ),
    "runs": Example(("gritd runs campaign --sort load",)),
    "info": Example(("gritd info campaign/run-070N.mcap",)),
    "replay": Example(("gritd replay campaign/run-070N.mcap",)),
    "diff": Example(("gritd diff campaign/run-040N.mcap campaign/run-070N.mcap",)),
    "export": Example(("gritd export campaign/run-070N.mcap --csv -o tables",)),
    "recover": Example(
        (
            "head -c 100000 campaign/run-070N.mcap > broken.mcap",
            "gritd recover broken.mcap",
        )
    ),
    "simulate": Example(
        (
            "gritd simulate --config bench/testbed.yaml"
            " --effect coulomb_friction.loss=0.5 --seed 1 -o run-1.mcap",
        )
    ),
    "effects": Example(("gritd effects bulldozing",)),
    "bed": Example(("gritd bed --directory runs new sand-may", "gritd bed --directory runs")),
    "demo": Example(("gritd demo --seconds 10",)),
    "reproduce": Example(("gritd reproduce --simulations 2000",)),
    "calibrate": Example(
        ("gritd calibrate pot --config bench/testbed.yaml --known '0, 10, 20, 50 mm' --in-place",),
        runs=False,
    ),
    "run": Example(
        ("gritd run --config bench/testbed.yaml --name sand-70N --load 70",), runs=False
    ),
    "status": Example(("gritd status --json",), runs=False),
    "monitor": Example(("gritd monitor",), runs=False),
    "view": Example(("gritd view campaign/run-*.mcap",), runs=False),
    "import": Example(
        (
            "gritd import series runs/*.csv --guess > map.yaml",
            "gritd import series runs/*.csv --map map.yaml -o out",
        ),
        runs=False,
    ),
    "prove": Example(("gritd prove --cases 2 --seed 1",), runs=False),
    "bench": Example(("gritd bench",), runs=False),
    "completion": Example(('eval "$(gritd completion bash)"',), runs=False),
}
