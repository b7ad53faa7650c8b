"""Envelopes at the nodes against probes; reactions of supports and their balance."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.reduce.site import functional
from mpi import START, one_and_several
from parts import unreduced
from static_loads import quiet

BALL, LAW = ao.RigidMass(mass=0.1, velocity=1.0), ao.Hertz(1e8)
SITE = ao.Site((0.13, 0.06), (0.2, -1), radius=0.034)


@pytest.fixture(scope="module")
def struck():
    part = parts.held_sheet()
    return part, ao.simulate(ao.extract(part, SITE, 12), BALL, LAW, 5e-4)


def test_envelopes_of_motion_are_those_of_probes(struck, tmp_path):
    part, hit = struck
    times = np.linspace(0, 5e-4, 81)
    for quantity in ("displacement", "velocity", "acceleration"):
        peak = ao.peak_field(part, hit, quantity, times)
        assert peak.unit == {"d": "m", "v": "m/s", "a": "m/s²"}[quantity[0]]
        for i in (0, len(peak.values) // 2, len(peak.values) - 1):
            own = np.linalg.norm(ao.probe(part, hit, peak.points[i, :2], quantity, times), axis=1)
            assert peak.values[i] == pytest.approx(own.max(), rel=1e-9, abs=1e-12)
            if own.max() > 1e-9:
                assert peak.times[i] == times[own.argmax()]
    file = meshio.read(peak.write(tmp_path / "peak"))
    np.testing.assert_array_equal(file.point_data["acceleration"].ravel(), peak.values)
    np.testing.assert_array_equal(file.point_data["time"].ravel(), peak.times)
    first, second = peak.largest(2, apart=0.05)
    assert first[0] == peak.values.max()
    assert np.linalg.norm(first[1] - second[1]) > 0.05
    assert f"{first[0]:.4g} m/s²" in peak.summary()
    assert "acceleration" in repr(peak)


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration", "von_mises"])
def test_no_peak_of_a_long_run_is_missed(struck, quantity):
    """Against 40 times in each period of the fastest mode; `error` bounds what is missed."""
    part, hit = struck
    model = hit.model
    long = ao.simulate(model, BALL, LAW, 5e-3)
    count = int(40 * model.modal().omega.max() / (2 * np.pi) * 5e-3)
    times = np.union1d(long.time, np.linspace(0, 5e-3, count))
    dense = ao.peak_field(part, long, quantity, times)
    peak = ao.peak_field(part, long, quantity)
    top = dense.values.max()
    np.testing.assert_allclose(peak.values, dense.values, rtol=1e-2, atol=1e-9 * top)
    high = dense.values > 0.55 * top
    np.testing.assert_allclose(peak.values[high], dense.values[high], rtol=4e-3)
    assert np.all(peak.values[high] >= dense.values[high] - peak.error)
    assert 0 < peak.error < 0.05 * top
    assert dense.error is None
    i = int(peak.values.argmax())
    again = ao.peak_field(part, long, quantity, [peak.times[i]])
    assert again.values[i] == pytest.approx(peak.values[i], rel=1e-3)


def test_at_an_interface_the_larger_of_both_materials_counts():
    """A bar of two moduli in a row under tension: strains of each, means within each."""
    mesh = parts.box(
        (8, 1, 1), (0.8, 0.1, 0.1),
        groups={"soft": (3, lambda x: x[0] < 0.4 + 1e-9), "hard": (3, lambda x: x[0] > 0.4 - 1e-9)},
    )  # fmt: skip
    soft, hard = (ao.Solid(E=E, nu=0.0, rho=1000.0) for E in (1e9, 4e9))
    end = ao.Support(lambda x: np.isclose(x[0], 0))
    part = ao.Structure(mesh, {"soft": soft, "hard": hard}, [end])
    site = ao.Site((0.8, 0.05, 0.05), (1, 0, 0), radius=0.2)
    with pytest.warns(ao.AntioscWarning):
        model = ao.extract(part, site, 3)
    scene = ao.Scene(
        {"part": model, "far": ao.Obstacle()},
        [ao.Contact("part", "far", ao.Linear(1.0), gap=1.0)],
        loads=[ao.Load("part", [0.0, 1.0], [10.0, 10.0])],
        preload=True,
    )
    peak = ao.peak_field(part, scene.run(1e-6), "strain", body="part")
    x = peak.points[:, 0]
    np.testing.assert_allclose(peak.values[x < 0.41], 10 / 1e9 / 0.01, rtol=0.02)
    np.testing.assert_allclose(peak.values[(x > 0.41) & (x < 0.51)], 10 / 4e9 / 0.01, rtol=0.02)


PEAKS = """
part = ao.Structure(parts.box((8, 4, 3), cell="tetrahedron"), ao.Solid(**parts.STEEL),
                    [ao.Support("left")])
