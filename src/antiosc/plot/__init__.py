"""Charts and surfaces in space; matplotlib is loaded when one is drawn."""
