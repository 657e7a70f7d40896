"""`python -m gritd`: the command line."""

import sys

from gritd.tools.main import main

__all__ = ["main"]

if __name__ == "__main__":
    sys.exit(main())
