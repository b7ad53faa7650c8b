"""Reduction: sites of a structure, extraction of its model, errors of its mesh."""
