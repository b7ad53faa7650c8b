"""Beams in closed form that several tests strike."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from numpy.typing import ArrayLike

from antiosc import AntiOscillators
from antiosc.models import closed_form
from antiosc.models.closed_form import UniformBeam
from paths import BENCHMARKS

sys.path.append(str(BENCHMARKS))
import beam_modes
from beam_modes import frequencies as frequencies, modes as modes


class StruckBeam(closed_form.StruckBeam):
    """A beam whose models have their shapes at points `x`, and all rigid-body motions."""

    def anti_oscillators(self, n: int, x: ArrayLike = ()) -> AntiOscillators:
        made = closed_form.StruckBeam(*vars(self).values())
        return beam_modes.anti_oscillators(made, n, x)


def free_free(beam: UniformBeam, site: float) -> StruckBeam:
    return StruckBeam(beam, "free", "free", site)


def pinned_free(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    return StruckBeam(*vars(closed_form.pinned_free(beam, site)).values())


def pinned_pinned(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    return StruckBeam(*vars(closed_form.pinned_pinned(beam, site)).values())


def cantilever(beam: UniformBeam, site: float | None = None) -> StruckBeam:
    return StruckBeam(*vars(closed_form.cantilever(beam, site)).values())


ARTICLE = {"E": 67e9, "rho": 2400.0, "area": 2e-4, "inertia": 0.33e-8, "length": 1.0}
SLENDER = UniformBeam.timoshenko(**ARTICLE, nu=0.3)
THICK = UniformBeam.timoshenko(E=70e9, nu=0.3, rho=2700, area=1e-2, inertia=8e-6, length=0.3)
UNIT = UniformBeam(EI=1.0, rhoA=1.0, length=1.0)

SUPPORTS = [
    ("pinned", "free", 1.0),
    ("pinned", "free", 0.37),
    ("pinned", "pinned", 0.5),
    ("pinned", "pinned", 0.31),
    ("clamped", "free", 1.0),
    ("clamped", "free", 0.6),
    ("free", "free", 0.3),
    ("free", "free", 0.0),
    ("free", "free", 0.5),
    ("clamped", "clamped", 0.5),
    ("clamped", "pinned", 0.7),
    ("guided", "pinned", 0.0),
    ("guided", "guided", 0.45),
]
#: for the slower tests: two of them in `make check`
SOME = [
    *(SUPPORTS[i] for i in (5, 6)),
    *(pytest.param(SUPPORTS[i], marks=pytest.mark.slow) for i in (1, 10)),
]


def struck(beam: UniformBeam, supports: tuple[str, str, float]) -> StruckBeam:
    left, right, place = supports
    return StruckBeam(beam, left, right, place * beam.length)


def hinged_roots(beam: UniformBeam, i: np.ndarray, alpha: float) -> np.ndarray:
    """Both roots of the article's characteristic equation, as frequencies in rad/s."""
    eta = beam.EI / (beam.kGA * beam.length**2)
    half = ((eta + alpha) * (i * np.pi) ** 2 + 1) / 2
    large = half + np.sqrt(half**2 - eta * alpha * (i * np.pi) ** 4)
    Omega = np.array([(i * np.pi) ** 4 / large, large / (eta * alpha)])
    return np.sqrt(Omega * beam.EI / (beam.rhoA * beam.length**4))


def cutoff(beam: UniformBeam) -> float:
    """√(kGA/rhoI) in rad/s: above it waves of the second spectrum travel."""
    return float(np.sqrt(beam.kGA / beam.rhoI))
