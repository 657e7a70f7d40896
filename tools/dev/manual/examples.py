"""An example of each command. In this order they run in one folder, with what they really print."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Example:
    """Lines for a shell, and how the site gets what they print."""

    lines: tuple[str, ...]
    before: str = ""  # what they need, in the same folder; DOCS is that of the documents
    during_demo: bool = False  # they need a daemon: that of the example of `demo`
    seconds: float | None = None  # Ctrl-C ends it then
    code: int = 0  # with which it may end, as well as 0
    shown: str = ""  # where they run for minutes: the page that has what they print


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
    "replay": Example(("gritd replay campaign/run-070N.mcap -o replayed.mcap",)),
    "diff": Example(("gritd diff campaign/run-040N.mcap campaign/run-070N.mcap",)),
    "export": Example(("gritd export campaign/run-070N.mcap --csv -o tables",)),
    "recover": Example(
        (
            "head -c 800000 campaign/run-070N.mcap > broken.mcap",
            "gritd recover broken.mcap",
        ),
        code=3,
    ),
    "simulate": Example(
        (
            "gritd simulate --config bench/testbed.yaml"
            " --effect coulomb_friction.loss=0.5 --seed 1 -o run-1.mcap",
        )
    ),
    "effects": Example(("gritd effects bulldozing",)),
    "bed": Example(("gritd bed --directory runs new sand-may", "gritd bed --directory runs")),
    "demo": Example(("gritd demo",), code=1),
    "reproduce": Example(("gritd reproduce --simulations 2000",)),
    "calibrate": Example(
        (
            "gritd calibrate pot --config bench/testbed.yaml --from pot.mcap"
            " --known '0, 10, 20, 50 mm' --known-sigma '0.02 mm' --in-place",
        ),
        before="cp $DOCS/first-day/bench.py . && python bench.py",
    ),
    "import": Example(
        (
            "gritd import series spreadsheet/*.csv --guess",
            "gritd import series spreadsheet/*.csv --map spreadsheet.yaml -o out",
        ),
        before="cp $DOCS/your-data/*.py $DOCS/your-data/*.yaml . && python strangers.py",
    ),
    "run": Example(
        ("gritd run --config bench/testbed.yaml --name sand-70N --load 70",), seconds=4.0, code=130
    ),
    "view": Example(("gritd view replayed.mcap",), seconds=4.0, code=130),
    "status": Example(("gritd status",), during_demo=True),
    "monitor": Example(("gritd monitor --once",), during_demo=True),
    "completion": Example(("gritd completion bash | head -n 8",)),
    "prove": Example(("gritd prove --cases 20 --seed 1",), shown="proof"),
    "bench": Example(("gritd bench",), shown="performance"),
}
