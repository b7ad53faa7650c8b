"""Structures with exact solutions: beams, Zener's impact, the patch of a plate.

The anti-oscillators
and modes of a beam are known to rounding. Timoshenko's beam, or Euler-Bernoulli's
(`UniformBeam.euler_bernoulli`), on any supports of its two ends and struck at any point, is a
`StruckBeam`; the functions below name the usual ones.

>>> beam = UniformBeam.euler_bernoulli(E=67e9, rho=2400, area=2e-4, inertia=0.33e-8, length=1.0)
>>> pinned_free(beam).anti_oscillators(50)  # the article's falling beam, (24)-(27)
"""

from antiosc.base import checks
from antiosc.models.closed_form import zener
from antiosc.models.closed_form.beams import BeamModes, StruckBeam, UniformBeam
from antiosc.models.closed_form.plates import plate_patch

__all__ = [
    "BeamModes",
    "StruckBeam",
    "UniformBeam",
    "cantilever",
    "clamped_clamped",
    "free_free",
    "pinned_free",
    "pinned_pinned",
    "plate_patch",
    "zener",
]


def pinned_free(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Pinned at x = 0, free at x = L, struck at `site` (m), the free tip unless given.

    At the tip k0 = 0, φ_st = x/L and the constraint modes are the hinged beam's: Article (24)-(27).
    With rotary inertia the two spectra share the mass 2 rhoA L/(i²π²) of each wave number i, the
    pure shear mode at the cut-off holds rhoI/L, and m_st = rhoA L/3 + rhoI/L.
    """
    return StruckBeam(beam, "pinned", "free", _place(beam, 1.0, site))


def pinned_pinned(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Pinned at both ends, struck at `site` (m), mid-span unless given.

    1/k0 = a²b²/(3EI L) + ab/(kGA L) with b = L - a. The second spectrum, which exists above the
    cut-off, moves the site a little: it is observable and is kept.
    """
    return StruckBeam(beam, "pinned", "pinned", _place(beam, 0.5, site))


def cantilever(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Clamped at x = 0, struck at `site` (m), the free tip unless given: 1/k0 = a³/3EI + a/kGA."""
    return StruckBeam(beam, "clamped", "free", _place(beam, 1.0, site))


def free_free(beam: UniformBeam, site: float) -> StruckBeam:
    """Free at both ends, struck at `site` (m).

    Two rigid-body modes, so k0 = 0 and 1/m_st = 1/m + d²/J, with d the distance from the middle
    and J = rhoA L³/12 + rhoI L.
    """
    return StruckBeam(beam, "free", "free", site)


def clamped_clamped(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    """Clamped at both ends, struck at `site` (m), mid-span unless given (L³/192EI + L/4kGA)."""
    return StruckBeam(beam, "clamped", "clamped", _place(beam, 0.5, site))


def _place(beam: UniformBeam, share: float, site: float | None) -> float:
    """`site`, or this share of the length."""
    checks.instance("beam", beam, UniformBeam, "a UniformBeam")
    if site is None:
        return share * beam.length
    return site
