"""The model that a deck of any program describes."""
