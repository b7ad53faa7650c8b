"""Decks: the input files of Abaqus, CalculiX and Nastran, as meshes and as whole models.

A deck is parsed into a `Deck` (`abaqus`, `nastran`), with rows instead of the numbers of the file.
Its elements are converted to cells of one mesh (`antiosc.fem.readers.conversion`), and its
materials, sections, supports and masses to a model in SI units (`model`).
"""
