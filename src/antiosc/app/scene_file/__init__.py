"""Scene files: an impact described in TOML, one to one the Python objects.

The tables of a file (`read`) become calls to antiosc (`scene`), which are checked (`commands`) or
made (`run`). Which keys a section takes is read from the signatures of the objects that it makes
(`sections`, `parameters`), so that a new parameter is taken by itself. A scene file holds data
only: nothing in it is executed, imported or evaluated.
"""
