"""Decks of Abaqus, CalculiX and Nastran, and matrices of other programs, for antiosc.

A deck is parsed into a `Deck` (`abaqus_mesh`, `nastran_mesh`), with rows instead of the numbers of
the file. Its elements become cells of one mesh (`antiosc.io.conversion`); its materials, sections,
supports and masses become a model in SI units (`abaqus_model`, `nastran_model`; for both:
`properties`, `constraints`, `builder`, `finished`). antiosc finds the readers by entry points.
`read_model` (`from_deck`) makes a structure of a deck, joined at shared nodes and by constraints
(`shared_nodes`). Only these two modules need the finite elements.
"""
