"""The report in a real browser: no scrolling sideways on a phone, nothing cut in print. Skipped
without chromium.
"""

from __future__ import annotations

import html
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from gritd.tools.report import diagnosis
from tests.tools.report import cases

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--virtual-time-budget=4000",
)  # fmt: skip
MEASURE = """<iframe id="f" style="width:{width}px;height:800px" srcdoc="{page}"></iframe>
<script>document.getElementById('f').onload = e => {{
  const root = e.target.contentDocument.documentElement;
  const beyond = x => x.getBoundingClientRect().right > {width} + 1;
  const wide = [...root.querySelectorAll('body *')].filter(beyond);
  const loose = wide.filter(x => !x.closest('svg, .panel-title, thead'));
  document.title = root.scrollWidth + ' ' + loose.length;
}}</script>"""

pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")]


def browse(folder: Path, page: Path, *options: str) -> str:
    assert CHROMIUM is not None
    command = [CHROMIUM, *OPTIONS, f"--user-data-dir={folder / 'profile'}", *options, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


@pytest.mark.parametrize("width", [360, 390, 768])
@pytest.mark.parametrize("case", cases.ALL)
def test_nothing_is_wider_than_the_screen(case: str, width: int, tmp_path: Path) -> None:
    outer = tmp_path / "outer.html"
    outer.write_text(
        MEASURE.format(width=width, page=html.escape(diagnosis.render(cases.ALL[case]()))),
        encoding="utf-8",
    )
    title = re.search(r"<title>(\d+) (\d+)</title>", browse(tmp_path, outer, "--dump-dom"))
    assert title is not None
    assert int(title[1]) <= width and title[2] == "0"


def test_prints(tmp_path: Path) -> None:
    page, printed = tmp_path / "page.html", tmp_path / "page.pdf"
    diagnosis.write(cases.explained(), page)
    browse(tmp_path, page, f"--print-to-pdf={printed}", "--no-pdf-header-footer")
    text = printed.read_bytes()
    assert text.startswith(b"%PDF") and 4 <= len(re.findall(rb"/Type\s*/Page\b", text)) <= 10
    assert re.search(rb"/MediaBox\s*\[\s*0 0 59[45][.\d]* 84[12]", text)
