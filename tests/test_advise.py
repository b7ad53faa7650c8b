"""Advice on the element family: its estimates, its rules, and (slow) the ladder of models."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.errors import InputError
from antiosc.models.closed_form import UniformBeam
from antiosc.strikes.advice import advise
from plates import SupportedPlate
from struck_beams import free_free, frequencies

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}


def sphere(radius, velocity):
    return ao.Sphere(radius, **STEEL, velocity=velocity)


def test_contact_time_and_radius_are_hertzs():
    striker = sphere(0.01, 1.0)
    advice = advise((0.2, 0.1, 0.006), striker, **STEEL)
    law = striker.hertz(STEEL["E"], STEEL["nu"])
    hit = ao.simulate(
        striker_at_rest := ao.AntiOscillators(m0=1e9, k0=0.0, m=[], omega=[]),
        striker,
        law,
        duration=2 * advice.contact_time,
    )
    assert striker_at_rest.n == 0
    assert advice.contact_time == pytest.approx(hit.contact_time, rel=1e-3)
    # a² = R δ for a sphere on a plane
    assert advice.contact_radius == pytest.approx(np.sqrt(0.01 * hit.indentation.max()), rel=1e-3)


@pytest.mark.parametrize(
    ("size", "striker", "family"),
    [
        ((0.30, 0.020, 0.010), sphere(10e-3, 1.0), "beam"),
        ((0.30, 0.200, 0.006), sphere(10e-3, 1.0), "shell"),
        ((0.15, 0.120, 0.040), sphere(15e-3, 3.0), "solid"),
        # the contact is wide against the sheet
        ((0.30, 0.200, 0.002), sphere(50e-3, 5.0), "solid"),
    ],
)
def test_the_smallest_family_that_serves(size, striker, family):
    advice = advise(size, striker, **STEEL)
    assert advice.family == family
    assert str(advice).startswith(family)


@pytest.mark.parametrize(
    ("size", "striker", "material", "words"),
    [
        ((0.3, 0.2), sphere(0.01, 1), STEEL, "dimensions must have shape"),
        ((0.3, -0.2, 0.1), sphere(0.01, 1), STEEL, "width must be > 0"),
        ((0.2, 0.3, 0.1), sphere(0.01, 1), STEEL, "length must be >= width"),
        ((0.3, 0.2, 0.1), sphere(0.01, 0), STEEL, "the impactor's velocity must be > 0"),
        ((0.3, 0.2, 0.1), sphere(0.01, 1), {}, "material of the part is missing"),
        ((0.3, 0.2, 0.1), ao.RigidMass(1.0, 1.0), STEEL, "an impactor with its own contact law"),
    ],
)
def test_bad_input(size, striker, material, words):
    with pytest.raises(InputError, match=words):
        advise(size, striker, **material)


@pytest.mark.fem
@pytest.mark.slow
def test_the_advised_element_is_fine_enough():
    """Half of it changes the force of an impact on a panel by less than 1 %."""
    pytest.importorskip("dolfinx")
    from sheets import rectangle

    striker = sphere(10e-3, 1.0)
    advice = advise((0.3, 0.2, 0.006), striker, **STEEL)
    assert advice.family == "shell"
    times = np.linspace(0, 2.5 * advice.contact_time, 1000)

    def force(size):
        cells = (int(np.ceil(0.12 / size)), int(np.ceil(0.06 / size)))
        ends = ao.Support(lambda x: np.isclose(x[0], 0) | np.isclose(x[0], 0.12))
        mesh = rectangle(cells, 0.12, 0.06)
        part = ao.Structure(mesh, ao.Shell(**STEEL, thickness=0.006), [ends])
        model = ao.extract(part, ao.Site((0.06, 0.03, 0), (0, 0, -1)), n=24)
        law = striker.hertz(STEEL["E"], STEEL["nu"])
        hit = ao.simulate(model, striker, law, duration=times[-1])
        return np.interp(times, hit.time, hit.force)

    advised, fine, coarse = (force(k * advice.element_size) for k in (1, 0.5, 4))
    assert np.linalg.norm(advised - fine) < 1e-2 * np.linalg.norm(fine)
    assert np.linalg.norm(coarse - fine) > 2 * np.linalg.norm(advised - fine)


def test_limits_are_half_of_the_frequencies_at_which_a_family_fails():
    """A free strip across the beam, in plane strain, and the first thickness shear of the plate."""
    width, thickness = 0.05, 0.004
    limits = advise((0.3, width, thickness), sphere(10e-3, 1.0), **STEEL).limits
    across = UniformBeam.euler_bernoulli(
        E=STEEL["E"] / (1 - STEEL["nu"] ** 2),
        rho=STEEL["rho"],
        area=thickness,
        inertia=thickness**3 / 12,
        length=width,
    )
    deforms = frequencies(free_free(across, 0.13 * width), 3)
    first = deforms[deforms > 1.0][0] / (2 * np.pi)
    assert limits["beam"] == pytest.approx(first / 2, rel=1e-4)
    # half a wave of shear over the thickness
    shear = np.sqrt(STEEL["E"] / 2 / (1 + STEEL["nu"]) / STEEL["rho"])
    assert limits["shell"] == pytest.approx(shear / (2 * thickness) / 2, rel=1e-12)
    assert limits["solid"] == np.inf


def test_the_element_resolves_the_plates_wave():
    """Four to the bending wavelength at the highest frequency: Kirchhoff's dispersion."""
    advice = advise((0.3, 0.2, 0.006), sphere(10e-3, 1.0), **STEEL)
    wave = 4 * advice.element_size
    half = SupportedPlate(**STEEL, thickness=0.006, a=wave / 2, b=1e9)
    assert half.kirchhoff(1, 0) / (2 * np.pi) == pytest.approx(advice.frequency, rel=1e-9)
