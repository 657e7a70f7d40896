"""`gritd effects`: every effect is listed, and one is reported with all that is known of it."""

from __future__ import annotations

import pytest

from gritd.estimator.effects import EFFECTS
from gritd.tools import main as cli
from gritd.tools.commands import effects


def test_every_effect_is_in_the_list(capsys):
    assert cli.main(["effects"]) == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines() if line[:2] == "  "]
    assert sorted(listed) == sorted(EFFECTS)


def test_a_page_has_formula_parameters_fingerprint_and_what_looks_alike(capsys):
    for name, effect in EFFECTS.items():
        assert cli.main(["effects", name]) == 0
        page = capsys.readouterr().out
        assert effect.formula().splitlines()[0] in page
        assert f"fingerprint: {effect.fingerprint.channel.replace('_', ' ')}" in page
        for word in [*effect.confusable_with, *(p.name for p in effect.parameters())]:
            assert word in page, name


def test_what_looks_alike_is_told_of_both():
    for name, effect in EFFECTS.items():
        for other in effect.confusable_with:
            assert name in effects.looks_like(other)


@pytest.mark.parametrize(
    "command",
    [
        ["effects", "coulumb_friction"],
        ["simulate", "--effect", "coulomb_frction.loss=1", "-o", "x.mcap"],
    ],
)
def test_a_mistyped_effect_has_a_suggestion(command, capsys):
    assert cli.main(command) == 2
    assert "(did you mean coulomb_friction?)" in capsys.readouterr().err
