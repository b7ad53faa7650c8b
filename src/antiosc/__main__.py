"""`python -m antiosc`: the command of the same name."""

import os
import sys

if sys.path[0] in ("", os.getcwd()):
    del sys.path[0]  # Python puts the working folder there: its files are no packages

from antiosc.app.cli import main

if __name__ == "__main__":
    sys.exit(main())
