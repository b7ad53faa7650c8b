"""Linear algebra on K and M: factorizations, their choice, and what can be had of a factor."""
