"""The pages that walk through the code name files and functions that are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ("from-byte-to-estimate.md", "from-recording-to-verdict.md")
SOURCES = [
    path for part in ("drivers", "estimator", "tools") for path in (ROOT / part).rglob("*.*")
]
CODE = "\n".join(p.read_text(encoding="utf-8") for p in SOURCES if p.suffix == ".py")
PLACES = {str(path.relative_to(ROOT)) for path in SOURCES}
NAME = re.compile(r"^[A-Za-z_.]+(?:\(.*\))?$")


@pytest.mark.parametrize("page", PAGES)
def test_what_is_named_exists(page: str) -> None:
    text = re.sub(r"^```.*?^```", "", (ROOT / "docs" / page).read_text("utf-8"), flags=re.M | re.S)
    for name in re.findall(r"`([^`]+)`", text):
        if name.endswith((".py", ".c", ".json")):
            assert any(place.endswith(f"/{name}") or place == name for place in PLACES), name
        elif name.endswith("/"):
            assert any(f"/{name}" in f"/{place}" for place in PLACES), name
        elif NAME.match(name) and (name[0].isupper() or "_" in name):
            for part in name.split("(")[0].split("."):
                assert re.search(rf"(def|class) {part}\b|^\s*{part}\b", CODE, re.M), name
