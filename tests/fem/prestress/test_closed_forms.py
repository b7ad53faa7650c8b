"""Parts under load against closed forms: rotating blades, beams and plates under N, buckling."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from loaded_beams import EI, LENGTH, RHO, SIDE, THIN_BEAM, UNIT, E, at_ends, at_root, beams, marked
from loaded_parts import DRUM, SIZE, THIN, WRIGHT, blade, drum, plate, ritz_drum
from parts import box
from refusals import refused
from sheets import at, sheet


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "speed"),
    [("beam", 3), ("beam", 12), ("solid", 12), ("triangle", 12), ("quadrilateral", 12)],
)
def test_a_rotating_cantilever_has_the_frequencies_of_wrights_table(family, speed):
    part, unit = blade(family, speed)
    found = part.natural_modes(6).omega / unit
    for flap in WRIGHT[speed]:
        assert np.abs(found / flap - 1).min() < 3e-3
        if family in ("beam", "solid"):
            assert np.abs(found / np.sqrt(flap**2 - speed**2) - 1).min() < 3e-3
    assert "without Coriolis" in part.describe()
    assert part.prestress.reserve == np.inf


def ritz_lag(speed, beside, terms=8):
    """Tip deflection of a clamped blade whose axis lies beside its root: Ritz in x² … x⁹.

    Energy ∫ (EI y''² + N y'² − m Ω² (y − e)²)/2, N = m Ω² (L² − x²)/2, with EI = m = L = 1.
    """
    x, w = np.polynomial.legendre.leggauss(30)
    x, w = (x + 1) / 2, w / 2
    powers = np.arange(2, 2 + terms)[:, None]
    y, slope = x**powers, powers * x ** (powers - 1)
    bend = powers * (powers - 1) * x ** (powers - 2)
    N = speed**2 * (1 - x**2) / 2
    K = (bend * w) @ bend.T + (slope * N * w) @ slope.T - speed**2 * (y * w) @ y.T
    return np.linalg.solve(K, -(speed**2) * beside * y @ w).sum()


@pytest.mark.slow
def test_an_axis_beside_the_blade_couples_lag_with_the_force_that_holds_it():
    speed, beside = 6.0, 0.01
    spin = ao.Spin((0, 0, 1), speed * UNIT, about=(0, beside, 0))
    part = ao.Structure(
        beams(), THIN_BEAM, [ao.Support(at_root)], prestress=ao.Prestress(spin=spin)
    )
    moved = part.prestress.displacement[np.argmax(part.prestress.points[:, 0]), 1]
    assert moved == pytest.approx(ritz_lag(speed, beside), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 10.0, 1e4, -0.9])
def test_a_beam_between_walls_under_tension_or_thrust(share):
    """ω² of pinned ends grows by the share N/N_E, N_E = π² EI/L²; 1e4 times is a string."""
    euler = np.pi**2 * EI
    pinned = ao.Support(at_ends, fix=("x", "y", "z", "rx"))
    loads = ao.Prestress(tension={"all": share * euler})
    part = ao.Structure(beams(), THIN_BEAM, [pinned], prestress=loads)
    exact = np.pi**2 * UNIT * np.sqrt(1 + share)
    assert part.natural_modes(2).omega == pytest.approx(exact, rel=1e-4)
    assert part.prestress.reserve == pytest.approx(-1 / share if share < 0 else np.inf, rel=1e-4)
    stress = share * euler / SIDE**2
    assert part.prestress.stress.values == pytest.approx(abs(stress), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("cell", "laminate"), [("triangle", False), ("quadrilateral", True)])
def test_a_plate_under_an_edge_load(cell, laminate):
    """ω² of sin(π x/a) sin(π y/a) grows by N π²/(ρ h a²), N per width."""
    critical = 4 * np.pi**2 * E * THIN**3 / 12 / (1 - 0.3**2) / SIZE**2
    still = plate(0.0, cell, laminate).natural_modes(1).omega[0] ** 2
    for share in (3.0, -0.8):
        part = plate(share * critical * SIZE, cell, laminate)
        more = share * critical * np.pi**2 / (RHO * THIN * SIZE**2)
        found = part.natural_modes(1).omega[0]
        assert found == pytest.approx(np.sqrt(still + more), rel=1e-3)
    assert part.prestress.reserve == pytest.approx(1.25, rel=0.01)


@pytest.mark.slow
def test_columns_buckle_at_eulers_load():
    """A cantilever under a dead load on its tip: π² EI/(4 L²), of a beam and of a solid."""
    euler = np.pi**2 * EI / 4
    held = [ao.Support(at_root)]
    loads = ao.Prestress(force={"tip": (-euler / 2, 0, 0)})
    part = ao.Structure(beams(), THIN_BEAM, held, prestress=loads)
    assert part.prestress.reserve == pytest.approx(2, rel=1e-4)
    mesh = box((16, 1, 1), (1.0, 0.02, 0.02), groups={"tip": (2, lambda x: x[0] > 1 - 1e-9)})
    euler = np.pi**2 * E * 0.02**4 / 12 / 4
    for share in (0.5, 1.5):
        loads = ao.Prestress(force={"tip": (-share * euler, 0, 0)})
        if share > 1:
            with refused(None, "0.667", ao.InputError):
                ao.Structure(mesh, ao.Solid(E, 0.0, RHO), held, prestress=loads)
        else:
            part = ao.Structure(mesh, ao.Solid(E, 0.0, RHO), held, prestress=loads)
            assert part.prestress.reserve * share == pytest.approx(1, rel=5e-3)


@pytest.mark.slow
def test_a_spin_beyond_the_first_singularity_is_refused():
    """A blade inward of its axis, x < 0 of the hub's: its tip is pressed toward the hub."""
    spin = ao.Spin((0, 0, 1), 20 * UNIT, about=(2 * LENGTH, 0, 0))
    with refused(None, "a spin at", ao.InputError):
        ao.Structure(beams(), THIN_BEAM, [ao.Support(at_root)], prestress=ao.Prestress(spin=spin))


RING, WALL = 0.1, 2e-3
#: Lévy's pressure 3 D/R³ of a long tube
LEVY = 3 * E * WALL**3 / 12 / (1 - 0.3**2) / RING**3


def ring(pressure):
    """A quarter of a long tube in plane strain, pressed from outside."""
    radius, wall = RING, WALL

    def quarter(s, t):
        r = radius + wall * (t - 0.5)
        return r * np.cos(np.pi / 2 * s), r * np.sin(np.pi / 2 * s)

    mesh = sheet((48, 1), quarter, "quadrilateral", 2)
    outer = radius + wall / 2
    mesh = marked(mesh, outside=(1, lambda x: np.hypot(x[0], x[1]) > outer - 1e-9))
    held = [ao.Support(at(1, 0.0), "y"), ao.Support(at(0, 0.0), "x")]
    tube = ao.Solid(E, 0.3, RHO, plane="strain")
    loads = ao.Prestress(pressure={"outside": pressure}) if pressure else None
    return ao.Structure(mesh, tube, held, prestress=loads)


def test_a_ring_buckles_under_a_pressure_that_follows_its_surface():
    """A pressure of fixed direction: 4 D/R³."""
    assert ring(LEVY / 2).prestress.reserve == pytest.approx(2, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("share", [-0.5, 3.0, 30.0])
def test_a_long_balloon_is_stiffer_by_its_pressure(share):
    """ω² of the oval grows by p/p_L, p from inside."""
    still = ring(0.0).natural_modes(1).omega[0]
    found = ring(-share * LEVY).natural_modes(1).omega[0]
    assert found == pytest.approx(still * np.sqrt(1 + share), rel=5e-3)


@pytest.mark.slow
def test_a_drum_that_pressure_deflects_by_two_thicknesses():
    part = drum(2e4)
    deflection, omega = ritz_drum(2e4)
    up = part.prestress.displacement[:, 2]
    assert np.abs(up).max() == pytest.approx(deflection, rel=2e-3)
    assert part.natural_modes(1).omega == pytest.approx(omega, rel=2e-3)
    assert deflection > 1.7 * DRUM
