"""Stresses at surfaces and their estimated errors: a hole (Kirsch), corners, edges of supports."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
import sheets
from antiosc.base.stresses import extreme_principal
from antiosc.fem.fields import mesh_fields
from antiosc.fem.fields.mesh_fields import interior_angle
from antiosc.fem.recovery import Place
from static_loads import held

pytestmark = pytest.mark.fem

STEEL = ao.Solid(210e9, 0.3, 7850.0, plane="stress")


def kirsch(x: np.ndarray, a: float, stress: float) -> np.ndarray:
    """Displacements (n, 2) around a hole under `stress` along x, plane stress (G. Kirsch, 1898)."""
    r, t = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
    G, k, s = 210e9 / 2.6, (3 - 0.3) / 1.3, a / r
    u = (k + 1) * np.cos(t) / s + 2 * s * ((1 + k) * np.cos(t) + np.cos(3 * t))
    v = (k - 3) * np.sin(t) / s + 2 * s * ((1 - k) * np.sin(t) + np.sin(3 * t))
    u, v = u - 2 * s**3 * np.cos(3 * t), v - 2 * s**3 * np.sin(3 * t)
    return stress * a / (8 * G) * np.stack([u, v], axis=1)


@pytest.mark.slow
def test_the_stress_at_a_hole_is_three_times_that_far_away_within_its_estimated_error():
    """The exact displacements at the nodes of quadratic cells: what is left is recovery."""
    found = []
    for n in (8, 16):
        ring = sheets.sheet(
            n, lambda s, t: ((1 + s) * np.cos(t * np.pi / 2), (1 + s) * np.sin(t * np.pi / 2)),
            order=2,
        )  # fmt: skip
        mesh = ao.read_mesh(ring.dolfinx, gdim=2) if ring.gdim == 3 else ring
        part = ao.Structure(mesh, STEEL)
        space = part.form.space
        shapes = kirsch(space.tabulate_dof_coordinates()[:, :2], 1.0, 1.0).reshape(-1, 1)
        nodes, _, six = mesh_fields.tensors_of_part(part, shapes, "stress", Place(), [0])
        x = part.mesh.dolfinx.geometry.x
        top = np.argmin(np.linalg.norm(x - (0, 1, 0), axis=1))
        value = float(extreme_principal(six[nodes == top, :, 0])[0])
        error = mesh_fields.jumps(part, shapes, np.ones((len(x), 1)))[top]
        assert abs(value - 3.0) < 3 * error < 1.0
        found.append((value, error))
    (coarse, more), (fine, less) = found
    assert abs(fine - 3) < 0.4 * abs(coarse - 3) < 0.1
    assert less < 0.5 * more


def ell(n: int) -> ao.Structure:
    """An L of squares, held at the end of one leg; its corner is at (1, 1)."""
    mesh = parts.plate((2 * n, 2 * n), (2.0, 2.0))
    import dolfinx

    kept = dolfinx.mesh.locate_entities(
        mesh.dolfinx, 2, lambda x: (x[0] < 1 + 1e-9) | (x[1] < 1 + 1e-9)
    )
    cut = ao.read_mesh(dolfinx.mesh.create_submesh(mesh.dolfinx, 2, kept)[0])
    return ao.Structure(cut, STEEL, [ao.Support(lambda x: x[1] > 2 - 1e-9)])


def test_a_re_entrant_corner_is_told_and_its_stress_grows_with_the_mesh():
    largest = []
    for n in (3, 6):
        part, hit = held(ell(n), ao.Site((2.0, 0.5), (0, -1), radius=0.4), 1e3)
        peak = ao.peak_field(part, hit, body="part")
        assert interior_angle(part, np.array([1.0, 1.0, 0.0])) == pytest.approx(270)
        assert "corner of 270" in peak.doubt
        largest.append(peak.values.max())
    assert largest[1] > 1.2 * largest[0]


def test_a_contact_that_yields_is_told_beside_the_margin():
    """The pressure is Hertz's of `contact_stress`; a soft blow and a part of rubber say nothing."""
    shell = ao.Shell(210e9, 0.3, 7850.0, thickness=8e-3, yield_strength=355e6)
    mesh = ao.read_mesh(parts.plate((8, 4), (0.2, 0.1)).dolfinx, gdim=3)
    part = ao.Structure(mesh, shell, [ao.Support(lambda x: x[0] < 1e-9)])
    model = ao.extract(part, ao.Site((0.1, 0.05, 0.0), (0, 0, -1)), n=20)
    for speed, yields in ((2.0, True), (1e-4, False)):
        ball = ao.Sphere(0.015, 210e9, 0.3, 7850.0, velocity=speed)
        hit = ao.simulate(model, ball, ball.hertz(210e9, 0.3), 3e-4)
        margin = ao.peak_field(part, hit).margin()
        pressure = ao.contact_stress(ball, hit.peak_force, 210e9, 0.3).pressure
        assert (pressure > 1.6 * 355e6) == yields
        assert bool(margin.contact) == yields
        assert ("Thornton" in margin.sentence) == yields
        if yields:
            assert f"{1e-9 * pressure:.2f} GPa" in margin.sentence
