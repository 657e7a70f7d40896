"""Many campaigns side by side: which folders count, what is done again, and what one failure does
to the others.
"""

import os
from argparse import Namespace
from pathlib import Path
from shutil import which

import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.commands import diagnose
from gritd.tools.commands import diagnose_campaigns as campaigns
from gritd.tools.commands.diagnose_campaigns import CampaignFiles
from tests.tools.commands.certificates import certificates


def folder_of(place: Path, name: str, configurations: int = 1) -> Path:
    folder = place / name
    folder.mkdir()
    (folder / "run-1.mcap").write_bytes(b"")
    for number in range(configurations):
        (folder / f"{number}.yaml").write_text("", encoding="utf-8")
    return folder


def write_result(campaign: CampaignFiles) -> str:
    """In the place of a diagnosis."""
    if campaign.folder.name == "bad":
        return "not diagnosed: run-1.mcap: not an MCAP file"
    campaign.result.write_text("{}", encoding="utf-8")
    later = campaign.files[0].stat().st_mtime + 10.0
    os.utime(campaign.result, (later, later))
    return "consistent"


def test_folders_with_recordings_are_campaigns(tmp_path: Path) -> None:
    for name in ("b", "a"):
        folder_of(tmp_path, name)
    (tmp_path / "notes").mkdir()
    found = campaigns.find(tmp_path)
    assert [campaign.folder.name for campaign in found] == ["a", "b"]
    assert [path.name for path in found[0].files] == ["run-1.mcap"] and found[
        0
    ].configuration.name == "0.yaml"


def test_mistakes_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match=r"found no folder with recordings \(\*\.mcap\) in it"):
        campaigns.find(tmp_path)
    with pytest.raises(CommandError, match="found no folder; expected one"):
        campaigns.find(tmp_path / "nowhere")
    folder_of(tmp_path, "a", configurations=2)
    with pytest.raises(
        CommandError, match=r"a: found 2 files \*\.yaml; expected its configuration"
    ):
        campaigns.find(tmp_path)


def test_one_that_fails_is_told_and_the_others_go_on(tmp_path: Path) -> None:
    for name in ("a", "bad", "c"):
        folder_of(tmp_path, name)
    found = campaigns.find(tmp_path)
    said = {c.folder.name: words for c, words in campaigns.diagnosed(found, write_result, 2, None)}
    assert said == {
        "a": "consistent",
        "bad": "not diagnosed: run-1.mcap: not an MCAP file",
        "c": "consistent",
    }
    assert [campaign.done for campaign in found] == [True, False, True]


def test_files_of_one_among_many_are_not_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The last line tells them for all."""

    def diagnosed(arguments: Namespace) -> int:
        arguments.json.write_text('{"verdict": "consistent", "summary": "They agree."}')
        return 0

    monkeypatch.setattr(diagnose, "_one", diagnosed)
    campaign = campaigns.find(folder_of(tmp_path, "a").parent)[0]
    assert diagnose._campaign(campaign) == "consistent. They agree."
    assert capsys.readouterr() == ("", "")


def test_what_is_done_is_not_done_again_until_a_file_changes(tmp_path: Path) -> None:
    folder_of(tmp_path, "a")
    found = campaigns.find(tmp_path)
    assert len(list(campaigns.diagnosed(found, write_result, 1, None))) == 1
    assert not list(campaigns.diagnosed(found, write_result, 1, None))
    later = found[0].result.stat().st_mtime + 10.0
    os.utime(found[0].configuration, (later, later))
    assert len(list(campaigns.diagnosed(found, write_result, 1, None))) == 1


@pytest.mark.slow
@pytest.mark.skipif(which("openssl") is None, reason="openssl is not installed")
def test_the_same_on_a_cluster_that_proves_who_it_is(tmp_path: Path) -> None:
    """A real scheduler and two worker processes on loopback, with a certificate."""
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    dask = pytest.importorskip("dask", reason="dask is not installed")
    (tmp_path / "campaigns").mkdir()
    for name in ("a", "bad", "c"):
        folder_of(tmp_path / "campaigns", name)
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "host": "tls://127.0.0.1",
        "dashboard_address": None,
    }

    with dask.config.set(certificates(tmp_path)):
        security = distributed.security.Security(require_encryption=True)
        with distributed.LocalCluster(processes=True, security=security, **options) as cluster:
            address = cluster.scheduler_address
            found = campaigns.find(tmp_path / "campaigns")
            done = campaigns.diagnosed(found, write_result, 1, address)
            said = {campaign.folder.name: words for campaign, words in done}

    assert address.startswith("tls://127.0.0.1:")
    assert said["a"] == said["c"] == "consistent" and said["bad"].startswith("not diagnosed")
