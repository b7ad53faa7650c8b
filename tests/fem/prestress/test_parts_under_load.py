"""Parts under load: assemblies, bolts, stresses, blows, ranks, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.elements.second_order import RULE_DEGREES, points_of
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.platform import compat
from antiosc.fem.prestress.state import LoadedPart
from full_second_order import Full
from loaded_beams import (
    EI,
    THIN_BEAM,
    at_ends,
    at_root,
    beams,
)
from mpi import run_ranks
from parts import box
from refusals import refused
from sheets import RIB, SHEET, at, grouped, rectangle, sheet

PINNED = ao.Support(at_ends, fix=("x", "y", "z", "rx"))


def test_a_sheet_with_ribs_is_refused():
    mesh = grouped(rectangle(2, 0.2, 0.1), edges=at(1, 0.05))
    with pytest.raises(ao.InputError, match="beams on edges"):
        ao.Structure(
            mesh, {"sheet": SHEET, "rib": RIB}, [ao.Support(at(0, 0.0))],
            prestress=ao.Prestress(gravity=(0, 0, -9.81)),
        )  # fmt: skip


def tight(**options):
    return ao.Structure(beams(), THIN_BEAM, [PINNED], **options)


@pytest.mark.slow
def test_what_knows_nothing_of_a_prestress_refuses_it():
    part = tight(prestress=ao.Prestress(tension={"all": 10.0}))
    model = ao.extract(part, ao.Site((0.5, 0, 0), (0, 0, -1)), n=4)
    hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Linear(1e6), duration=1e-3)
    calls = [
        lambda: ao.gradient(hit, "peak_force", part=part),
        lambda: ao.assemble({"part": part}),
    ]
    for call in calls:
        with refused(None, "prestress", ao.InputError):
            call()


def sagging():
    """A sheet between two walls that its weight deflects by three thicknesses; a site on it."""
    mesh = sheet((6, 4), lambda s, t: (0.3 * s, 0.2 * t, 0 * s))
    walls = [ao.Support(at(0, 0.0)), ao.Support(at(0, 0.3))]
    shell, heavy = ao.Shell(210e9, 0.3, 7850.0, 1e-3), ao.Prestress(gravity=(0, 0, -2000.0))
    parts = [
        ao.Structure(mesh, shell, walls, prestress=heavy),
        ao.Structure(mesh, shell, walls),
        ao.Structure(mesh, shell),
    ]
    return *parts, heavy, ao.Site((0.1, 0.1, 0), (0, 0, -1), snap=True)


def ball_on(part, site, method="krylov"):
    model, mass = ao.extract(part, site, n=30, method=method), ao.RigidMass(0.05, 0.5)
    return ao.simulate(model, mass, ao.Power(1e6, 1.5), 4e-3, tol=1e-5)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of a point load
def test_reactions_of_a_loaded_part_are_changes_of_those_of_all_its_second_order_forces():
    """Rows of the supports of K u + f(u) + M u'' of the part without them."""
    part, _, free, _, site = sagging()
    hit, full, q = ball_on(part, site), Full(free, site), part.matrices.preload.q
    assert np.abs(part.prestress.displacement).max() > 2e-3
    times, step = np.linspace(5e-4, 3.5e-3, 4), 2e-7
    found = ao.reactions(part, hit, site, times)
    K, M, form = csr(free.K), csr(free.M), part.matrices.form
    exact = np.zeros((2, 2, len(times)))
    for k, t in enumerate(times):
        u = hit.field(t)
        a = (hit.field(t + step) - 2 * u + hit.field(t - step)) / step**2
        ahead, behind = (K @ w + full.forces(w) for w in (q + 1e-3 * u, q - 1e-3 * u))
        rows = (ahead - behind) / 2e-3 + M @ a
        for i, wall in enumerate((0.0, 0.3)):
            for j, axis in enumerate("xz"):
                dofs, x = compat.dof_coordinates(form.space, form.components[axis])
                exact[i, j, k] = rows[dofs[np.isclose(x[:, 0], wall)]].sum()
    own = np.array([force[:, [0, 2]].T for force in found.force.values()])
    assert np.abs(exact[:, 0]).max() > 3 * np.abs(exact[:, 1]).max()  # the pull of a sagging sheet
    assert own == pytest.approx(exact, abs=3e-3 * np.abs(exact).max())
    balance = found.total + found.applied - found.inertia
    assert np.abs(balance).max() < 1e-6 * hit.peak_force


class FullAbout(Full):
    """All second-order forces about the static state of a part under dead loads."""

    def __init__(self, part, site):
        super().__init__(part, site)
        self.q = np.zeros(len(self.b))
        self.rest = self.forces(part.matrices.preload.q)
        self.q = part.matrices.preload.q

    def forces(self, u):
        return super().forces(self.q + u) - (self.rest if self.q.any() else 0.0)

    def tangent(self, u):
        return super().tangent(self.q + u)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_loaded_sheet_stretches_as_all_of_its_degrees_of_freedom():
    part, bare, _, _, site = sagging()
    full = FullAbout(part, site)
    full.K = csr(bare.K)
    blow = (0.2, 1.5, 1e6, 5e-3)
    _, force, moved = full.impact(*blow, 160)
    model = ao.extract(part, site, n=30, stretch="auto")
    ball, law = ao.RigidMass(0.2, 1.5), ao.Power(1e6, 1.5)
    hit = ao.simulate(model, ball, law, 5e-3)
    linear = ao.simulate(replace(model, stretch=None), ball, law, 5e-3)
    assert abs(np.abs(linear.displacement).max() / moved.max() - 1) > 0.04
    stiffer = linear.peak_force < hit.peak_force  # further down it is pulled more
    assert ("stiffer" in linear.message, "softer" in linear.message) == (stiffer, not stiffer)
    behind = replace(site, direction=(0, 0, 1))
    back = ao.simulate(ao.extract(part, behind, n=30), ball, law, 5e-3)
    assert "softer" in back.message
    assert hit.peak_force == pytest.approx(force.max(), rel=0.01)
    assert np.abs(hit.displacement).max() == pytest.approx(moved.max(), rel=0.01)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("count", [False, 4])
def test_a_blow_on_a_sagging_sheet_pulls_it(count):
    """Membrane forces A (ε(u) + η(q, u) + η(u, u)/2) at Gauss points; their invariants."""
    part, bare, _, _, site = sagging()
    model = ao.extract(part, site, n=30, stretch=count)
    hit = ao.simulate(model, ao.RigidMass(0.05, 0.2), ao.Power(1e6, 1.5), 4e-3)
    when, points = 3e-3, points_of(bare.matrices)
    u, q = (points.slopes(one) for one in (hit.field(when), part.matrices.preload.q))
    own = points.weighted_stress(points.second(u, u)) / 2 * bool(count)
    own = own + points.stress(u)
    whole = (own + points.weighted_stress(points.second(q, u))) / points.weight[:, None]
    X, _ = compat.quadrature("triangle", RULE_DEGREES["triangle"])
    mesh = bare.matrices.mesh
    cells = np.repeat(np.arange(mesh.n_cells), len(X))
    x, _ = mesh.geometry.at(cells, np.tile(X, (mesh.n_cells, 1)))
    for k in (40, 200, 500):
        found = ao.probe(part, hit, tuple(x[k]), "section_forces", [when])[0][:3]
        alone = own[k] / points.weight[k]
        assert np.linalg.norm(whole[k] - alone) > 0.3 * np.linalg.norm(alone)
        trace, deviator = (f(whole[k]) for f in (sum_of, deviator_of))
        assert sum_of(found) == pytest.approx(trace, abs=0.01 * deviator)
        assert deviator_of(found) == pytest.approx(deviator, rel=0.01)


def sum_of(N):
    """N1 + N2, in all axes the same."""
    return N[0] + N[1]


def deviator_of(N):
    """The difference of the principal forces."""
    return np.hypot(N[0] - N[1], 2 * N[2])


def loaded(family, fine):
    """(mesh, arguments of a Structure, site) of a part under load."""
    if family == "solid":
        mesh = box((6 * fine, fine, fine), (0.3, 0.01, 0.01))
        spin = ao.Spin((0, 0, 1), 600.0, about=(-0.05, 0.005, 0.005))
        arguments = ao.Solid(210e9, 0.3, 7850.0), [ao.Support(at_root)], ao.Prestress(spin=spin)
        return mesh, arguments, ao.Site((0.15, 0.005, 0.01), (0, 0, -1), radius=5e-3)
    if family == "shell":
        mesh = grouped(sheet((2 * fine, 2 * fine), lambda s, t: (0.3 * s, 0.2 * t, 0 * s)))
        loads = ao.Prestress(pressure={"sheet": 1e4})

        def rim(x):
            return np.isclose(x[0] * (0.3 - x[0]), 0) | np.isclose(x[1] * (0.2 - x[1]), 0)

        arguments = ao.Shell(210e9, 0.3, 7850.0, 1e-3), [ao.Support(rim)], loads
        return mesh, arguments, ao.Site((0.15, 0.1, 0), (0, 0, -1), radius=1e-3)
    loads = ao.Prestress(tension={"all": 20 * np.pi**2 * EI})
    return beams(8 * fine), (THIN_BEAM, [PINNED], loads), ao.Site((0.25, 0, 0), (0, 0, -1))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("family", ["beam", "shell"])
def test_bars_of_loaded_parts_hold(family):
    found = []
    for fine in (1, 2):
        mesh, (material, held, loads), site = loaded(family, fine)
        part = ao.Structure(mesh, material, held, prestress=loads)
        model = ao.extract(part, site, n=40, error="estimate")
        blow = ao.RigidMass(0.05, 0.1), ao.Hertz(1e7), 3e-3
        found.append(ao.simulate(model, *blow))
    coarse, fine = found
    for name in ("peak_force", "impulse"):
        off = abs(getattr(coarse, name) / getattr(fine, name) - 1)
        assert off < coarse.error_budget[name].numerical
        assert fine.error_budget[name].mesh < 0.7 * coarse.error_budget[name].mesh


@pytest.mark.slow
def test_forms_of_loads_are_compiled_once_for_all_sizes():
    mesh, (material, held, _), _ = loaded("shell", 1)
    part = ao.Structure(mesh, material, held)
    signatures = set()
    for size in (1.0, 2.0):
        spin = ao.Spin((0, size, 1), 10 * size, about=(size, 0, 0))
        loads = ao.Prestress(pressure={"sheet": size}, spin=spin)
        signatures.add(LoadedPart(part.matrices, loads, {})._forces.signature())
    assert len(signatures) == 1


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_strike_refines_a_loaded_part():
    mesh, (material, held, loads), site = loaded("solid", 1)
    impact = site, ao.RigidMass(0.05, 0.1), ao.Hertz(1e7), 3e-3
    hit = ao.strike(mesh, *impact, tol=0.02, material=material, supports=held, prestress=loads)
    assert hit.structure.prestress.loads is loads
    fine, (material, held, loads), _ = loaded("solid", 3)
    known = ao.strike(ao.Structure(fine, material, held, prestress=loads), *impact, tol=0.02)
    assert hit.peak_force == pytest.approx(known.peak_force, rel=0.02)
    with refused(None, "its own material", ao.InputError):
        ao.strike(known.structure, *impact, tol=0.02, prestress=loads)


@pytest.mark.parametrize(
    ("loads", "word"),
    [
        ({"tension": {"hoop": 1.0}}, "hoop"),
        ({"tension": {"tip": 1.0}}, "tip"),
        ({"pressure": {"all": 1.0}}, "force="),
        ({"force": {"rim": (1.0, 0, 0)}}, "rim"),
    ],
)
def test_loads_that_do_not_fit_are_refused(loads, word):
    with refused(None, word, ao.InputError):
        tight(prestress=ao.Prestress(**loads))


RANKS = """
import numpy as np
import antiosc as ao
from parts import box
from sheets import at
groups = {"-x": (2, at(0, 0.0)), "+x": (2, at(0, 0.3)), "+z": (2, at(2, 0.01))}
mesh = box((12, 2, 2), (0.3, 0.02, 0.01), "tetrahedron", groups=groups)
spin = ao.Spin((0, 0, 1), 300.0, about=(-0.1, 0.01, 0.005))
loads = ao.Prestress(
    spin=spin, gravity=(0, 0, -9.81), pressure={"+z": 1e4}, force={"+x": (0, 0, 5.0)}
)
held = [ao.Support("-x")]
metal = ao.Solid(70e9, 0.3, 2700.0)
part = ao.Structure(mesh, metal, held, prestress=loads)
state = part.prestress
print(*part.natural_modes(3).omega, state.displacement[:, 2].min(), state.stress.values.max())
"""


@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    one = [np.array(row.split(), float) for row in run_ranks(1, RANKS)[0].splitlines()]
    for text in run_ranks(2, RANKS):
        two = [np.array(row.split(), float) for row in text.splitlines()]
        for a, b in zip(one, two, strict=True):
            assert b == pytest.approx(a, rel=1e-5)
