import pytest

from gritd.tools.commands import reproduce


def test_prints_the_papers_figures_beside_ours(capsys: pytest.CaptureFixture[str]) -> None:
    assert reproduce.main(["--simulations", "500"]) == 0
    out = capsys.readouterr().out
    for printed in ("2.0 % (DP), 2.6 % (T)", "9.34 % and 12.15 %", "Fig. 3", "500 simulations"):
        assert printed in out
    assert out.count("could not be had") == 2 and out.count("no match is claimed") == 2
    assert "nan" not in out and "inf " not in out


@pytest.mark.long
def test_the_same_seed_prints_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    texts = []
    for seed in ("3", "3", "4"):
        reproduce.main(["--simulations", "300", "--seed", seed])
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1] != texts[2]


def test_a_bad_number_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        reproduce.main(["--simulations", "0"])
    assert stop.value.code == 2
    assert capsys.readouterr().err.strip().count("\n") == 0
