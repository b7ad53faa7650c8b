"""Contact laws and their results: `antiosc.laws.Hertz`."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.door(__file__)
