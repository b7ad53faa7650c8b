"""Decks of Abaqus, CalculiX and Nastran, and matrices of other programs, for antiosc.

A deck is parsed into a `Deck` (`abaqus_mesh`, `nastran_mesh`), with rows instead of the numbers of
the file. Its elements become cells of one mesh (`antiosc.io.conversion`), and its
materials, sections, supports and masses a model in SI units (`abaqus_model`, `nastran_model`; for
both: `properties`, `constraints`, `builder`, `finished`). antiosc finds the readers by entry
points, and `read_model` (`from_deck`): a deck as a structure, joined at shared nodes and by
constraints (`shared_nodes`). These two alone need the finite elements.
"""
