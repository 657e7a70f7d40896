"""The page in a real browser beside a daemon: right values, no complaint, no outside host, any
screen. Skipped without chromium.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("uvicorn", reason="needs gritd[view]")
from tests.tools.view.browser import CHROMIUM, Browser, browser
from tests.tools.view.process import answers, viewing
from tests.tools.view.samples import daemon, report

PAGE = Path(__file__).parents[3] / "tools" / "view" / "page"
chromium = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")


def test_the_page_names_no_other_host_and_makes_no_markup_of_text() -> None:
    for path in PAGE.iterdir():
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert not re.search(
            r"https?:|//[a-z]+\.|innerHTML|insertAdjacent|document\.write|eval\(", text
        )


def rising(at: float) -> dict[str, Any]:
    return report(at, {"cohesion": 800.0 + 10.0 * at})


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    socket = tmp_path_factory.mktemp("view") / "gritd.sock"
    with daemon(socket, rising), viewing("--socket", str(socket)) as (_, address):
        assert answers(address)
        yield address


@pytest.fixture
def tab(tmp_path: Path, address: str) -> Iterator[Browser]:
    with browser(tmp_path / "profile") as tab:
        tab.screen(1280, 900)
        tab.open(address)
        tab.wait("document.querySelector('#title')?.textContent === 'Tracking the soil'")
        tab.wait("document.querySelectorAll('#values dd').length > 0")
        yield tab
        assert tab.complaints == []
        assert {url for url in tab.asked if not url.startswith((address, "data:"))} == set()


@chromium
def test_values_are_those_of_their_tick(tab: Browser) -> None:
    for _ in range(5):
        time.sleep(0.3)
        sequence, shown = tab.value(
            "[document.body.dataset.sequence,"
            " document.querySelector('#values dd span').textContent]"
        )
        assert abs(float(shown) - (800.0 + 10.0 * int(sequence) / 250)) <= 0.5 + 10.0 / 250
    assert tab.value("document.querySelector('#about').textContent").count("<b>") == 1  # as text


@pytest.mark.long
@chromium
@pytest.mark.parametrize("width, dark", [(360, False), (390, True), (768, False), (1920, True)])
def test_nothing_is_wider_than_the_screen(tab: Browser, width: int, dark: bool) -> None:
    tab.screen(width, 800, dark)
    time.sleep(0.5)
    assert tab.value("document.documentElement.scrollWidth") <= width
    paper = tab.value("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", paper))) < 200) == dark


@pytest.mark.long
@chromium
def test_pause_zoom_and_back_by_mouse_and_keys(tab: Browser) -> None:
    tab.wait("document.querySelector('#span').textContent.includes('UTC')")
    time.sleep(2.0)
    over = tab.value(
        "(e => { e.scrollIntoView({block: 'center'}); const r = e.getBoundingClientRect();"
        " return [r.left, r.top, r.width, r.height] })(document.querySelector('.u-over'))"
    )
    y = over[1] + over[3] / 2
    tab.drag((over[0] + 0.9 * over[2], y), (over[0] + 0.97 * over[2], y))
    held = "document.querySelector('#pause').textContent"
    assert tab.value(held) == "Paused"
    tab.key("Escape")
    assert tab.value(held) == "Pause"
    tab.key(" ", " ")
    before = tab.value("document.querySelector('#span').textContent")
    time.sleep(1.2)
    assert tab.value("document.querySelector('#span').textContent") == before
    tab.key(" ", " ")
    tab.wait(f"document.querySelector('#span').textContent !== {before!r}")


@pytest.mark.long
@chromium
def test_every_picture_has_words_and_prints(tab: Browser) -> None:
    images = "[...document.querySelectorAll('[role=img]')].map(e => e.getAttribute('aria-label'))"
    tab.wait(f"{images}.every(words => words && words.length > 20)")
    assert len(tab.value(images)) >= 14
    assert tab.printed().startswith(b"%PDF")


@pytest.mark.long
@chromium
def test_the_page_outlives_the_daemon(tmp_path: Path) -> None:
    socket = tmp_path / "gritd.sock"
    with viewing("--socket", str(socket)) as (_, address), browser(tmp_path / "profile") as tab:
        tab.screen(1280, 900)
        with daemon(socket):
            tab.open(address)
            tab.wait("document.body?.dataset.sequence > 0")
        tab.wait("document.querySelector('#title').textContent === 'No daemon'")
        with daemon(socket, lambda at: report(at + 60.0, pid=78)):
            tab.wait("document.body.dataset.sequence > 250 * 60")
            tab.wait("document.querySelector('#title').textContent === 'Tracking the soil'")
        assert tab.complaints == []
