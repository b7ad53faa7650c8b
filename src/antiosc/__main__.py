"""`python -m antiosc`: the command of the same name."""

import sys

from antiosc.cli import main

if __name__ == "__main__":
    sys.exit(main())
