"""Simulation of impacts: assembly of bodies and contacts, time integration, results.

`simulate` takes two bodies and one contact, `Scene` several; `reference` has textbook methods for
comparison. This package does not import the finite-element package.
"""