site = ao.Site((0.15, 0.021, 0.04), (0.1, 0.2, -1), radius=0.02)
hit = ao.simulate(ao.extract(part, site, n=8, method="modes"), ao.RigidMass(0.1, 1.0),
                  ao.Hertz(1e9), duration=3e-4, step=1e-5)
rows = []
for quantity in ("von_mises", "acceleration"):
    peak = ao.peak_field(part, hit, quantity, np.linspace(0, 3e-4, 31))
    _, first = np.unique(peak.points.round(9), axis=0, return_index=True)
    rows.append(peak.values[first].tolist())
print(json.dumps(rows))
"""


@pytest.mark.mpi
def test_two_ranks_give_the_envelopes_of_one():
    one, two = one_and_several(START + PEAKS)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_allclose(b, a, atol=1e-6 * np.max(a))


@pytest.mark.slow
def test_both_sides_of_a_sheet_and_a_fibre_of_a_beam():
    part = ao.Structure(
        parts.plate((6, 2), (0.3, 0.02), "triangle"),
        ao.Shell(E=70e9, nu=0.0, rho=2700.0, thickness=4e-3),
        [ao.Support("left")],
    )
    hit = ao.simulate(
        ao.extract(part, ao.Site((0.27, 0.01, 0), (0, 0, 1), radius=0.01), 6), BALL, LAW, 1e-3
    )
    sides = [ao.peak_field(part, hit, "stress", surface=s).values for s in ("top", "bottom")]
    np.testing.assert_allclose(ao.peak_field(part, hit, "stress").values, np.maximum(*sides))
    beam = ao.Beam(**parts.STEEL, section=ao.Section(A=2e-4, I=7e-9))
    bar = ao.Structure(parts.line(0.8, 4), beam, [ao.Support("left")])
    hit = ao.simulate(ao.extract(bar, ao.Site((0.8, 0.0), (0, 1)), 6), BALL, LAW, 1e-3)
    with pytest.raises(ao.InputError, match="give fibre"):
        ao.peak_field(bar, hit)
    with pytest.raises(ao.InputError, match="contacts"):
        ao.peak_field(bar, hit, contacts=float("nan"))
    peak = ao.peak_field(bar, hit, fibre=(0.01, 0.0))
    own = ao.probe(bar, hit, (0.8, 0.0), "von_mises", peak.times, fibre=(0.01, 0.0))
    assert peak.values.min() >= 0
    assert peak.values[np.argmax(peak.points[:, 0])] == pytest.approx(
        own[np.argmax(peak.points[:, 0])], rel=1e-6
    )


PLANE = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
STRUCK_AT = ao.Site((0.08, 0.06), (0.2, -1), radius=0.034)
DURATION = 6e-4
SUPPORTS = [ao.Support("left"), ao.Support("right", "y")]


def sheet(supports=SUPPORTS, n=(6, 3)):
    return ao.Structure(parts.plate(n, (0.2, 0.06)), PLANE, supports)


@pytest.fixture(scope="module")
def held():
    part = sheet()
    return part, ao.simulate(ao.extract(part, STRUCK_AT, 24), BALL, LAW, DURATION, tol=1e-6)


def test_reactions_and_inertia_balance_the_force(held):
    part, hit = held
    found = ao.reactions(part, hit, STRUCK_AT)
    np.testing.assert_allclose(
        found.total + found.applied, found.inertia, atol=1e-8 * np.abs(found.applied).max()
    )
    along = np.array(STRUCK_AT.direction) / np.linalg.norm(STRUCK_AT.direction)
    np.testing.assert_allclose(found.applied[:, :2], np.outer(hit.force, along), atol=1e-6)
    assert list(found.force) == ["left", "right"]
    assert np.abs(found.force["right"][:, [0, 2]]).max() < 1e-8 * hit.peak_force
    assert np.abs(found.force["right"][:, 1]).max() > 0.05 * hit.peak_force
    np.testing.assert_allclose(found.centre["left"], [0, 0.03, 0], atol=1e-12)


@pytest.mark.slow
def test_reactions_are_those_of_the_unreduced_model(held):
    """Rows of the supports, K_sf u + M_sf u'', under an independent integration with contact."""
    part, hit = held
    times = np.linspace(0, DURATION, 121)
    free_part = sheet([])
    b = functional(free_part, STRUCK_AT).b
    free = np.setdiff1d(np.arange(len(b)), part.fixed)
    K, M = (csr(A).toarray() for A in (free_part.K, free_part.M))
    u, _, a, F = unreduced(part, STRUCK_AT, times, BALL, LAW)
    rows = K @ u.T + M @ a.T - np.outer(b, F)
    assert np.abs(rows[free]).max() < 1e-6 * F.max()
    found = ao.reactions(part, hit, STRUCK_AT, times)
    form = part.form
    for name, value in (("left", 0.0), ("right", 0.2)):
        for axis, component in enumerate("xy"):
            dofs, x = compat.dof_coordinates(form.space, form.components[component])
            there = np.intersect1d(dofs[np.isclose(x[:, 0], value)], part.fixed)
            exact = rows[there].sum(axis=0) if len(there) else np.zeros(len(times))
            np.testing.assert_allclose(
                found.force[name][:, axis], exact, atol=5e-3 * np.abs(rows[part.fixed].sum(0)).max()
            )
        moment = np.zeros(len(times))
        for axis, component in enumerate("xy"):
            dofs, x = compat.dof_coordinates(form.space, form.components[component])
            keep = np.isclose(x[:, 0], value) & np.isin(dofs, part.fixed)
            arm = (x[keep] - found.centre[name])[:, 1 - axis] * (1, -1)[1 - axis]
            moment += arm @ rows[dofs[keep]]
        np.testing.assert_allclose(
            found.moment[name][:, 2], moment, atol=5e-3 * np.abs(moment).max() + 1e-6
        )


def test_what_has_no_reactions_is_refused(held):
    part, hit = held
    free = sheet([])
    run = ao.simulate(ao.extract(free, STRUCK_AT, 4), BALL, LAW, DURATION)
    for structure, history, site, message in (
        (free, run, STRUCK_AT, "no supports"),
        (part, hit, {"a": STRUCK_AT, "b": STRUCK_AT}, "1 directions of contact, the sites given 2"),
        (part, hit, "tip", "a Site"),
    ):
        with pytest.raises(ao.InputError, match=message):
            ao.reactions(structure, history, site)


@pytest.mark.slow
def test_a_clamped_shell_holds_force_and_moment():
    """At rest under F at the distance d: R = −F and M = F d about the clamp."""
    part = ao.Structure(
        parts.plate((8, 2), (0.3, 0.02), "triangle"),
        ao.Shell(E=70e9, nu=0.3, rho=2700.0, thickness=4e-3),
        [ao.Support("left")],
    )
    site = ao.Site((0.27, 0.01, 0), (0, 0, 1), radius=0.01)
    found = ao.reactions(part, quiet(ao.extract(part, site, 6), 5.0), site, body="part")
    np.testing.assert_allclose(found.force["left"][-1], [0, 0, -5], atol=1e-6)
    np.testing.assert_allclose(found.moment["left"][-1], [0, 5 * 0.27, 0], atol=1e-5)


@pytest.mark.slow
def test_a_part_that_slides_and_a_scene():
    """A guide along x: the reactions along y balance, and those along x are zero."""
    with pytest.warns(ao.AntioscWarning, match="free to move"):
        part = sheet([ao.Support("left", "y"), ao.Support("right", "y")])
    hit = ao.simulate(ao.extract(part, STRUCK_AT, 10), BALL, LAW, DURATION)
    found = ao.reactions(part, hit, STRUCK_AT)
    scale = np.abs(found.applied).max()
    np.testing.assert_allclose(
        (found.total + found.applied)[:, 1], found.inertia[:, 1], atol=1e-8 * scale
    )
    np.testing.assert_allclose(found.applied[:, 0], found.inertia[:, 0], atol=1e-8 * scale)
    assert np.abs(found.total[:, 0]).max() < 1e-8 * scale
    two = {"one": STRUCK_AT, "other": ao.Site((0.15, 0.0), (0, 1), radius=0.034)}
    held = sheet()
    scene = ao.Scene(
        {"part": ao.extract(held, two, 20), "ball": BALL, "stop": ao.Obstacle()},
        [ao.Contact("part:one", "ball", LAW), ao.Contact("part:other", "stop", LAW, gap=1e-7)],
    )
    run = scene.run(DURATION)
    both = ao.reactions(held, run, two, body="part")
    np.testing.assert_allclose(
        both.total + both.applied, both.inertia, atol=1e-8 * np.abs(both.applied).max()
    )
    assert run["part:other", "stop"].peak_force > 0
