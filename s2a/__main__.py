"""Entry of `python -m s2a` and of the command `s2a`."""

import sys

from s2a.cli import main

if __name__ == "__main__":
    sys.exit(main())
