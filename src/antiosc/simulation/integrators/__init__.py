"""Integrators that the march is compared with: independent of its code."""
