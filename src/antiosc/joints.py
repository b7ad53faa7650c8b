"""Joints of assemblies; springs, dampers and masses: `antiosc.joints.Bolt`."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.door(__file__)
