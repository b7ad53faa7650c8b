"""Nastran bulk data (`.bdf`, `.nas`, `.fem`, …)."""
