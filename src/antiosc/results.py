"""Results and what they are made of: `antiosc.results.History`; modules that recover fields."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.namespace(__file__)
