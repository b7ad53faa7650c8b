"""Sheets with stiffeners, masses and springs by beam theory and mechanics; memory of structures."""

from __future__ import annotations

import json

import numpy as np
import pytest

import antiosc as ao
from antiosc import PointMass, Spring
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from mpi import one_and_several, run_ranks
from sheets import RIB, SHEET, at, dof, frequencies, grouped, interpolated, loaded, rectangle, sheet

E, RHO = 70e9, 2700.0
CELLS = ["triangle", "quadrilateral"]


@pytest.mark.sample
@pytest.mark.parametrize("cell", CELLS)
def test_a_stiffened_strip_is_a_composite_beam(cell):
    """A cantilever of T section: parallel axes and the shift of the neutral axis."""
    length, width = 1.0, 0.05
    mesh = grouped(rectangle((24, 2), length, width, cell), lambda x: np.isclose(x[1], width / 2))
    part = ao.Structure(mesh, {"sheet": SHEET, "rib": RIB}, [ao.Support(at(0, 0.0))])
    forces = ((0, 0.25), (width / 2, 0.5), (width, 0.25))
    tip = {dof(part, (length, v, 0), "z"): force for v, force in forces}
    z = dof(part, (length, width / 2, 0), "z")
    areas = np.array([width * 0.004, 0.004 * 0.03])
    centres = np.array([0.0, 0.017])
    own = np.array([width * 0.004**3, 0.004 * 0.03**3]) / 12
    middle = areas @ centres / areas.sum()
    EI = E * (own.sum() + areas @ (centres - middle) ** 2)
    assert loaded(part, tip)[z] == pytest.approx(length**3 / (3 * EI), rel=1e-2)
    assert part.mass == pytest.approx(RHO * length * areas.sum(), rel=1e-12)
    # pulled in the sheet's plane, below the neutral axis, it bends toward the rib's side
    pull = {dof(part, (length, v, 0), "x"): force for v, force in forces}
    assert loaded(part, pull)[z] == pytest.approx(middle * length**2 / (2 * EI), rel=2e-2)


@pytest.mark.sample
@pytest.mark.parametrize("order", [1, 2])
def test_rigid_motions_strain_no_stiffener(order):
    """A rib around a curved sheet, off its surface: six rigid-body modes, exact mass."""
    mesh = sheet((4, 6), lambda s, v: (0.4 * s, np.sin(v), np.cos(v)), "triangle", order)
    mesh = grouped(mesh, lambda x: np.isclose(x[0], 0.2, atol=1e-6))
    frame = ao.Beam(
        E, 0.3, RHO, ao.Section.tube(0.03, 0.002), orientation=(0.1, 1, -1), offset=0.02
    )
    part = ao.Structure(
        mesh, {"sheet": SHEET, "rib": frame}, attached=[PointMass((0.1, 0, 1), 2.0)]
    )
    assert part.rigid_modes.shape[1] == 6
    K = csr(part.K)
    scale = abs(K).max() * np.abs(part.rigid_modes).max()
    assert np.abs(K @ part.rigid_modes).max() < 1e-12 * scale
    along = interpolated(part, lambda x: {"x": 0.6, "z": 0.8})
    assert along @ multiply(part.M, along) == pytest.approx(part.mass, rel=1e-9)
    inertia = part.uniform_inertia(np.array([0.6, 0, 0.8]))
    exact = multiply(part.M, along)
    assert inertia == pytest.approx(exact, rel=1e-5, abs=1e-7 * np.abs(exact).max())


@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    script = """
        import json
        import numpy as np
        import antiosc as ao
        from antiosc import PointMass, Spring
        from sheets import sheet
        from sheets import RIB, SHEET, grouped

        mesh = sheet((6, 6), lambda s, t: (s, 0.6 * t, 0.1 * s * t), "triangle", 2)
        mesh = grouped(mesh, lambda x: np.isclose(x[0], 0.5), lambda x: np.isclose(x[0], 0))
        part = ao.Structure(mesh, {"sheet": SHEET, "rib": RIB}, attached=[
            PointMass("feet", 0.1, 1e-3),
            Spring("feet", {"z": 1e4, "ry": 10.0})])
        site = ao.Site((0.52, 0.33, 0.02), (0, 0.3, 1), snap=True)
        model = ao.extract(part, site, n=4, method="modes")
        print(json.dumps([part.mass, part.rigid_modes.shape[1], model.k0, model.m_st,
                          *model.omega, *model.m, *np.abs(model.participation)]))
    """
    one, two = one_and_several(script)
    assert two == pytest.approx(one, rel=1e-5)


# --- bad input --------------------------------------------------------------------------------


#: Memory after each of some structures, which are dropped, in units of one's K and M.
GROWTH = """
import json, resource
import antiosc as ao
import parts
from mpi4py import MPI

peaks = []
for _ in range(8):
    part = ao.Structure(parts.box((6, 5, 4)), ao.Solid(**parts.STEEL), [ao.Support("left")])
    ao.extract(part, ao.Site((0.1, 0.03, 0.03), (0, 0, -1), radius=0.03), n=2)
    size = 2 * 12 * part.K.getInfo(part.K.InfoType.LOCAL)["nz_used"]
    del part
    peaks.append(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
print(json.dumps((peaks[-1] - peaks[2]) / size))
"""


@pytest.mark.slow
@pytest.mark.mpi
def test_memory_does_not_grow():
    for text in run_ranks(2, GROWTH, alone=True):
        assert json.loads(text) < 1.5


def test_a_stiff_plate_on_springs_heaves_as_one_mass():
    mesh = grouped(
        rectangle(4, 0.2, 0.2),
        points=lambda x: np.isclose(np.abs(x[0] - 0.1), 0.1) & np.isclose(np.abs(x[1] - 0.1), 0.1),
    )
    feet = Spring("feet", {"x": 100.0, "y": 100.0, "z": 100.0})
    motor = PointMass((0.1, 0.1, 0.0), 0.5, inertia=1e-3)
    part = ao.Structure(mesh, ao.Shell(E, 0.3, RHO, 0.01), attached=[feet, motor])
    mass = RHO * 0.01 * 0.04 + 0.5
    assert part.mass == pytest.approx(mass, rel=1e-12)
    assert part.rigid_modes.shape[1] == 0
    J = (mass - 0.5) * (0.2**2 + 0.01**2) / 12 + 1e-3  # about x and y
    polar = (mass - 0.5) * (0.2**2 + 0.2**2) / 12 + 1e-3  # about z; thin normals add a little
    squares = sorted([400 / mass] * 3 + [4 * 100 * 0.1**2 / J] * 2 + [400 * 0.02 / polar])
    assert frequencies(part, 6) ** 2 == pytest.approx(squares, rel=2e-3)


def test_a_support_holds_the_stiffener_too():
    """A rib along a clamped edge adds nothing but mass."""
    mesh = grouped(rectangle((4, 4), 0.4, 0.4), lambda x: np.isclose(x[0], 0))
    held = [ao.Support(at(0, 0.0))]
    with_rib = ao.Structure(mesh, {"sheet": SHEET, "rib": RIB}, held)
    without = ao.Structure(mesh, {"sheet": SHEET}, held)
    assert np.abs(csr(with_rib.K) - csr(without.K)).max() <= 1e-12 * abs(csr(without.K)).max()
    assert with_rib.mass > without.mass
