"""The page's part on coverage says what a report says, and nothing else of the page changes."""

from __future__ import annotations

import json

from gritd.tools.dev import coverage


def report(tmp_path, taken):
    """A report on two files, of which `taken` of 20 branches of one are taken."""
    whole = {"summary": {"covered_branches": 40, "num_branches": 40}, "missing_branches": []}
    part = {
        "summary": {"covered_branches": taken, "num_branches": 20},
        "missing_branches": [[7, 9], [12, -3]][: 20 - taken],
    }
    files = {"tools/cli/d.py": part, "tools/main.py": whole}
    files |= {"estimator/a.py": whole, "drivers/b.py": whole, "drivers/c.py": part}
    path = tmp_path / "report.json"
    path.write_text(json.dumps({"files": files}))
    return path


def test_the_page_tells_each_package_and_what_no_test_takes(tmp_path, monkeypatch, capsys):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{coverage.BEGIN}old\n{coverage.END}after\n")
    monkeypatch.setattr(coverage, "PAGE", page)

    assert coverage.main(["--from", str(report(tmp_path, 18))]) == 0
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith(f"{coverage.END}after\n")
    assert "old" not in text
    assert "| `estimator` | 40 | 40 | 100.0 % |" in text
    assert "| `drivers` | 60 | 58 | 96.7 % |" in text
    assert "| `drivers/c.py` | 20 | 18 | 7 → 9, 12 → end |" in text and "b.py" not in text
    assert "| `tools/cli` | 20 | 18 | 90.0 % |" in text and "d.py" not in text

    assert coverage.main(["--from", str(report(tmp_path, 0))]) == 1
    assert "drivers: 66.7 %, limit 95 %" in capsys.readouterr().err
