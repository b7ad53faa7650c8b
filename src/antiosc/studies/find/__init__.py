"""Where and how hard was a structure struck? Found from measured signals."""
