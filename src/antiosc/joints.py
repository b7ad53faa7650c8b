"""Joints of assemblies, such as `antiosc.joints.Bolt`; springs, dampers and masses."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.lazy_exports(__file__)
