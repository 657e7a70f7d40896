"""docs/glossary.md gives each thing one word of the field; words that it replaces stay out."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
OUT = {
    r"had anyway": "baseline effects",
    r"habit": "reference score",
    r"allowances?": "nuisance columns",
    r"functions? without a name": "unexplained term",
    r"let go": "released",
    r"out of all measure": "above the reset threshold",
    r"asks? for [\d.]+ nats": "the threshold is",
    r"wants out": "active bound",
    r"no update survives": "updates are skipped",
    r"lost its way": "a poor local optimum",
    r"held for its (own )?stretch": "fitted within one segment",
    r"louder than stated": "noise exceeds the stated σ",
    r"along no condition": "uncorrelated with any covariate",
    r"(told|tells?|telling)( \w+)? apart": "distinguished",
    r"(is|are|was|were|be|been) told": "reported",
}
PATTERNS = {
    re.compile(rf"\b{words}\b".replace(" ", r"\s+"), re.I): better for words, better in OUT.items()
}
GENERATED = {ROOT / "docs/proof.md"}  # quotes verdicts of recordings as they were printed
TEXTS = sorted(
    path
    for place in ("docs", "config", "drivers", "estimator", "tools", "gritd/interface")
    for path in (ROOT / place).rglob("*")
    if path.suffix in (".md", ".py", ".yaml", ".html", ".js", ".c", ".pyi")
    and path not in GENERATED
    and "decisions" not in path.parts
)


CODE = re.compile(r"`[\w/.]+`")  # names of files and keys


def test_words_that_are_out_stay_out() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {match[0]!r}; write: {better}"
        for path in (*TEXTS, ROOT / "README.md", ROOT / "CONTRIBUTING.md")
        for pattern, better in PATTERNS.items()
        for match in pattern.finditer(CODE.sub("", path.read_text(encoding="utf-8")))
    ]
    assert found == []
