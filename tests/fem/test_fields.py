"""Fields after an impact: probes against an independent integration, series and pictures."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pytest
import scipy.linalg

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.reduce.site import functional
from scenes import finely

MODELS = {
    "krylov": lambda part: ao.extract(part, SITE, n=6),
    "modes": lambda part: ao.extract(part, SITE, n=6, method="modes"),
    "corrected": lambda part: ao.superposition(part, SITE, 4, static_correction=True),
    "full": lambda part: ao.full(part, SITE),
}


PLANE = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
SITE = ao.Site((0.13, 0.06), (0.2, -1), radius=0.034)
DURATION = 1e-3


@pytest.fixture(scope="module")
def hit():
    structure = parts.held_sheet()
    model = ao.extract(structure, SITE, n=structure.dofs - 1, method="modes", tol=1e-13)
    striker = ao.RigidMass(mass=0.1, velocity=1.0)
    return structure, ao.simulate(model, striker, ao.Hertz(1e9), duration=DURATION, step=2e-6)


def directly(structure: ao.Structure, b: np.ndarray, time, force) -> np.ndarray:
    """u (times, dofs) under the force b F(t), F linear between `time`: modes by LAPACK, exactly."""
    free = np.setdiff1d(np.arange(len(b)), structure.fixed)
    K, M = (csr(A)[free][:, free].toarray() for A in (structure.K, structure.M))
    x, phi = scipy.linalg.eigh(K, M)
    w = np.sqrt(x)
    load = phi.T @ b[free]
    q, v = np.zeros_like(w), np.zeros_like(w)
    history = [q]
    for k, h in enumerate(np.diff(time)):
        # particular solution: (F0 + F' t) load/w²
        f, slope = force[k] * load / x, (force[k + 1] - force[k]) / max(h, 1e-300) * load / x
        a, c = q - f, (v - slope) / w
        cos, sin = np.cos(w * h), np.sin(w * h)
        q, v = a * cos + c * sin + f + slope * h, w * (c * cos - a * sin) + slope
        history.append(q)
    u = np.zeros((len(time), len(b)))
    u[:, free] = np.array(history) @ phi.T
    return u


def test_the_field_is_that_of_the_full_model_under_the_same_force(hit):
    structure, history = hit
    b = functional(structure, SITE).b
    every = 8
    u = directly(structure, b, *finely(history, every))[::every]
    found = history.field(history.time)
    assert found.shape == u.shape
    assert np.abs(found - u).max() < 1e-6 * np.abs(u).max()
    # The site's displacement is what the functional makes of the field.
    np.testing.assert_allclose(found @ b, history.displacement, atol=1e-9 * np.abs(u).max())


def test_bodies_without_shapes_say_so(tmp_path, hit):
    structure, history = hit
    history.model.save(tmp_path / "model.npz")
    loaded = ao.AntiOscillators.load(tmp_path / "model.npz")
    run = ao.simulate(loaded, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), DURATION)
    for make in (
        lambda: run.field(1e-4),
        lambda: ao.probe(structure, run, (0.1, 0.03)),
        lambda: ao.write_series(structure, run, tmp_path / "none.pvd"),
        lambda: history.field(1e-4, "impactor"),
    ):
        with pytest.raises(ao.InputError, match="shapes"):
            make()
    assert not (tmp_path / "none.pvd").exists()
    with pytest.raises(ao.InputError, match="floor"):
        history.field(1e-4, "floor")
    other = ao.Structure(parts.plate((3, 3), (0.2, 0.06)), PLANE, [ao.Support("left")])
    with pytest.raises(ao.InputError, match="extracted"):
        ao.write_series(other, history, tmp_path / "series.pvd")
    with pytest.raises(ao.InputError, match="within"):
        ao.write_series(structure, history, tmp_path / "series.pvd", [0.0, 1.0])
    assert [p.name for p in tmp_path.iterdir()] == ["model.npz"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the facets at the site measure")
@pytest.mark.parametrize("kind", [*parts.CELLS, "line"])
def test_series_for_paraview(tmp_path, kind):
    if kind == "line":
        beam = ao.Beam(**parts.STEEL, section=ao.Section.circle(0.02))
        structure = ao.Structure(parts.line(0.8, 4, (1, 2, -2)), beam, [ao.Support("left")])
        site = ao.Site(0.8 * np.array([1, 2, -2]) / 3, (2, 1, 2))
    elif kind in ("triangle", "quadrilateral"):
        structure, site = parts.held_sheet(kind), SITE
    else:
        path = parts.gmsh_cube(tmp_path / "cube.msh", kind, 2, bent=True)
        structure = ao.Structure(ao.read_mesh(path), ao.Solid(**parts.STEEL), [ao.Support("clamp")])
        site = ao.Site((1.14, 0.5, 0.5), (-1, 0, 0), radius=0.5, snap=True)
    model = ao.extract(structure, site, n=5)
    history = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), duration=DURATION)
    times = np.linspace(0, DURATION, 5)
    listing = ao.write_series(structure, history, tmp_path / "out" / "series.pvd", times)
    frames = ElementTree.parse(listing).getroot().findall(".//DataSet")
    np.testing.assert_allclose([float(f.get("timestep")) for f in frames], times, atol=1e-12)
    assert sorted(p.name for p in listing.parent.iterdir()) == [
        "series.pvd", *(f"series_{k:04d}.vtu" for k in range(5))
    ]  # fmt: skip
    # The cells are whole: read back as a mesh, they fill the same space.
    again = ao.read_mesh(listing.parent / frames[-1].get("file"), gdim=structure.mesh.gdim)
    assert again.n_cells == structure.mesh.n_cells
    assert again.order == structure.mesh.order
    if kind != "line":
        solid = ao.Solid(**parts.STEEL, plane=None if again.gdim == 3 else "stress")
        depth = 1.0 if again.gdim == 3 else PLANE.thickness
        mass = ao.Structure(again, solid).mass * depth
        assert mass == pytest.approx(structure.mass, rel=1e-12)
    # The displacements are those of the field at the nodes.
    frame = meshio.read(listing.parent / frames[-1].get("file"))
    written = frame.point_data["displacement"]
    assert written.shape == (len(frame.points), 3)
    field = history.field(times[-1])
    for axis, name in enumerate("xyz"[: structure.mesh.gdim]):
        dofs, x = compat.dof_coordinates(structure.form.space, structure.form.components[name])
        distance = np.linalg.norm(frame.points[:, None] - x[None], axis=2)
        assert distance.min(axis=1).max() < 1e-9
        expected = field[dofs[distance.argmin(axis=1)]]
        np.testing.assert_allclose(written[:, axis], expected, atol=1e-12 * abs(field).max())


def test_a_series_removes_only_what_its_list_names(tmp_path, hit):
    structure, history = hit
    mine = tmp_path / "run_2024.vtu"
    mine.write_text("not a frame")
    for write in (ao.write_series, ao.save_fields):
        with pytest.raises(ao.InputError, match="times"):
            write(structure, history, tmp_path / "run.pvd", [])
    assert list(tmp_path.iterdir()) == [mine]
    listing = ao.write_series(structure, history, tmp_path / "run.pvd", [0.0, 1e-6])
    text = listing.read_text().replace("run_0001.vtu", "run_2024.vtu/../../outside.vtu")
    listing.write_text(text)
    ao.write_series(structure, history, listing, [0.0])
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "run.pvd", "run_0000.vtu", "run_0001.vtu", "run_2024.vtu"
    ]  # fmt: skip
    assert mine.read_text() == "not a frame"


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*MODELS, "plain"])
@pytest.mark.parametrize("role", ["structure", "impactor"])
def test_every_model_gives_the_field_of_its_own_motion(kind, role, tmp_path):
    """The site in the field moves as the history says: the static correction included."""
    structure = parts.held_sheet()
    model = ao.superposition(structure, SITE, 4) if kind == "plain" else MODELS[kind](structure)
    law, ball = ao.Hertz(1e9), ao.RigidMass(0.1, 1.0)
    b = functional(structure, SITE).b
    if role == "structure":
        history = ao.simulate(model, ball, law, DURATION)
        site = history.displacement
    else:  # measured along the impact, against the direction of the model's own site
        body = ao.AntiOscillators(m0=0.1, k0=0.0, m=[], omega=[])
        history = ao.simulate(body, ao.Impactor(model), law, DURATION, initial_velocity=1.0)
        site = -history.impactor_displacement
    found = history.field(history.time, role)
    assert np.abs(site).max() > 1e-6
    np.testing.assert_allclose(found @ b, site, atol=1e-9 * np.abs(site).max())
    corner = (0.2, 0.06)
    moved = ao.probe(structure, history, corner, body=role)
    dofs, x = compat.dof_coordinates(structure.form.space, structure.form.components["y"])
    dof = dofs[np.argmin(np.linalg.norm(x[:, :2] - corner, axis=1))]
    np.testing.assert_allclose(moved[:, 1], found[:, dof], atol=1e-12 * np.abs(found).max())
    ao.write_series(structure, history, tmp_path / "series.pvd", [DURATION], body=role)
    frame = meshio.read(tmp_path / "series_0000.vtu")
    node = np.argmin(np.linalg.norm(frame.points[:, :2] - corner, axis=1))
    written = frame.point_data["displacement"][node, :2]
    np.testing.assert_allclose(moved[-1], written, atol=1e-9 * np.abs(moved).max())


@pytest.mark.parametrize("kind", MODELS)
def test_at_rest_under_a_force_the_field_is_the_static_deflection(kind):
    """x = K⁻¹ b F by a direct solve: no mode that was left out is missing from it."""
    structure = parts.held_sheet()
    body = MODELS[kind](structure).modal()
    b, force = functional(structure, SITE).b, 3.0
    free = np.setdiff1d(np.arange(len(b)), structure.fixed)
    still = np.zeros_like(b)
    still[free] = np.linalg.solve(csr(structure.K)[free][:, free].toarray(), b[free] * force)
    at_rest = body.field(body.coordinates(body.b * force / body.omega**2, [force]))
    np.testing.assert_allclose(at_rest, still, atol=1e-8 * np.abs(still).max())


@pytest.mark.filterwarnings("ignore:the compliance under a point load")
def test_a_probe_is_the_field_at_a_point(hit):
    structure, history = hit
    times = np.linspace(0, DURATION, 7)
    field = history.field(times)
    for point in [(0.2, 0.06), (0.0731, 0.0312), (0.1, 0.03)]:
        moved = ao.probe(structure, history, point, times=times)
        assert moved.shape == (7, 2)
        for axis in (0, 1):
            weights = functional(structure, ao.Site(point, np.eye(2)[axis], radius=None)).b
            np.testing.assert_allclose(moved[:, axis], field @ weights, rtol=1e-10, atol=1e-18)
    everywhere = ao.probe(structure, history, (0.2, 0.06))
    assert everywhere.shape == (len(history.time), 2)
    assert np.abs(everywhere[:, 1]).max() > 1e-6
    assert np.abs(ao.probe(structure, history, (0.0, 0.03), times=times)).max() < 1e-18  # clamped


@pytest.fixture(scope="module")
def struck():
    structure = parts.held_sheet()
    model = ao.extract(structure, ao.Site((0.13, 0.06), (0.2, -1), radius=0.035), n=4)
    return structure, ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), 1e-3)


@pytest.mark.slow
def test_the_skin_is_the_surface_and_moves_with_the_part():
    """Its area is that of a block of 200 × 50 × 40 mm, and each of its points moves as probed."""
    from antiosc.fields.fields import nodal_motion, outer_faces

    block = ao.Structure(parts.box((8, 2, 2)), ao.Solid(**parts.STEEL), [ao.Support("left")])
    model = ao.extract(block, ao.Site((0.1, 0.025, 0.04), (0, 0, -1), radius=0.025), n=4)
    struck = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Linear(1e7), 3e-4)
    points, cells, moved = nodal_motion(block, struck, 2e-4)
    faces = outer_faces(cells)
    assert faces.shape == (2 * (8 * 2 + 8 * 2 + 2 * 2), 4)
    a, b, c, d = points[faces].transpose(1, 0, 2)
    across = np.cross(c - a, d - b)
    area = np.linalg.norm(across, axis=1).sum() / 2
    assert area == pytest.approx(2 * (0.2 * 0.05 + 0.2 * 0.04 + 0.05 * 0.04), rel=1e-12)
    for i in (int(faces.max()), int(faces[7, 2])):
        probed = ao.probe(block, struck, points[i], times=[2e-4])[0]
        np.testing.assert_allclose(moved[i], probed, atol=1e-9 * np.abs(moved).max())
