"""Solvers of symmetric positive definite matrices of SciPy and of PETSc."""
