"""`gradient(part=)` against impacts of re-extracted parts."""

from __future__ import annotations

import pytest

import antiosc as ao

pytestmark = pytest.mark.fem
E, RHO = 70e9, 2700.0
SITE = {"point": (0.15, 0.02, 0.01), "direction": (0, 0, -1), "radius": 0.024}


def bar(E: float = E, rho: float = RHO) -> ao.Structure:
    from dolfinx import mesh
    from mpi4py import MPI

    box = mesh.create_box(
        MPI.COMM_WORLD, [[0, 0, 0], [0.2, 0.04, 0.01]], [8, 2, 1], mesh.CellType.hexahedron
    )
    clamp = ao.Support(lambda x: x[0] < 1e-9)
    return ao.Structure(ao.read_mesh(box), ao.Solid(E, 0.33, rho), supports=[clamp])


def blow(part: ao.Structure, tol: float) -> ao.History:
    model = ao.extract(part, ao.Site(**SITE), n=8)
    return ao.simulate(model, ao.RigidMass(0.05, 1.0), ao.Hertz(3e8), 1.5e-3, tol=tol)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_modulus_and_density_against_extracting_again() -> None:
    part = bar()
    g = ao.gradient(blow(part, 1e-5), "impulse", part=part)
    change = 1e-3  # the extraction rounds at 1e-7
    found, expected = [], []
    for name, value in (("E", E), ("rho", RHO)):
        ends = [blow(bar(**{name: value * (1 + s * change)}), 1e-8).impulse for s in (-1, 1)]
        expected.append((ends[1] - ends[0]) / (2 * change))
        found.append(getattr(g, name) * value)
    assert found == pytest.approx(expected, rel=0, abs=1e-4 * max(expected))


def test_a_part_with_attachments_is_refused() -> None:
    part = bar()
    hit = blow(part, 1e-3)
    assert part.made_of is not None
    part.made_of[2]["attached"] = (ao.PointMass((0.2, 0.0, 0.0), 0.1),)
    with pytest.raises(ao.InputError, match="material"):
        ao.gradient(hit, "impulse", part=part)
