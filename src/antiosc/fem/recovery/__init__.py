"""Strains, stresses and section forces at points of cells, from shapes of displacement."""
