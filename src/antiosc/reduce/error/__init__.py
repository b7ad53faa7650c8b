"""Discretisation errors as strain energies, for a whole model and for each cell."""
