"""Decks: the input files of Abaqus, CalculiX and Nastran, as meshes and as whole models.

A deck is parsed into a `Deck` (`abaqus`, `nastran`), in rows instead of the file's own numbers;
its elements become cells that one mesh can carry (`antiosc.fem.readers.conversion`), and its
materials, sections, supports and masses a `Model` in SI units.
"""
