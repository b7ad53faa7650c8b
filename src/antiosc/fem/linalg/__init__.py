"""Linear algebra on K and M: factorizations, choice of the solver, compliances from a factor."""
