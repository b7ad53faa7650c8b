"""Results, and functions of them: `antiosc.results.History`, `results.von_mises`."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.door(__file__)
