"""Parts under load against closed forms: rotating blades, beams and plates under N, buckling.

Wright, Smith, Thresher & Wang, J. Appl. Mech. 49 (1982) 197, table 1: flapping frequencies of a
uniform cantilever without hub; of its lagging ω² is less by Ω². With bending stiffness EI, mass m
per length and length L, frequencies and speeds are in units of √(EI/(m L⁴)).
"""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from parts import box, line
from refusals import refused
from sheets import sheet

WRIGHT = {3: (4.7973, 23.3203), 6: (7.3604, 26.8091), 12: (13.1702, 37.6031)}
E, RHO, SIDE, LENGTH = 70e9, 2700.0, 0.01, 1.0
SQUARE = ao.Section.rectangle(SIDE, SIDE)
THIN_BEAM = ao.Beam(E, 0.3, RHO, SQUARE, shear=False)
EI, MASS = E * SIDE**4 / 12, RHO * SIDE**2
UNIT = np.sqrt(EI / MASS)


def at_root(x):
    return x[0] < 1e-9


def at_ends(x):
    return (x[0] < 1e-9) | (x[0] > LENGTH - 1e-9)


def beams(n=20):
    return line(n, LENGTH, groups={"all": (1, lambda x: x[0] > -1), "tip": (0, lambda x: x[0] > LENGTH - 1e-9)})


def blade(family, speed, **about):
    """(structure, unit of frequencies) of a blade along x that turns about z."""
    spin = {} if not speed else {"axis": (0, 0, 1)}
    if family == "beam":
        mesh, material, unit = beams(), THIN_BEAM, UNIT
    elif family == "solid":
        mesh, material = box((30, 1, 1), (1.0, 0.02, 0.02)), ao.Solid(E, 0.0, RHO)
        unit, about = np.sqrt(E * 0.02**2 / 12 / RHO), {"about": (0, 0.01, 0.01)}
    else:
        mesh = sheet((16, 1), lambda s, t: (s, 0.05 * (t - 0.5), 0 * s), family)
        material, unit = ao.Shell(E, 0.0, RHO, 0.005), np.sqrt(E * 0.005**2 / 12 / RHO)
    loads = ao.Prestress(spin=ao.Spin(omega=speed * unit, **spin, **about))
    return ao.Structure(mesh, material, [ao.Support(at_root)], prestress=loads), unit


@pytest.mark.parametrize("family", ["beam", "solid", "triangle", "quadrilateral"])
@pytest.mark.parametrize("speed", [3, 12])
def test_a_rotating_cantilever_has_the_frequencies_of_wrights_table(family, speed):
    part, unit = blade(family, speed)
    found = part.natural_modes(6).omega / unit
    for flap in WRIGHT[speed]:
        assert np.abs(found / flap - 1).min() < 3e-3
        if family in ("beam", "solid"):
            assert np.abs(found / np.sqrt(flap**2 - speed**2) - 1).min() < 3e-3
    assert "without Coriolis" in part.describe()
    assert part.prestress.reserve == np.inf


def test_an_axis_beside_the_blade_bends_it_back_into_its_plane():
    """Beside its axis a spinning string takes the line x/L, so that tip and hub stay in a row.

    The lag y'' of a flexible blade with N = m Ω² (L² − x²)/2 and the load m Ω² (y − e), y(0) = 0,
    is that of e x/L; a stiff one stays straight.
    """
    soft = ao.Beam(E * 1e-4, 0.3, RHO, SQUARE, shear=False)
    spin = ao.Spin((0, 0, 1), 40 * UNIT / 100, about=(0, 0.01, 0))
    held = ao.Support(at_root, fix=("x", "y", "z", "rx", "ry"))
    part = ao.Structure(beams(40), soft, [held, ao.Support(lambda x: x[0] > 2, fix="x")][:1], prestress=ao.Prestress(spin=spin))
    state = part.prestress
    x, y = state.points[:, 0], state.displacement[:, 1]
    assert y == pytest.approx(0.01 * x, abs=3e-4)


