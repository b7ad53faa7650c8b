"""Errors of the mesh: energies of the errors of strains, for a whole model and cell by cell."""
