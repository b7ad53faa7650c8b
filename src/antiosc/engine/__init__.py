"""The march in C from Python: its systems, laws, steps and their control."""
