"""Scene files: an impact described in TOML, one to one the Python objects.

document → schema → build → scene, studies → run: the tables of a file become calls to antiosc,
which are checked or made. Which keys a section takes is read from the signatures of the objects
that it makes, so that a new parameter is taken by itself. A scene file holds data only: nothing in
it is executed, imported or evaluated.
"""
