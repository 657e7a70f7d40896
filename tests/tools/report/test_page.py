"""The report says what was found, is well-formed, needs nothing from outside, and lets nothing from
outside in.
"""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gritd.tools.diagnose.explain.result import Hypothesis, Quantity, Reference
from gritd.tools.report import diagnosis, hypotheses
from gritd.tools.report.html import escape, tag
from tests.tools.report import cases

Element = ElementTree.Element


def parsed(page: str) -> Element:
    """The document as XML, which is stricter than HTML."""
    return ElementTree.fromstring(page.removeprefix("<!DOCTYPE html>"))


def words(page: str) -> str:
    return " ".join(" ".join(parsed(page).find("body").itertext()).split())  # type: ignore[union-attr]


@pytest.fixture(scope="module", params=cases.ALL)
def page(request: pytest.FixtureRequest) -> str:
    return diagnosis.render(cases.ALL[request.param]())


def test_page_is_well_formed_and_has_one_title(page: str) -> None:
    root = parsed(page)
    assert root.get("lang") == "en" and len(list(root.iter("h1"))) == 1
    levels = [int(e.tag[1]) for e in root.iter() if re.fullmatch("h[1-6]", e.tag)]
    assert levels[0] == 1 and set(levels[1:]) <= {2}
    names = [heading.text for heading in root.iter("h2")]
    assert len(names) == len(set(names))


def test_page_needs_nothing_from_outside(page: str) -> None:
    root = parsed(page)
    assert not {e.tag for e in root.iter()} & {
        "link",
        "img",
        "iframe",
        "object",
        "form",
        "base",
    }
    assert not [
        a for e in root.iter() for a in e.attrib if a in ("src", "action") or a.startswith("on")
    ]
    assert all(e.get("href", "#").startswith("#") for e in root.iter())

    style = "".join(e.text or "" for e in root.iter("style"))
    assert "url(" not in style and "@import" not in style and "@font-face" not in style

    policy = next(e.get("content") for e in root.iter("meta") if e.get("http-equiv"))
    assert policy is not None and policy.startswith("default-src 'none'")

    (script,) = root.iter("script")
    digest = base64.b64encode(hashlib.sha256((script.text or "").encode()).digest()).decode()
    assert not script.attrib and policy.endswith(f"script-src 'sha256-{digest}'")


def test_every_picture_has_words_and_every_table_its_headings(page: str) -> None:
    root = parsed(page)
    pictures = [e for e in root.iter("svg") if e.get("class") == "plot"]
    assert pictures

    for picture in pictures:
        assert (
            picture.get("role") == "img"
            and picture[0].tag == "title"
            and len(picture[0].text or "") > 20
        )

    assert all(figure.find("figcaption") is not None for figure in root.iter("figure"))

    for table in root.iter("table"):
        columns = table.findall("thead/tr/th")
        assert columns and all(th.get("scope") == "col" for th in columns)
        assert all(
            len(row) == len(columns) and row[0].get("scope") == "row"
            for row in table.findall("tbody/tr")
        )


def test_numbers_of_pictures_are_finite(page: str) -> None:
    for path in re.findall(r' (?:d|x|y|x1|x2|y1|y2|cx|cy|width|height)="([^"]*)"', page):
        assert "nan" not in path and "inf" not in path


def test_without_an_explanation_no_second_simulation_is_drawn() -> None:
    plain, explained = (parsed(diagnosis.render(f())) for f in (cases.consistent, cases.explained))
    drawn = [[e.get("class") for e in root.iter("path")] for root in (plain, explained)]
    assert "line after" not in drawn[0] and "line after" in drawn[1]


def test_text_from_outside_stays_text() -> None:
    found = cases.hostile()
    page = diagnosis.render(found)
    assert "<script>alert" not in page and "<img" not in page
    assert not set(page) & {"\x00", "\udcff", "\u202e"}
    assert "<script>alert(1)</script>" in unescape(page)
    page.encode("utf-8")


def test_writes_utf8(tmp_path: Path) -> None:
    diagnosis.write(cases.hostile(), tmp_path / "r.html")
    assert "±" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_page_stays_small() -> None:
    assert len(diagnosis.render(cases.several())) < 600_000


