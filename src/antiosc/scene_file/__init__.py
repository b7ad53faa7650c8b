"""Scene files: an impact described in TOML, one to one the Python objects.

A file becomes a program of calls to antiosc (`scene`), which is checked (`check`), printed as
Python (`program`) or run (`run`). Which keys a section takes is read from the signatures of the
objects that it makes (`sections`, `parameters`), so that a new parameter is taken by itself.
A scene file holds data only: nothing in it is executed, imported or evaluated.
"""
