"""Charts of forces, motions, stiffnesses and errors; matplotlib is imported when one is drawn.

A chart needs only the attributes that it shows (`Recorded`, `Reduced`). Histories and models draw
themselves with these functions; nothing here depends on them.
"""
