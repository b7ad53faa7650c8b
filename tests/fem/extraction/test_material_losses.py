"""Loss factors and Prony series of materials, against direct harmonic solves."""

from __future__ import annotations

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.base.errors import InputError
from antiosc.fem.elements.weak_form import restricted
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.site import functional
from assemblies import dense, free_dofs

pytestmark = pytest.mark.slow

SECTION = ao.Section.rectangle(0.01, 0.02)
TIP = ao.Site((1, 0, 0), (0, 0, 1))


def two_materials(**root):
    """A cantilever whose first half has other constants; (structure, K of that half)."""
    mesh = compat.create_mesh(
        MPI.COMM_SELF,
        np.column_stack([np.arange(10), np.arange(1, 11)]).astype(np.int64),
        np.linspace((0, 0, 0), (1, 0, 0), 11),
        "interval",
        1,
    )
    x = mesh.geometry.x[compat.geometry_nodes(mesh)].mean(axis=1)[:, 0]
    cells = np.arange(10, dtype=np.int32)
    halves = dolfinx.mesh.meshtags(mesh, 1, cells, np.where(x < 0.5, 1, 2).astype(np.int32))
    tags = {"root": (halves, 1), "rest": (halves, 2)}
    own = ao.read_mesh(mesh, groups=tags)
    beam = {"nu": 0.3, "rho": 2700.0, "section": SECTION, "orientation": (0, 0, 1)}
    material = {"root": ao.Beam(E=40e9, **beam, **root), "rest": ao.Beam(E=70e9, **beam)}
    part = ao.Structure(own, material, [ao.Support(lambda x: np.isclose(x[0], 0.0))])
    forms = restricted(part.form.stiffness, part.mesh, part.parts[0][1])
    share = csr(compat.assemble(forms, part.form.space, part.conditions, 0.0))
    free = free_dofs(part)
    return part, share[free][:, free].toarray()


def test_a_layer_with_a_prony_series_is_that_of_the_complex_stiffness():
    prony = [(0.8, 1e-3), (0.5, 1e-4)]
    part, share = two_materials(prony=prony)
    K, M = dense(part)
    b = functional(part, TIP).b[free_dofs(part)]
    omega = np.geomspace(30.0, 3e3, 25)
    s = 1j * omega
    extra = sum(ratio * s * tau / (1 + s * tau) for ratio, tau in prony)
    exact = np.array(
        [
            b @ np.linalg.solve(K - w**2 * M + z * share, b)
            for w, z in zip(omega, extra, strict=True)
        ]
    )
    model = ao.extract(part, TIP, n=20)
    np.testing.assert_allclose(model.modal().receptance(omega), exact, rtol=1e-4)
    banded = ao.extract(part, TIP, band=3e3, accuracy=1e-3, n=30)
    off = np.abs(banded.modal().receptance(omega) / exact - 1).max()
    assert off < banded.info.band["error_bound"] <= 1e-3
    for n in (1, 2, 5):
        H = ao.extract(part, TIP, n=n).modal().receptance(omega)
        assert (H.imag <= 0).all()


def test_loss_factors_give_the_peaks_of_the_complex_stiffness():
    """At the first resonances, where H is the largest; zeta is half the mean loss factor."""
    part, share = two_materials(loss=0.04)
    K, M = dense(part)
    b = functional(part, TIP).b[free_dofs(part)]
    model = ao.extract(part, TIP, n=12)
    body = model.modal()
    peaks = body.omega[:4]
    exact = [b @ np.linalg.solve(K + 0.04j * share - w**2 * M, b) for w in peaks]
    np.testing.assert_allclose(np.abs(body.receptance(peaks)), np.abs(exact), rtol=2e-2)
    whole = ao.Structure(
        part.mesh,
        ao.Beam(40e9, 0.3, 2700.0, SECTION, orientation=(0, 0, 1), loss=0.03),
        part.supports,
    )
    ratio = ao.extract(whole, TIP, n=5).damping.ratio
    np.testing.assert_allclose(ratio, 0.015, rtol=1e-6)


def test_what_is_no_loss_factor_and_no_series_is_refused():
    with pytest.raises(InputError, match="loss"):
        ao.Solid(1e9, 0.3, 1e3, loss=-0.1)
    for bad in ([(1.0,)], [(0.5, -1e-3)], 3.0, "slow"):
        with pytest.raises(InputError, match="prony"):
            ao.Solid(1e9, 0.3, 1e3, prony=bad)


def test_a_layer_in_an_assembly_relaxes_as_in_its_part_alone():
    part, _ = two_materials(prony=[(0.8, 1e-3), (0.5, 1e-4)])
    joined = ao.assemble({"a": part}, [])
    omega = np.geomspace(30.0, 3e3, 9)
    alone = ao.extract(part, TIP, n=10).modal().receptance(omega)
    both = ao.extract(joined, ao.Site((1, 0, 0), (0, 0, 1), part="a"), n=10).modal()
    np.testing.assert_allclose(both.receptance(omega), alone, rtol=1e-6)


def test_losses_beside_dampers_act_together():
    part, share = two_materials(loss=0.04)
    c = 2.0
    joined = ao.assemble({"a": part}, [], attached=[ao.Damper((1, 0, 0), {"z": c})])
    site = ao.Site((1, 0, 0), (0, 0, 1), part="a")
    body = ao.extract(joined, site, n=12).modal()
    K, M = dense(part)
    b = functional(part, TIP).b[free_dofs(part)]
    peaks = ao.extract(part, TIP, n=12).modal().omega[1:4]
    exact = [
        b @ np.linalg.solve(K + 0.04j * share + 1j * w * c * np.outer(b, b) - w**2 * M, b)
        for w in peaks
    ]
    np.testing.assert_allclose(np.abs(body.receptance(peaks)), np.abs(exact), rtol=2e-2)