@pytest.mark.parametrize("share", [0.1, 10.0, -0.9])
def test_a_beam_between_walls_under_tension_or_thrust(share):
    """ω² of pinned ends grows by the share N/N_E of Euler's load, N_E = π² EI/L²."""
    euler = np.pi**2 * EI
    pinned = ao.Support(at_ends, fix=("x", "y", "z", "rx"))
    loads = ao.Prestress(tension={"all": share * euler})
    part = ao.Structure(beams(), THIN_BEAM, [pinned], prestress=loads)
    exact = np.pi**2 * UNIT * np.sqrt(1 + share)
    assert part.natural_modes(2).omega == pytest.approx(exact, rel=1e-4)
    assert part.prestress.reserve == pytest.approx(-1 / share if share < 0 else np.inf, rel=1e-4)
    stress = share * euler / SIDE**2
    assert part.prestress.stress.values == pytest.approx(abs(stress), rel=1e-6)


def test_a_tight_string_of_bars():
    """A string of mass m per length under N: ω = (π/L) √(N/m)."""
    tension = 50.0
    held = ao.Support(at_ends)
    wire = ao.Truss(E, 0.3, RHO, area=1e-6)
    part = ao.Structure(beams(60), wire, [held], prestress=ao.Prestress(tension={"all": tension}))
    exact = np.pi * np.sqrt(tension / (RHO * 1e-6))
    assert part.natural_modes(2).omega == pytest.approx(exact, rel=1e-3)


SIZE, THIN = 1.0, 0.004
PLATE = ao.Shell(E, 0.3, RHO, THIN)


def plate(force, cell="triangle", laminate=False):
    def right(x):
        return x[0] > SIZE - 1e-9

    mesh = sheet((8, 8), lambda s, t: (SIZE * s, SIZE * t, 0 * s), cell)
    mesh = ao.read_mesh(mesh.dolfinx, groups={**{}, **tags(mesh, {"right": (1, right)})})
    rim = ao.Support(lambda x: (np.minimum(x, SIZE - x)[:2] < 1e-9).any(axis=0), fix="z")
    left = ao.Support(at_root, fix=("x", "ry"))
    corner = ao.Support(lambda x: np.hypot(x[0], x[1]) < 1e-9, fix="y")
    loads = ao.Prestress(force={"right": (force, 0, 0)}) if force else None
    material = PLATE
    if laminate:
        layer = ao.Layer.isotropic(E, 0.3, RHO, THIN / 2)
        material = ao.Laminate([layer, layer])
    return ao.Structure(mesh, material, [rim, left, corner], prestress=loads)


def tags(mesh, groups):
    from dolfinx.mesh import locate_entities, meshtags

    found = {}
    for name, (dim, marker) in groups.items():
        entities = locate_entities(mesh.dolfinx, dim, marker)
        marks = np.ones(len(entities), dtype=np.int32)
        found[name] = (meshtags(mesh.dolfinx, dim, entities, marks), 1)
    return found


@pytest.mark.parametrize(("cell", "laminate"), [("triangle", False), ("quadrilateral", True)])
def test_a_plate_under_an_edge_load(cell, laminate):
    """ω² of the modes sin(π x/a) sin(nπ y/a) grows by N π²/(ρ h a²); N per width."""
    critical = 4 * np.pi**2 * E * THIN**3 / 12 / (1 - 0.3**2) / SIZE**2
    still = plate(0.0, cell, laminate).natural_modes(1).omega[0] ** 2
    for share in (3.0, -0.8):
        part = plate(share * critical * SIZE, cell, laminate)
        more = share * critical * np.pi**2 / (RHO * THIN * SIZE**2)
        found = part.natural_modes(1).omega[0]
        assert found == pytest.approx(np.sqrt(still + more), rel=1e-3)


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


def test_a_spin_beyond_the_first_singularity_is_refused():
    """A blade inward of its axis, x < 0 of the hub's: its tip is pressed toward the hub."""
    spin = ao.Spin((0, 0, 1), 20 * UNIT, about=(2 * LENGTH, 0, 0))
    with refused(None, "a spin at", ao.InputError):
        ao.Structure(beams(), THIN_BEAM, [ao.Support(at_root)], prestress=ao.Prestress(spin=spin))


def test_a_ring_buckles_under_a_pressure_that_follows_its_surface():
    """p_cr = 3 D/R³ of a long tube (Lévy); one whose direction is fixed would take 4 D/R³."""
    radius, wall = 0.1, 1e-3

    def half(s, t):
        r = radius + wall * (t - 0.5)
        return r * np.cos(np.pi * s), r * np.sin(np.pi * s), 0 * s

    mesh = sheet((24, 1), half, "quadrilateral", 2)
    mesh = ao.read_mesh(plane(mesh), groups=None) if False else mesh
