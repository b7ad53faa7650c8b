"""Extraction: anti-oscillators or natural modes of a structure at its sites."""
