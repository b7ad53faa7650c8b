"""Structures whose solutions are exact to rounding: beams, Zener's impact.

>>> beam = UniformBeam.euler_bernoulli(E=67e9, rho=2400, area=2e-4, inertia=0.33e-8, length=1.0)
>>> pinned_free(beam).anti_oscillators(50)  # the article's falling beam, (24)-(27)
"""

from antiosc.base import checks
from antiosc.models.closed_form import zener
from antiosc.models.closed_form.beams import StruckBeam, UniformBeam

__all__ = [
    "StruckBeam",
    "UniformBeam",
    "cantilever",
    "clamped_clamped",
    "free_free",
    "pinned_free",
    "pinned_pinned",
    "zener",
]


def pinned_free(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Pinned at x = 0, free at x = L, struck at `site` (m), the free tip unless given.

    At the tip k0 = 0, φ_st = x/L and the constraint modes are the hinged beam's: Article (24)-(27).
    """
    return _struck(beam, "pinned", "free", 1.0, site)


def pinned_pinned(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Pinned at both ends, struck at `site` (m), mid-span unless given."""
    return _struck(beam, "pinned", "pinned", 0.5, site)


def cantilever(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Clamped at x = 0, struck at `site` (m), the free tip unless given: 1/k0 = a³/3EI + a/kGA."""
    return _struck(beam, "clamped", "free", 1.0, site)


def free_free(beam: UniformBeam, site: float) -> StruckBeam:
    """Free at both ends, struck at `site` (m): k0 = 0."""
    return StruckBeam(beam, "free", "free", site)


def clamped_clamped(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Clamped at both ends, struck at `site` (m), mid-span unless given (L³/192EI + L/4kGA)."""
    return _struck(beam, "clamped", "clamped", 0.5, site)


def _struck(
    beam: UniformBeam, left: str, right: str, share: float, site: float | None
) -> StruckBeam:
    """A beam struck at `site`, or at this share of its length."""
    checks.instance("beam", beam, UniformBeam, "a UniformBeam")
    return StruckBeam(beam, left, right, share * beam.length if site is None else site)