def test_attributes_are_escaped() -> None:
    assert tag("p", "a<b", tag("b", "&"), title='"><script>') == (
        '<p title="&quot;&gt;&lt;script&gt;">a&lt;b<b>&amp;</b></p>'
    )
    assert escape("a\x1b[31m") == "a\ufffd[31m"


def hypothesis(name: str, probability: float, *near: str, accepted: bool = False) -> Hypothesis:
    return Hypothesis(name, probability, 1.0, {"x": Quantity(1.0, 0.1)}, near, accepted)


def test_groups_join_what_cannot_be_told_apart_in_either_direction() -> None:
    of = [
        hypothesis("a", 0.5, "c"),
        hypothesis("b", 0.3),
        hypothesis("c", 0.1),
        hypothesis("d", 0.1, "c", "unknown"),
    ]
    assert [[h.effect for h in group] for group in hypotheses.together(of)] == [
        ["a", "c", "d"],
        ["b"],
    ]


def test_accepted_effect_leads_whatever_its_probability() -> None:
    of = [hypothesis("a", 0.5), hypothesis("b", 0.004, accepted=True)]
    page = str(hypotheses.groups(of))
    assert page.index(">b<") < page.index(">a<") and "<summary>" not in page


def test_redo_takes_whatever_it_finds() -> None:
    found = replace(
        cases.consistent(),
        redo={"files": {"a.mcap": {"sha256": "f" * 64}}, "settings": {"level": 0.01}},
    )
    said = words(diagnosis.render(found))
    assert "a.mcap " + "f" * 64 in said and "level 0.01" in said
    found = replace(found, redo={"files": {"my run.mcap": "e" * 64}, "seed": 3})
    said = words(diagnosis.render(found))
    assert "gritd diagnose --redo report.html" in said and "my run.mcap " + "e" * 64 in said


def test_a_misfit_between_runs_is_drawn_run_by_run_and_once() -> None:
    found = cases.explained()
    scatter = replace(
        found.scatters[0],
        covariate="run",
        covariate_unit="-",
        x=[float(r) for r in found.scatters[0].run],
    )
    everywhere = replace(scatter, covariate="constant", x=[1.0] * len(scatter.x))
    page = diagnosis.render(replace(found, scatters=(scatter, everywhere)))
    pictures = [e for e in parsed(page).iter("svg") if "against run" in (e[0].text or "")]

    assert len(pictures) == 2  # without and with, not drawn again for the constant

    labels = [t.text for t in pictures[0].iter("text")]
    assert all(run in labels for run in ("40 N", "120 N"))

    means = [p for p in pictures[0].iter("path") if p.get("class") == "line mean"]
    assert len(means) == len(cases.LOADS)


def test_change_points_are_drawn_and_named() -> None:
    """A line where the misfit starts; between two runs, with the name of the one beyond."""
    found = cases.explained()
    place = replace(found.location[1], changes=(0.3,))
    page = parsed(diagnosis.render(replace(found, location=(place,))))
    lines = [line for line in page.iter("line") if line.get("class") == "change"]

    assert len(lines) == 2  # without and with

    runs = replace(place, covariate="run", changes=(3.0,))
    scatter = replace(
        found.scatters[0], covariate="run", x=[float(r) for r in found.scatters[0].run]
    )
    page = parsed(diagnosis.render(replace(found, location=(runs,), scatters=(scatter,))))

    assert "70 N" in [" ".join(td.itertext()) for td in page.iter("td")]

    line = next(line for line in page.iter("line") if line.get("class") == "change")
    labels = {
        t.text: float(t.get("x") or 0) for t in page.iter("text") if t.text in ("55 N", "70 N")
    }
    assert labels["55 N"] < float(line.get("x1") or 0) < labels["70 N"]


def test_one_error_where_nothing_was_explained() -> None:
    same = replace(cases.consistent().fit, after=cases.consistent().fit.before)
    root = parsed(diagnosis.render(replace(cases.consistent(), fit=same)))
    heads = [[th.text for th in table.findall("thead/tr/th")] for table in root.iter("table")]
    assert ["channel", "error", "noise floor", "error ÷ floor"] in heads


