"""`gritd init DIR`: a folder to work in, with a configuration to change."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from gritd.config import packaged
from gritd.tools.cli.command import DONE, USAGE, CommandError, Parser
from gritd.tools.cli.yaml_edit import plain_text

BY_ID = Path("/dev/serial/by-id")  # names of serial devices that stay when ports are renumbered
PORT = re.compile(rb"port: /dev/ttyACM0\b.*\n")
README = """\
testbed.yaml describes the testbed: change it to yours, then `gritd check-config testbed.yaml`.
testbed.dbc describes its CAN messages. `gritd calibrate --help` lists what can be calibrated.
`gritd run --config testbed.yaml --name FIRST --load 70` records a run into runs/.
"""


def main(argv: Sequence[str]) -> int:
    """Write the files. Raises CommandError where one is there already or none can be written."""
    folder = build_parser().parse_args(argv).folder

    files = {name: packaged(name).read_bytes() for name in ("testbed.yaml", "testbed.dbc")}
    ports = sorted(BY_ID.iterdir()) if BY_ID.is_dir() else []
    if len(ports) == 1:
        files["testbed.yaml"] = PORT.sub(_port(ports[0]), files["testbed.yaml"])
    files["README.md"] = README.encode()
    write(folder, files)

    print("\n".join(str(folder / name) for name in files))
    for port in ports:
        print(f"serial port: {port}" + (", in testbed.yaml now" if len(ports) == 1 else ""))
    print(f"next: change {folder / 'testbed.yaml'}, then")
    print(f"gritd check-config {folder / 'testbed.yaml'}")
    return DONE


def _port(path: Path) -> Callable[[re.Match[bytes]], bytes]:
    return lambda _: f"port: {plain_text(str(path))}\n".encode()


def write(folder: Path, files: dict[str, bytes]) -> None:
    """All files or none. Raises CommandError."""
    for name in files:
        if (folder / name).exists() or (folder / name).is_symlink():
            raise CommandError(
                f"{folder / name}: is there already; expected a folder without one", USAGE
            )

    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (folder / name).write_bytes(content)
    except OSError as error:
        reason = (error.strerror or "cannot be written").lower()
        raise CommandError(
            f"{error.filename or folder}: {reason}; expected a folder to write into", USAGE
        ) from None


def build_parser() -> Parser:
    parser = Parser(prog="gritd init", description="Lay out a folder to work in.")
    parser.add_argument(
        "folder", type=Path, metavar="DIR", help="made where it is missing; no file is replaced"
    )

    return parser
