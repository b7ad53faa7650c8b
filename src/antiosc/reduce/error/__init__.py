"""Discretisation errors: strain energies of the errors, of a whole model and cell by cell."""
