"""The page of the proofs on real recordings: sections of its own, failures in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gritd.tools.proof.real.__main__ import main
from gritd.tools.proof.real.bench import DiagnosisRun
from gritd.tools.proof.real.cmu import moduli
from gritd.tools.proof.real.figure import draw
from gritd.tools.proof.real.page import page, section
from gritd.tools.proof.real.proof import Check, FigureTable, Finding, Panel, Proof

LABELS = ("concealed", "as read", "freed")


def hypothesis(effect: str, accepted: bool, *alike: str) -> dict[str, object]:
    return {
        "effect": effect,
        "accepted": accepted,
        "indistinguishable_from": list(alike),
        "parameters": {"loss": {"value": 1.8}},
    }


def diagnosis(*hypotheses: dict[str, object]) -> DiagnosisRun:
    return DiagnosisRun(
        "gritd diagnose a.mcap", "verdict: unlisted", {"hypotheses": list(hypotheses)}, 1.0
    )


def finding() -> Finding:
    checks = [
        Check("Is it found?", "1.8", "none", False, "A reason\n  over two lines."),
        Check("How large?", "1.8", "none", False, "A reason over two lines."),
        Check("Is it said?", "yes", "yes", True, "not shown"),
    ]
    return Finding([diagnosis()], checks, FigureTable(("a", "b"), [("1|2", "3")]), [])


def proof() -> Proof:
    return Proof("one", "rig", "One", "Kept\n   back.", "Seen.", lambda _: finding())


def test_a_miss_stays_in_with_its_reason_once() -> None:
    text = section(proof(), finding(), ["gritd import rig", "gritd diagnose a.mcap"], 3.0)
    assert "1 of 3 as wanted." in text
    assert text.count("**no**") == 2
    assert "*Is it found?* *How large?* A reason over two lines." in text
    assert "not shown" not in text
    assert "gritd import rig\ngritd diagnose a.mcap\n" in text
    assert "| 1\\|2 | 3 |" in text


def test_a_section_is_replaced_in_its_place_and_the_rest_is_left() -> None:
    first = page(page("# Head\n", "one", "old\n"), "two", "other\n")
    again = page(first, "one", "new\n")
    assert "old" not in again
    assert again.startswith("# Head\n")
    assert again.index("new") < again.index("other")
    assert page(again, "one", "new\n") == again


def test_a_group_is_what_was_accepted_and_what_cannot_be_told_from_it() -> None:
    one = diagnosis(
        hypothesis("coulomb_friction", True, "current_offset"),
        hypothesis("grousers", False, "bulldozing"),
    )
    assert one.group == {"coulomb_friction", "current_offset"}
    assert one.values("coulomb_friction") == {"loss": 1.8}
    assert one.values("grousers") == {}


def test_moduli_of_a_plate_pressed_into_a_known_soil(tmp_path: Path) -> None:
    depth = np.linspace(2.0, 30.0, 50)
    force = 2.0e6 * (depth * 1e-3) ** 1.2 * np.pi * 0.03**2
    rows = [
        f"t,plate 60 mm,{d + 0.0125 * f:.6f},{f:.6f}" for d, f in zip(depth, force, strict=True)
    ]
    path = tmp_path / "penetration.csv"
    path.write_text("test,body,depth_mm,force_N\n" + "\n".join(rows) + "\nt,rigid stop,1,5\n")
    assert moduli(path) == pytest.approx((1.2, 2.0e6), rel=1e-3)


def test_a_figure_is_small(tmp_path: Path) -> None:
    time = np.linspace(0.0, 15.0, 150)
    curves = np.stack((time, *np.random.default_rng(0).standard_normal((3, time.size))))
    draw(tmp_path / "one.png", [Panel("a trial", curves, "time [s]", "torque [N·m]", LABELS)] * 2)
    assert 5_000 < (tmp_path / "one.png").stat().st_size < 100_000


def test_absent_data_are_skipped_with_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--data", str(tmp_path), "--output", str(tmp_path), "--only", "emps"]) == 0
    assert (
        f"EMPS, friction concealed: skipped, found no {tmp_path / 'emps'}"
        in capsys.readouterr().out
    )
    assert not (tmp_path / "real-recordings.md").exists()
