"""The layouts for Foxglove, PlotJuggler and Grafana ask for what gritd writes alone."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

from gritd.config import packaged
from gritd.estimator.recording.topics import RAW_TOPICS, TOPICS
from gritd.tools.commands.status import prometheus
from tests.tools.view.samples import report

FIELDS = {f"{topic.name}.{name}" for topic in (*RAW_TOPICS, *TOPICS) for name in topic.names}
LAYOUTS = packaged("layouts")


def foxglove() -> dict[str, Any]:
    made: dict[str, Any] = json.loads((LAYOUTS / "foxglove.json").read_text(encoding="utf-8"))
    return made


def leaves(layout: Any) -> Iterator[str]:
    """The panels of a layout of Foxglove."""
    if isinstance(layout, str):
        yield layout
    else:
        yield from (*leaves(layout["first"]), *leaves(layout["second"]))


def test_foxglove_finds_every_panel_and_field() -> None:
    made = foxglove()
    panels = made["configById"]
    shown = [made["layout"], *(i for t in panels["Tab!gritd"]["tabs"] for i in leaves(t["layout"]))]
    assert sorted(shown) == sorted(panels)

    (script,) = made["userNodes"].values()
    source = script["sourceCode"]
    (topic,) = re.findall(r'output = "(.*)"', source)
    (read,) = re.findall(r'inputs = \["(.*)"\]', source)
    computed = {f"{topic}.{name}" for name in re.findall(r"(\w+): number", source)}
    assert {f"{read}.{name}" for name in re.findall(r"tick\.(\w+)", source)} <= FIELDS

    paths = {p["value"] for panel in panels.values() for p in panel.get("paths", ())}
    asked = {path for path in paths if not re.fullmatch(r"-?\d+", path)}
    assert asked & computed == computed and asked <= FIELDS | computed


def test_plotjuggler_finds_every_curve() -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    known = {name.replace(".", "/") for name in FIELDS}
    computed = {}
    for snippet in root.iter("snippet"):
        sources = [snippet.findtext("linked_source"), *(v.text for v in snippet.iter("v1"))]
        computed[snippet.get("name")] = sources
        assert set(sources) <= known and (snippet.findtext("function") or "").startswith("return")

    curves = {curve.get("name") for curve in root.iter("curve")}
    assert curves <= known | computed.keys() and computed.keys() <= curves
    for splitter in root.iter("DockSplitter"):
        count = int(splitter.get("count", "0"))
        assert len(splitter) == count == len(splitter.get("sizes", "").split(";"))


def test_grafana_asks_for_metrics_that_are_exported() -> None:
    disagreement = {"channel": "torque", "since": 0.0, "sigmas": 12.0}
    lines = prometheus(report(disagreement=disagreement))
    exported = {line.split(" ")[2] for line in lines if line.startswith("# TYPE")}

    board = json.loads((LAYOUTS / "grafana.json").read_text(encoding="utf-8"))
    asked = [t["expr"] for panel in board["panels"] for t in panel["targets"]]
    names = {name for expression in asked for name in re.findall(r"gritd_\w+", expression)}
    assert len(asked) > 20 and names <= exported
    assert {name for name in exported if "sigma" in name} <= names
