"""Impacts in time: bodies and contacts put together, integrated, and what came out of it.

`simulate` takes two bodies and one contact, `Scene` several; `integrators` are to compare with.
Nothing here knows finite elements.
"""
