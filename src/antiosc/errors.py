"""Errors and warnings: `antiosc.errors.InputError`."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.door(__file__)
