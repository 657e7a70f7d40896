"""The report in a real browser: no scrolling sideways on a phone, nothing cut in print. Skipped
without chromium.
"""

from __future__ import annotations

import html
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

import gritd
from gritd.config import packaged
from gritd.tools.commands import report
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

ZOOM = """<iframe id="f" style="width:1280px;height:900px" srcdoc="{page}"></iframe>
<script>document.getElementById('f').onload = e => {{
  const page = e.target.contentDocument, view = e.target.contentWindow;
  const plot = page.querySelector('svg.zoomable'), frame = plot.querySelector('g[data-x]');
  const labels = () => [...plot.querySelectorAll('text.tick')].map(x => x.textContent).join(' ');
  const scale = () => plot.querySelector('svg path').getAttribute('transform') || 'none';
  const [x0, x1] = frame.dataset.x.split(' ').slice(2).map(Number);
  const [y0, y1] = frame.dataset.y.split(' ').slice(2).map(Number);
  const at = (type, x, y) => {{
    const p = new view.DOMPoint(x, y).matrixTransform(plot.getScreenCTM());
    const where = {{clientX: p.x, clientY: p.y, button: 0, pointerType: 'mouse', bubbles: true}};
    plot.dispatchEvent(new view.PointerEvent(type, where));
  }};
  const before = labels();
  at('pointerdown', x0 + 0.25 * (x1 - x0), (y0 + y1) / 2);
  at('pointermove', x0 + 0.5 * (x1 - x0), (y0 + y1) / 2);
  at('pointerup', x0 + 0.75 * (x1 - x0), (y0 + y1) / 2);
  const told = [scale(), before !== labels()];
  plot.dispatchEvent(new view.Event('dblclick'));
  told.push(scale(), before === labels(), plot.querySelectorAll('.chosen').length);
  document.title = told.join('|');
}}</script>"""
MOST_PAGES = 6  # of A4, the configuration among them

pytestmark = [pytest.mark.long, pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")]


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


@pytest.mark.parametrize("case", cases.ALL)
def test_prints(case: str, tmp_path: Path) -> None:
    page, printed = tmp_path / "page.html", tmp_path / "page.pdf"
    made = cases.ALL[case]()
    redo = {**made.redo, "configuration": packaged().read_text(encoding="utf-8")}
    diagnosis.write(replace(made, redo=redo), page)
    browse(tmp_path, page, f"--print-to-pdf={printed}", "--no-pdf-header-footer")
    text = printed.read_bytes()
    assert (
        text.startswith(b"%PDF") and 2 <= len(re.findall(rb"/Type\s*/Page\b", text)) <= MOST_PAGES
    )
    assert re.search(rb"/MediaBox\s*\[\s*0 0 59[45][.\d]* 84[12]", text)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of `gritd report`: six runs at four loads each, forces and estimates."""
    folder, runs = tmp_path_factory.mktemp("campaign"), []
    steps = [
        {"duration": 3.0, "load": load, "slip": slip, "speed": 0.02}
        for load in (30.0, 50.0, 70.0, 90.0)
        for slip in (0.1, 0.4)
    ]
    for seed in range(6):
        runs.append(str(folder / f"run-{seed}.mcap"))
        gritd.simulate(schedule=steps, seed=seed).write(runs[-1])
    assert report.main([*runs, "-o", str(folder / "page.html")]) == 0
    return folder / "page.html"


def test_a_campaign_fits_a_phone_and_six_pages(campaign: Path, tmp_path: Path) -> None:
    outer, printed = tmp_path / "outer.html", tmp_path / "page.pdf"
    page = campaign.read_text(encoding="utf-8")
    outer.write_text(MEASURE.format(width=390, page=html.escape(page)), encoding="utf-8")
    title = re.search(r"<title>(\d+) (\d+)</title>", browse(tmp_path, outer, "--dump-dom"))
    assert title is not None and int(title[1]) <= 390 and title[2] == "0"

    browse(tmp_path, campaign, f"--print-to-pdf={printed}", "--no-pdf-header-footer")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed.read_bytes())) <= MOST_PAGES


def test_a_drag_zooms_and_a_double_click_shows_the_whole_again(tmp_path: Path) -> None:
    outer = tmp_path / "outer.html"
    page = html.escape(diagnosis.render(cases.explained()))
    outer.write_text(ZOOM.format(page=page), encoding="utf-8")
    title = re.search(r"<title>(.*)</title>", browse(tmp_path, outer, "--dump-dom"))
    assert title is not None
    zoomed, other, whole, same, left = title[1].split("|")
    for transform, scale in ((zoomed, 2.0), (whole, 1.0)):
        across, *_, down, _, _ = map(float, transform.removeprefix("matrix(").rstrip(")").split())
        assert (across, down) == pytest.approx((scale, 1.0))
    assert (other, same, left) == ("true", "true", "0")
