"""Writes the man pages of all commands into a folder: `python -m gritd.tools.dev.manual DIR`."""

from __future__ import annotations

import sys
from pathlib import Path

from gritd.tools.dev.manual.page import pages
from gritd.tools.dev.manual.roff import man_pages


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in man_pages(pages()).items():
        (folder / name).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
