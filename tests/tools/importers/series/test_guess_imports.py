"""Whatever names and contents columns have: what `--guess` proposes, and each answer to what it
asks, is a map that imports.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from gritd.tools.commands.import_rig import main
from gritd.tools.importers.series import csv_text
from gritd.tools.importers.series.guess import guessed
from gritd.tools.importers.series.names import UNITS, WORDS

ROWS = 60
TIME = 0.02 * np.arange(ROWS)
NAME = r"(?:'(?:[^']|'')*'|[A-Za-z_]\w*)"
ANSWER = re.compile(
    rf"  # (?:in the place of (?P<other>{NAME}): )?(?P<line>{NAME}: \{{channel: .*)"
)
WHEEL = "\nwheel: {radius: 72 mm, width: 71 mm}\n"


def noisy(size: float) -> list[str]:
    rng = np.random.default_rng(1)
    return [f"{size + 0.05 * x:.4f}" for x in rng.standard_normal(ROWS)]


CONTENTS = {
    "rising": [f"{2.0 * t + 0.5:.4f}" for t in TIME],
    "falling": [f"{-3.0 * t:.4f}" for t in TIME],
    "some": noisy(20.0),
    "negative": noisy(-20.0),
    "constant": ["12"] * ROWS,
    "zero": ["0"] * ROWS,
    "whole": [f"{1000 * t:.0f}" for t in TIME],
    "words": ["on", "off"] * (ROWS // 2),
    "labels": ["a"] * 30 + ["b"] * 30,
    "few labels": ["a"] * 55 + ["b"] * 5,
    "distinct": [f"x{at}" for at in range(ROWS)],
    "gaps": ["" if at % 3 == 0 else f"{at / 10}" for at in range(ROWS)],
    "a gap": ["#N/A" if at == 5 else f"{at / 10 + at % 4}" for at in range(ROWS)],
    "one number": ["7.5"] + [""] * (ROWS - 1),
    "coarse": [f"{int(10 * t) / 10}" for t in TIME],
    "dates": [f"2026-11-26T14:03:{t + 5:09.6f}" for t in TIME],
    "open order": [f"03/04/2026 14:03:{t + 5:06.3f}" for t in TIME],
    "one day": ["2026-11-26"] * ROWS,
    "times of day": [f"14:03:{t + 5:09.6f}" for t in TIME],
    "seconds of a clock": [f"14:03:{int(t + 5):02d}" for t in TIME],
    "ns": [str(1_795_000_000_000_000_000 + round(1e9 * t)) for t in TIME],
    "days": [f"{46_352.5 + t / 86_400:.9f}" for t in TIME],
    "nothing": [""] * ROWS,
}
words = st.sampled_from([w.strip("~") for ws in WORDS.values() for w in ws.split()])
units = st.just("") | st.sampled_from([u for us in UNITS.values() for u in us.split()])
names = st.builds(
    lambda words, unit, form: form.format(" ".join(words), unit) if unit else " ".join(words),
    st.lists(words, min_size=1, max_size=3),
    units,
    st.sampled_from(["{} [{}]", "{}({})", "{}_{}"]),
)
columns = st.dictionaries(names, st.sampled_from(list(CONTENTS)), min_size=2, max_size=6)
usual = st.sampled_from(
    [
        {},
        {"time [s]": "rising", "wheel rpm": "some", "carriage mm/s": "some"},
        {"wheel rpm": "some", "carriage mm/s": "constant", "wheel torque Nm": "some"},
        {"time [s]": "coarse", "wheel deg": "rising", "carriage mm": "rising", "trial": "labels"},
        {"time": "open order", "wheel rpm": "constant", "motor current [A]": "some"},
    ]
)


def answers(text: str) -> Iterator[str]:
    """The map with the first answer to each question, then with each other one in its place."""
    questions: list[list[re.Match[str]]] = []
    fixed: list[str] = []
    for line in text.splitlines():
        match = ANSWER.match(line)
        if line.startswith("  # ? "):
            questions.append([])
        elif match and questions:
            questions[-1].append(match)
        else:
            fixed.append(line)

    first = [question[0] for question in questions]
    for at, question in enumerate(questions):
        for answer in question:
            yield _with(fixed, [*first[:at], answer, *first[at + 1 :]])
    yield _with(fixed, first)


def _with(fixed: list[str], given: list[re.Match[str]]) -> str:
    """The lines of a map with answers, each in the place of what it names."""
    replaced = tuple(f"  {match['other']}: " for match in given if match["other"])
    kept = [line for line in fixed if not (replaced and line.startswith(replaced))]
    at = kept.index("columns:") + 1
    return "\n".join([*kept[:at], *(f"  {match['line']}" for match in given), *kept[at:]])


@settings(
    max_examples=12,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    phases=[Phase.generate],
)
@given(given_columns=columns, beside=usual)
def test_a_proposal_and_each_answer_is_imported(
    tmp_path_factory: pytest.TempPathFactory, given_columns: dict[str, str], beside: dict[str, str]
) -> None:
    folder: Path = tmp_path_factory.mktemp("guess")
    table = {name: CONTENTS[kind] for name, kind in (given_columns | beside).items()}
    rows = ["\t".join(table), *map("\t".join, zip(*table.values(), strict=True))]
    (folder / "run.txt").write_text("\n".join([*rows, ""]), encoding="utf-8")

    text = guessed([csv_text.read(folder / "run.txt")])
    if "# ? no column was taken" in text or "{channel" not in text:
        return
    command = ["series", str(folder / "run.txt"), "--map", str(folder / "map.yaml")]
    for answer in answers(text.replace("# ? rate:", "rate:")):
        (folder / "map.yaml").write_text(answer + WHEEL, encoding="utf-8")
        assert main([*command, "-o", str(folder / "out")]) == 0, answer
