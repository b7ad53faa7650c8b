"""Damping of models: losses of materials and layers that relax; ratios of modes, Rayleigh's."""

from __future__ import annotations

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.fem.elements.weak_form import restricted_forms
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.reduce.site import functional
from assemblies import dense, free_dofs

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
    forms = restricted_forms(part.form.stiffness, part.mesh, part.parts[0][1])
    share = csr(compat.assemble(forms, part.form.space, part.conditions, 0.0))
    free = free_dofs(part)
    return part, share[free][:, free].toarray()


@pytest.mark.slow
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
    for n in (1, 2, 5):
        H = ao.extract(part, TIP, n=n).modal().receptance(omega)
        assert (H.imag <= 0).all()


@pytest.mark.slow
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


@pytest.mark.slow
def test_what_is_no_loss_factor_and_no_series_is_refused():
    with pytest.raises(ao.InputError, match="loss"):
        ao.Solid(1e9, 0.3, 1e3, loss=-0.1)
    for bad in ([(1.0,)], [(0.5, -1e-3)], 3.0, "slow"):
        with pytest.raises(ao.InputError, match="prony"):
            ao.Solid(1e9, 0.3, 1e3, prony=bad)


@pytest.mark.slow
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


SITE = ao.Site((0.13, 0.06), (0.2, -1), radius=0.034)


@pytest.fixture(scope="module")
def sheet():
    return parts.held_sheet()


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.02, [0.05, 0.02, 0.01], ao.Damping(alpha=30.0, beta=1e-7)])
def test_every_model_has_the_damping_of_its_free_modes(sheet, damping):
    known = damping if isinstance(damping, ao.Damping) else ao.Damping(ratio=damping)
    for model in (
        ao.extract(sheet, SITE, 6, damping=damping),
        ao.superposition(sheet, SITE, 4, damping=damping),
        ao.full(sheet, SITE, damping=damping),
        *ao.extract(sheet, [SITE, SITE], 4, damping=damping),
    ):
        body = model.modal()
        np.testing.assert_allclose(body.decay, known.decay(body.omega), rtol=1e-12)
    several = ao.extract(sheet, {"tip": SITE}, 6, damping=damping).site_modes()
    np.testing.assert_allclose(several.decay, known.decay(several.omega), rtol=1e-12)


@pytest.mark.slow
def test_the_ringing_after_a_blow_decays_by_its_ratio(sheet):
    """The lowest mode alone is left after the others have died: e^(−ζωt)."""
    model = ao.extract(sheet, SITE, 8, damping=[0.02, 0.2])
    hit = ao.simulate(model, ao.RigidMass(0.02, 1.0), ao.Hertz(1e8), 0.05)
    omega = model.modal().omega[0]
    period = 2 * np.pi / (omega * np.sqrt(1 - 0.02**2))
    start = 0.05 - 20 * period
    t = start + np.linspace(0, 1, 400) * period
    first, last = (
        np.abs(ao.probe(sheet, hit, (0.2, 0.03), times=t + k * period)[:, 1]).max() for k in (0, 15)
    )
    assert np.log(first / last) == pytest.approx(0.02 * omega * 15 * period, rel=1e-3)
