"""What the results of a scene tell: on the terminal, in files, on a page; and what a run costs."""
