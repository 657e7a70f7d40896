"""`gritd reproduce`: the figures of Shibly, Iagnemma and Dubowsky (2005) next to ours."""

from __future__ import annotations

from collections.abc import Sequence

from gritd.tools.cli.command import DONE, Parser, whole
from gritd.tools.paper.approximation import simulations, table_3
from gritd.tools.paper.closed_forms import closed_forms, figure_3
from gritd.tools.paper.separability import fitted_soil, separability

SIMULATIONS = 60_000


def main(argv: Sequence[str]) -> int:
    """Print every section; 0 when done."""
    arguments = build_parser().parse_args(argv)

    for section in (
        closed_forms(arguments.seed),
        figure_3(),
        table_3(),
        simulations(arguments.simulations, arguments.seed),
        separability(),
        fitted_soil(),
    ):
        for line in section:
            print(line, flush=True)

    return DONE


def build_parser() -> Parser:
    parser = Parser(prog="gritd reproduce", description="The paper's figures next to ours.")
    parser.add_argument(
        "--simulations", type=whole(1), default=SIMULATIONS, help=f"default: {SIMULATIONS}"
    )
    parser.add_argument("--seed", type=whole(0), default=2005)

    return parser
