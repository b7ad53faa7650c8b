"""`antiosc new`: a scene that runs, from a look at the part."""
