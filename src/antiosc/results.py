"""Results, such as `antiosc.results.History`, and functions, such as `von_mises`."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.lazy_exports(__file__)
