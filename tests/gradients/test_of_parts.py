"""`gradient(part=)` against impacts of re-extracted parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import antiosc as ao

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore:.*deflects by")]
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


def plate(thickness: float = 2e-3, wider: float = 0.0, material: Any = None) -> ao.Structure:
    from dolfinx import mesh
    from mpi4py import MPI

    sheet = mesh.create_rectangle(
        MPI.COMM_WORLD, [[0, 0], [0.3, 0.2]], [4, 3], mesh.CellType.triangle
    )
    sheet.geometry.x[:, 0] *= 1 + wider
    shell = material or ao.Shell(E, 0.33, RHO, thickness)
    clamp = ao.Support(lambda x: (x[0] < 1e-9) | (x[1] < 1e-9))
    return ao.Structure(ao.read_mesh(sheet), shell, supports=[clamp])


def push(part: ao.Structure, tol: float = 1e-6) -> ao.History:
    model = ao.extract(part, ao.Site((0.13, 0.09, 0), (0, 0, -1), radius=0.01), n=12)
    return ao.simulate(model, ao.RigidMass(0.3, 1.0), ao.Hertz(2e7), 6e-3, tol=tol)


@pytest.fixture(scope="module")
def struck() -> tuple[ao.Structure, ao.History]:
    part = plate()
    return part, push(part)


@pytest.fixture(scope="module")
def g(struck: tuple[ao.Structure, ao.History]) -> ao.Gradient:
    part, hit = struck
    return ao.gradient(hit, "impulse", part=part, error="estimate")


@pytest.mark.slow
def test_shape_against_impacts_on_other_shapes(struck: tuple[ao.Structure, ao.History]) -> None:
    _, hit = struck
    g = ao.gradient(hit, "peak_force", part=lambda x: plate(wider=x[0]), x=[0.0])
    ends = [push(plate(wider=s * 1e-4), 1e-8).peak_force for s in (-1, 1)]
    assert g.x[0] == pytest.approx((ends[1] - ends[0]) / 2e-4, rel=0, abs=2e-3 * g.value)


@pytest.mark.slow
def test_a_design_map_adds_up_to_the_derivative(
    struck: tuple[ao.Structure, ao.History], g: ao.Gradient
) -> None:
    part, hit = struck
    for by, expected in (("thickness", g.thickness), ("rho", g.rho)):
        found = ao.design_map(part, hit, "impulse", by=by)
        assert found.slopes.shape == (24,)
        assert found.slopes.sum() == pytest.approx(expected, rel=1e-2)
        assert found.slopes.min() < 0.0 < found.slopes.max() or by == "rho"
    mass = found.slopes / found.per_mass * RHO  # of each cell
    assert mass.sum() == pytest.approx(part.mass, rel=1e-9)


@pytest.mark.slow
def test_a_design_map_against_extracting_again_with_other_zones() -> None:
    mesh, zones = ao.read_mesh("meshes/panel_zones.geo", size=0.12), ("middle", "ring", "rim")

    def panel(x: Any) -> ao.Structure:
        shells = [ao.Shell(210e9, 0.3, 7850.0, 3e-3 * each) for each in x]
        return ao.Structure(mesh, dict(zip(zones, shells, strict=True)), [ao.Support("held")])

    part = panel(np.ones(3))
    model = ao.extract(part, ao.Site((0.05, 0.03, 0), (0, 0, -1), radius=6e-3), n=24)
    hit = ao.simulate(model, ao.RigidMass(0.3, 3.0), ao.Hertz(5e7), 5e-3, tol=1e-6)
    again = ao.gradient(hit, "impulse", part=panel, x=np.ones(3)).x
    found = ao.design_map(part, hit, "impulse")
    sums = np.bincount(found.meshed.part_of_cells(), 3e-3 * found.slopes)
    assert sums == pytest.approx(again, rel=0, abs=5e-4 * found.value)


@pytest.mark.slow
def test_a_design_map_of_a_solid(tmp_path: Path) -> None:
    part = bar()
    hit = blow(part, 1e-4)
    g = ao.gradient(hit, "peak_force", part=part)
    for by, left_out in (("rho", 3e-3), ("E", 2e-2)):  # by E the patch has 1.5 % of it
        found = ao.design_map(part, hit, "peak_force", by=by)
        assert found.slopes.sum() == pytest.approx(getattr(g, by), rel=left_out)
    with pytest.raises(ao.InputError, match="thickness"):
        ao.design_map(part, hit, "peak_force")
    assert found.plot(tmp_path / "map.png").stat().st_size > 5000


@pytest.mark.slow
def test_a_part_that_is_not_of_the_model_is_refused(
    struck: tuple[ao.Structure, ao.History],
) -> None:
    _, hit = struck
    with pytest.raises(ao.InputError, match="model"):
        ao.gradient(hit, "impulse", part=plate(2.1e-3))
    with pytest.raises(ao.InputError, match="mass"):
        ao.gradient(hit, "impulse", part=lambda x: plate(x[0]), x=[3e-3])
    with pytest.raises(ao.InputError, match="function"):
        ao.gradient(hit, "impulse", part="plate")
    ply = ao.Layer(1.4e11, 1e10, 0.3, 5e9, 5e9, 3e9, 1600.0, 5e-4)
    with pytest.raises(ao.InputError, match="layers"):
        ao.gradient(hit, "impulse", part=plate(material=ao.Laminate([ply] * 4)))


@pytest.mark.slow
def test_bars_of_a_part_hold_a_finer_model(
    struck: tuple[ao.Structure, ao.History], g: ao.Gradient
) -> None:
    part, _ = struck
    assert g.error is not None
    model = ao.extract(part, ao.Site((0.13, 0.09, 0), (0, 0, -1), radius=0.01), n=24)
    more = ao.simulate(model, ao.RigidMass(0.3, 1.0), ao.Hertz(2e7), 6e-3, tol=1e-6)
    better = ao.gradient(more, "impulse", part=part)
    for name in ("E", "nu", "rho", "thickness"):
        assert abs(getattr(g, name) - getattr(better, name)) <= getattr(g.error, name)


@pytest.mark.slow
def test_a_part_with_dampers() -> None:
    """The damping stays: against impacts on parts of other thickness."""

    def damped(thickness: float = 2e-3) -> ao.Structure:
        part = plate(thickness)
        assert part.made_of is not None
        mesh, shell, _ = part.made_of
        damper = [ao.Damper((0.3, 0.2, 0.0), {"z": 20.0})]
        return ao.Structure(mesh, shell, part.supports, attached=damper)

    part = damped()
    hit = push(part)
    assert isinstance(hit.model.damping, ao.DampingMatrix)
    found = ao.gradient(hit, "impulse", part=lambda x: damped(2e-3 * x[0]), x=[1.0]).x[0]
    ends = [push(damped(2e-3 * (1 + s * 1e-2)), 1e-8).impulse for s in (-1, 1)]
    assert found == pytest.approx((ends[1] - ends[0]) / 2e-2, rel=0, abs=2e-3 * hit.impulse)
    with pytest.raises(ao.InputError, match="couple"):
        ao.design_map(part, hit, "peak_force")
