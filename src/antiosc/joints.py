"""Joints of assemblies; springs, dampers, masses and soil under a part: `antiosc.joints.Bolt`."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.namespace(__file__)