def test_what_is_accepted_comes_first_and_says_that_others_are_like_it() -> None:
    one = Quantity(1.0, 0.1, "N·m")
    alike = ("stribeck_friction", "wheel_inertia")
    equals = (
        Hypothesis("stribeck_friction", 0.4, 9.0, {"a": one}, ("coulomb_friction",)),
        Hypothesis("coulomb_friction", 0.3, 9.0, {"loss": one}, alike, accepted=True),
        Hypothesis("wheel_inertia", 0.1, 9.0, {"inertia": one}, ("coulomb_friction",)),
    )
    (group,) = hypotheses.together(equals)
    assert [h.effect for h in group] == ["coulomb_friction", "stribeck_friction", "wheel_inertia"]

    found = replace(cases.ALL["explained"](), hypotheses=equals)
    said = words(diagnosis.render(found))
    assert "Explained: Coulomb friction or similar" in said
    assert "80 % probable" in said


def test_in_a_tie_the_simpler_effect_stands_first_and_each_shows_its_equation() -> None:
    one, two = Quantity(1.0, 0.1, "N·m"), Quantity(0.1, 0.01, "-")
    tied = [
        Hypothesis("stribeck_friction", 0.402, 9.0, {"a": one, "b": two}, equation="T_S = …"),
        Hypothesis("coulomb_friction", 0.398, 9.0, {"loss": one}, equation="T_C = …"),
    ]
    names = [h.effect for group in hypotheses.together(tied) for h in group]
    assert names == ["coulomb_friction", "stribeck_friction"]

    said = words(diagnosis.render(replace(cases.ALL["explained"](), hypotheses=tuple(tied))))
    assert said.index("T_C = …") < said.index("T_S = …")
    assert "A probability is the share of an effect among all that was weighed" in said


def test_the_runs_stand_before_the_pictures_with_their_notes() -> None:
    said = words(with_runs(("raked twice", ""), ("A. Engineer", "A. Engineer")))
    assert said.index("raked twice") < said.index("Simulation against recording")
    assert said.count("0123456789ab") == 2


def with_runs(notes: tuple[str, str], operators: tuple[str, str]) -> str:
    rows = [
        {
            "run": f"r{at}",
            "date": f"2026-11-2{at} 10:00",
            "SHA-256": "0123456789ab",
            "operator": operators[at],
            "notes": notes[at],
        }
        for at in range(2)
    ]
    found = cases.explained()
    reported = {"rig": "bench <three>", "runs": rows}
    return diagnosis.render(replace(found, redo={**found.redo, **reported}))


@pytest.mark.parametrize(
    ("notes", "operators", "first", "columns"),
    [
        (("dry", "dry"), ("Ada", "Ada"), "operator Ada notes dry", False),
        (("dry", "wet"), ("Ada", "Bo"), "operator Ada and Bo notes see the runs", True),
        (("", ""), ("", ""), "operator not stated", False),
    ],
)
def test_rig_date_operator_and_notes_stand_on_the_first_page(
    notes: tuple[str, str], operators: tuple[str, str], first: str, columns: bool
) -> None:
    """What all runs share stands once; what differs stands in the table of runs."""
    page = with_runs(notes, operators)
    before, after = (" ".join(part.split()) for part in words(page).split(" Runs ", 1))
    assert "rig bench <three> date 2026-11-20 … 2026-11-21 (UTC)" in spaced(page)
    assert first in spaced(page)
    head = after[: after.index("r0")]
    assert ("operator" in head and "notes" in head) == columns
    assert "Explained" in before


def spaced(page: str) -> str:
    """The words of the first page's entries."""
    root = parsed(page)
    entries = next(e for e in root.iter("dl") if e.get("class") == "masthead")
    return " ".join(" ".join(entries.itertext()).split())


def test_what_the_reference_shows_too_is_told_and_is_no_calibration() -> None:
    lag = {"length": Quantity(0.046, 0.002, "m")}
    held_against = Reference("explained", 1.0, "", {"contact_relaxation": lag})
    nuisance = {"contact_relaxation.length": lag["length"]}
    page = unescape(diagnosis.render(cases.base(nuisance=nuisance, reference=held_against)))
    assert "contact relaxation in both campaigns: length" in page
    assert "46.0 ± 2.0 mm" in page and "calibration:" not in page
    assert "The reference shows contact relaxation by itself" in page
