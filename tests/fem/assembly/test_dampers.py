"""Dampers of structures and assemblies in their models, against direct solves with C."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.reduce.site import functional
from assemblies import BEAM, dense, free_dofs, line

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:the joints leave parts free")]

TIP = ao.Site((1, 0, 0), (0, 0, 1), part="a")
FAR = ao.Site((1, 0, 0), (0, 0, 1), part="b")
MIDDLE = ao.Site((0.6, 0, 0), (0, 0, 1), part="a")


def beams(c: float, spring: float = 0.0) -> ao.Structure:
    """Two cantilevers of different lengths, and a damper between their tips."""
    long = ao.Structure(line((0, 0, 0), (1, 0, 0), 8), BEAM, [ao.Support("start")])
    short = ao.Structure(line((1.8, 0, 0), (1, 0, 0), 6), BEAM, [ao.Support("start")])
    stiffness = {"z": spring} if spring else {}
    return ao.assemble(
        {"a": long, "b": short},
        [ao.Bushing("a:end", "b:end", stiffness, damping={"z": c}, point=(1, 0, 0))],
        {"b": (0.0, 0, 0)},
    )


def receptance(part: ao.Structure, site: ao.Site, c: float, omega: np.ndarray) -> np.ndarray:
    """bᵀ(K + iωC − ω²M)⁻¹b by dense solves; the damper acts on the difference of both tips."""
    K, M = dense(part)
    free = free_dofs(part)
    b, first, second = (functional(part, one).b[free] for one in (site, TIP, FAR))
    apart = first - second
    C = c * np.outer(apart, apart)
    return np.array([b @ np.linalg.solve(K + 1j * w * C - w**2 * M, b) for w in omega])


@pytest.mark.parametrize("c", [1.0, 4000.0])
def test_the_receptance_is_that_with_the_damper(c):
    """At a site that sees the other beam by the damper alone, weak or strong."""
    omega = np.geomspace(30.0, 3e3, 25)
    for spring in (0.0, 2e4):
        part = beams(c, spring)
        model = ao.extract(part, MIDDLE, n=20)
        exact = receptance(part, MIDDLE, c, omega)
        np.testing.assert_allclose(model.modal().receptance(omega), exact, rtol=1e-5)
        both = ao.extract(part, {"m": MIDDLE, "far": FAR}, n=20).site_modes()
        np.testing.assert_allclose(both.receptance(omega)[:, 0, 0], exact, rtol=1e-5)


def test_a_branch_and_dampers_of_points_of_a_structure():
    """Damper(to=), Damper(tau=) of one structure, Bushing(branches=) of an assembly."""
    near, far, c, tau = (0.4, 0, 0), (0.9, 0, 0), 30.0, 2e-3
    omega = np.geomspace(30.0, 3e3, 25)
    clamp, tip = [ao.Support("start")], ao.Site((1, 0, 0), (0, 0, 1))
    mesh = line((0, 0, 0), (1, 0, 0), 10)
    bare = ao.Structure(mesh, BEAM, clamp)
    K, M = dense(bare)
    free = free_dofs(bare)
    b, one, two = (functional(bare, ao.Site(x, (0, 0, 1))).b[free] for x in ((1, 0, 0), near, far))
    apart = one - two
    for relaxing in (False, True):
        damper = ao.Damper(near, {"z": c}, to=far, tau=tau if relaxing else None)
        part = ao.Structure(mesh, BEAM, clamp, attached=[damper])
        model = ao.extract(part, tip, n=16)
        add = 1j * omega * c / (1 + 1j * omega * tau if relaxing else 1)
        exact = [
            b @ np.linalg.solve(K - w**2 * M + z * np.outer(apart, apart), b)
            for w, z in zip(omega, add, strict=True)
        ]
        np.testing.assert_allclose(model.modal().receptance(omega), exact, rtol=1e-5)
        whole = ao.assemble({"a": part}, [], attached=[ao.PointMass("a:end", 0.001)])
        joined = ao.extract(whole, ao.Site((1, 0, 0), (0, 0, 1), part="a"), n=16)
        alone = ao.Structure(mesh, BEAM, clamp, attached=[damper, ao.PointMass("end", 0.001)])
        np.testing.assert_allclose(
            joined.modal().receptance(omega),
            ao.extract(alone, tip, n=16).modal().receptance(omega),
            rtol=1e-5,
        )
    mount = ao.assemble(
        {"a": bare},
        [ao.Bushing("a:end", "ground", branches=[({"z": 3e4}, tau)])],
        points={"ground": (1, 0, 0)},
        supports=[ao.Support("ground")],
    )
    found = ao.extract(mount, ao.Site((0.6, 0, 0), (0, 0, 1), part="a"), n=16)
    site = functional(bare, ao.Site((0.6, 0, 0), (0, 0, 1))).b[free]
    exact = [
        site
        @ np.linalg.solve(
            K - w**2 * M + 3e4 * 1j * w * tau / (1 + 1j * w * tau) * np.outer(b, b), site
        )
        for w in omega
    ]
    np.testing.assert_allclose(found.modal().receptance(omega), exact, rtol=1e-5)


@pytest.mark.filterwarnings("ignore:the supports leave the structure free")
def test_a_column_on_soil_is_the_rod_of_closed_form():
    """A rod of impedance S = k + iwc - w^2 m at its foot; EA q s = S.

    k and c are those of a disk on the half-space and of its waves, upright and sideways.
    """
    r, G, nu, rho, L = 0.4, 60e6, 0.4, 1800.0, 2.0
    across, along = 8 * G * r / (2 - nu), 4 * G * r / (1 - nu)
    shear = np.sqrt(G * rho) * np.pi * r**2
    foot = [
        ao.Spring("start", {"x": across, "y": across, "z": along}),
        ao.Damper("start", {"x": shear, "y": shear, "z": 2 * shear}),
        ao.PointMass("start", 100.0 + 2.4 * (nu - 1 / 3) * rho * np.pi * r**3),
    ]
    beam = ao.Beam(30e9, 0.2, 2400.0, ao.Section.circle(0.25), orientation=(1, 0, 0))
    mesh, held = line((0, 0, 0), (0, 0, L), 16), [ao.Support("start", ["rx", "ry", "rz"])]
    part = ao.Structure(mesh, beam, held, attached=foot)
    alone = ao.assemble({"a": ao.Structure(mesh, beam, held)},
                        attached=[replace(one, where="a:start") for one in foot])  # fmt: skip
    w, EA = np.geomspace(20, 5000, 7), 30e9 * beam.section.A
    q = w / np.sqrt(30e9 / 2400)
    S = 4 * G * r / (1 - nu) + 1j * w * rho * 2 * np.sqrt(G / rho) * np.pi * r**2
    s = (S - w**2 * (100 + 2.4 * (nu - 1 / 3) * rho * np.pi * r**3)) / (EA * q)
    H = (np.cos(q * L) + s * np.sin(q * L)) / (EA * q * (s * np.cos(q * L) - np.sin(q * L)))
    for one, name in ((part, None), (alone, "a")):
        top = ao.extract(one, ao.Site((0, 0, L), (0, 0, -1), part=name), n=20)
        np.testing.assert_allclose(top.modal().receptance(w), H, rtol=1e-4)
        side = ao.extract(one, ao.Site((0, 0, 0), (1, 0, 0), part=name), n=2)
        assert side.k0 == pytest.approx(8 * G * r / (2 - nu), rel=1e-9)
