"""Extraction: from a structure and its sites to anti-oscillators, or to natural modes."""
