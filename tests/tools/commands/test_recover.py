"""`gritd recover`: what it saves, what it says, and its exit code."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from mcap.opcode import Opcode

from gritd.estimator.recording.blocks import records
from gritd.estimator.recording.mcapfile import McapFile
from gritd.estimator.recording.salvage import read
from gritd.tools import main as cli
from gritd.tools.commands.recover import main
from tests.estimator.recording.samples import write_foreign, write_sample


def test_an_unclosed_recording_becomes_a_closed_one_and_nothing_is_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written = write_sample(tmp_path / "a.mcap", close=False)
    assert main([str(tmp_path / "a.mcap")]) == 0

    said = capsys.readouterr()
    assert said.err == "" and said.out.count("\n") == 1
    assert f"saved {len(written)} messages of 8 topics; it was not closed" in said.out
    times = [time for _, time, _ in written]
    assert f"it ends {(max(times) - min(times)) * 1e-9:.3f} s after its beginning" in said.out
    assert "what came later is not in it; nothing before that is lost" in said.out

    recovered = read(tmp_path / "a.recovered.mcap")
    assert recovered.complete and list(recovered.messages()) == written

    original = read(tmp_path / "a.mcap")
    assert (recovered.config_yaml, recovered.run) == (original.config_yaml, original.run)


def test_other_readers_open_the_recovered_file(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    written = write_sample(tmp_path / "a.mcap", close=False)
    assert main([str(tmp_path / "a.mcap"), "-o", str(tmp_path / "b.mcap")]) == 0
    with open(tmp_path / "b.mcap", "rb") as file:
        opened = reader.make_reader(file, validate_crcs=True)
        found = [(c.topic, m.log_time) for _, c, m in opened.iter_messages(log_time_order=False)]
    assert found == [(topic, time) for topic, time, _ in written]


def test_a_damaged_recording_is_saved_in_part(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written = write_sample(tmp_path / "a.mcap", every=5)
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[data.index(b"\x28\xb5\x2f\xfd", len(data) // 2) + 100] ^= 1  # inside a zstd frame
    (tmp_path / "a.mcap").write_bytes(data)

    assert main([str(tmp_path / "a.mcap")]) == 3

    said = capsys.readouterr()
    recovered = read(tmp_path / "a.recovered.mcap")
    lost = len(written) - recovered.counts.total()

    assert 0 < lost <= 2 * 36 and recovered.complete
    assert (
        f"it was closed; {lost} messages are lost" in said.out
        and "checksum does not hold" in said.err
    )
    assert recovered.recovered["lost"] == str(lost)
    assert main([str(tmp_path / "a.recovered.mcap"), "-o", str(tmp_path / "again.mcap")]) == 0
    assert read(tmp_path / "again.mcap").recovered["lost"] == str(lost)  # not forgotten


def test_a_damaged_index_alone_costs_nothing(tmp_path: Path) -> None:
    written = write_sample(tmp_path / "a.mcap", every=5, compression="none")
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    start = next(
        start for opcode, start, _ in records(bytes(data[8:])) if opcode == Opcode.MESSAGE_INDEX
    )
    data[8 + start - 5] ^= 1  # its length
    (tmp_path / "a.mcap").write_bytes(data)
    assert read(tmp_path / "a.mcap").damage
    assert main([str(tmp_path / "a.mcap")]) == 0
    assert list(read(tmp_path / "a.recovered.mcap").messages()) == written


def test_a_cut_recording_is_saved_in_part(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written = write_sample(tmp_path / "a.mcap", every=5, compression="none")
    os.truncate(tmp_path / "a.mcap", (tmp_path / "a.mcap").stat().st_size // 2)
    assert main([str(tmp_path / "a.mcap")]) == 3
    said = capsys.readouterr().out
    found = list(read(tmp_path / "a.recovered.mcap").messages())
    span = (max(time for _, time, _ in found) - min(time for _, time, _ in found)) * 1e-9
    assert f"not closed: it ends {span:.3f} s after its beginning" in said
    assert "0 or more messages are lost" in said
    assert found and found == written[: len(found)]


def test_topics_of_unknown_encoding_are_kept_as_they_are(tmp_path: Path) -> None:
    write_foreign(tmp_path / "a.mcap", 200, use_chunking=False)
    assert main([str(tmp_path / "a.mcap")]) == 0
    assert read(tmp_path / "a.recovered.mcap").counts == read(tmp_path / "a.mcap").counts


def test_a_wrong_name_is_usage_and_no_recording_is_damage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "photo.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(500))
    for name, code, said in (
        ("photo.png", 3, "photo.png: not an MCAP file"),
        (".", 3, ": cannot read: Is a directory"),
        ("none.mcap", 2, "none.mcap: cannot read: No such file or directory"),
    ):
        assert cli.main(["recover", str(tmp_path / name), "-o", str(tmp_path / "out.mcap")]) == code
        streams = capsys.readouterr()
        assert (
            streams.err.startswith(f"gritd: {tmp_path}")
            and streams.err.endswith(f"{said}\n")
            and streams.out == ""
        )

    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["photo.png"]


@pytest.mark.parametrize("length", [8, 20, 60])
def test_where_nothing_can_be_recovered_no_file_is_made(
    tmp_path: Path, length: int, capsys: pytest.CaptureFixture[str]
) -> None:
    write_sample(tmp_path / "a.mcap")
    os.truncate(tmp_path / "a.mcap", length)
    assert cli.main(["recover", str(tmp_path / "a.mcap")]) == 3
    said = capsys.readouterr()
    last = said.err.splitlines()[-1]
    assert last == f"gritd: {tmp_path / 'a.mcap'}: found nothing to recover; no file is written"
    assert said.out == "" and [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_an_interrupted_recovery_leaves_no_part_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    write_sample(tmp_path / "a.mcap")
    monkeypatch.setattr(McapFile, "add_chunk", interrupted)
    with pytest.raises(KeyboardInterrupt):
        main([str(tmp_path / "a.mcap")])
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


@pytest.mark.parametrize("name", ["a.mcap", "nowhere/b.mcap"])
def test_an_output_that_cannot_be_made_is_usage(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_sample(tmp_path / "a.mcap")
    before = (tmp_path / "a.mcap").read_bytes()
    assert cli.main(["recover", str(tmp_path / "a.mcap"), "-o", str(tmp_path / name)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"gritd: {tmp_path / name}: ") and said.count("\n") == 1
    assert (tmp_path / "a.mcap").read_bytes() == before


def test_attachments_and_metadata_of_others_survive(tmp_path, capsys):
    """One whose checksum does not hold is named, and the exit code says that it is lost."""
    from mcap.reader import make_reader
    from mcap.writer import Writer

    photos = {"photo.jpg": bytes(range(256)) * 9000, "notes.txt": b"dry sand"}
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/x", "json", 0)
        writer.add_message(channel, 10**18, b"{}", 10**18)
        for name, data in photos.items():
            writer.add_attachment(1, 2, name, "application/octet-stream", data)
        writer.add_metadata("lab", {"bench": "3"})
        writer.add_metadata("lab", {"bench": "4"})
        writer.finish()

    assert cli.main(["recover", str(tmp_path / "a.mcap")]) == 0
    with (tmp_path / "a.recovered.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert {a.name: a.data for a in reader.iter_attachments()} == photos
        said = [m.metadata for m in reader.iter_metadata() if m.name == "lab"]
        assert said == [{"bench": "3"}, {"bench": "4"}]
        assert reader.get_summary().statistics.attachment_count == 2

    data = (tmp_path / "a.mcap").read_bytes().replace(b"dry sand", b"wet sand")
    (tmp_path / "b.mcap").write_bytes(data)
    assert cli.main(["recover", str(tmp_path / "b.mcap")]) == 3
    assert "notes.txt" in capsys.readouterr().err
    with (tmp_path / "b.recovered.mcap").open("rb") as file:
        assert [a.name for a in make_reader(file).iter_attachments()] == ["photo.jpg"]
