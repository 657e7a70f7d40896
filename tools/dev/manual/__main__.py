"""Writes the man pages into a folder, or the site's reference of the commands:
`python -m gritd.tools.dev.manual [--site] DIR`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from gritd.tools.dev.manual.markdown import reference
from gritd.tools.dev.manual.outputs import outputs
from gritd.tools.dev.manual.page import pages
from gritd.tools.dev.manual.roff import man_pages


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gritd.tools.dev.manual", description=__doc__)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument(
        "--site", action="store_true", help="Markdown; runs the examples, some minutes"
    )
    given = parser.parse_args()

    files = reference(pages(), outputs()) if given.site else man_pages(pages())
    given.folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (given.folder / name).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
