"""`python -m antiosc` runs the command `antiosc`."""

import os
import sys
from importlib import import_module

if sys.path[0] in ("", os.getcwd()):
    del sys.path[0]  # Python puts the working folder there: its files are no packages

if __name__ == "__main__":
    sys.exit(import_module("antiosc_app.cli").main())
