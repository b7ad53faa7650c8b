"""Assemblies: parts with their own meshes, joined by linear constraints u = T q."""
