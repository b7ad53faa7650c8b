"""Decks of Abaqus and CalculiX (`.inp`)."""
