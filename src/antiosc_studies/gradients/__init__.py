"""Derivatives of a result by all parameters of an impact."""
