"""In the guest: the last picture in a typescript of `gritd monitor`."""

import re
import sys
from pathlib import Path

pictures = Path(sys.argv[1]).read_text(encoding="utf-8", errors="replace").split("\033[H")[1:]
print(f"{len(pictures)} pictures; the last but one:")
print(re.sub(r"\033\[[?\d]*[A-Za-z]", "", pictures[-2]).replace("\r", ""))
