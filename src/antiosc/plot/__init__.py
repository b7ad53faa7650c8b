"""Charts and surfaces in space; matplotlib is loaded when they are drawn."""
