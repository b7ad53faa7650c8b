"""Joints of assemblies: `antiosc.joints.Bolt`."""

from antiosc.base import lazily

__all__, __getattr__, __dir__ = lazily.namespace(__file__)
