"""Several ranks: other arguments or errors of one of them, none with cells; what one rank finds."""

from __future__ import annotations

import json
import time

import meshio
import numpy as np
import pytest

import mpi
import parts
from mpi import START, one_and_several, run_ranks

pytestmark = pytest.mark.mpi


ALONE = """
from antiosc.fem import platform

comm = MPI.COMM_WORLD
mesh, solid = parts.box((4, 2, 2)), ao.Solid(**parts.STEEL)

class Odd(Exception):  # can neither be sent as it is nor made again
    def __init__(self, a, b):
        super().__init__(f"{a} {b}")
        self.function = lambda: None

class Here:
    def __init__(self, error):
        self._error = error
    def __call__(self, x):
        if comm.rank == 1:
            raise self._error
        return x[0] < 1e-9

@platform.collective()
def work(error):
    if comm.rank == 1:
        raise error
    return comm.rank

def warned():
    part = ao.Structure(mesh, solid, [ao.Support("left")])
    with warnings.catch_warnings(action="error"):
        ao.extract(part, ao.Site((0.1, 0.025, 0.04), (0, 0, -1)), n=3)

for call in (
    lambda: ao.Structure(mesh, solid, [ao.Support(Here(KeyError("one")))]),
    lambda: ao.Structure(mesh, solid, [ao.Support(Here(Odd("odd", "one")))]),
    lambda: work(ValueError("two")),
    lambda: work(Odd("odd", "two")),
    lambda: platform.on_root(comm, lambda: 1 / 0),
    warned,
):
    try:
        call()
        print("passed")
    except Exception as error:
        print(error)
print(comm.allreduce(1))
"""


def test_an_error_of_one_rank_is_that_of_all():
    printed = [text.splitlines() for text in run_ranks(2, START + ALONE)]
    said = ["one", "odd one", "two", "odd two", "division", "grows without limit", "2"]
    for lines in printed:
        for line, text in zip(lines, said, strict=True):
            assert text in line


TINY = """
warnings.simplefilter("ignore")
solid, shell = ao.Solid(**parts.STEEL), ao.Shell(**parts.STEEL, thickness=0.05)
start = lambda x: np.isclose(x[0], 0)
cases = {
    "block": (ao.read_mesh(sys.argv[3]), solid, (0.5, 0.5, 1.0), (0.1, 0.2, -1), 0.3, "clamp"),
    "shell": (ao.read_mesh(sys.argv[2], gdim=3), shell, (0.5, 0.5, 0), (1, 2, -9), 0.3, "clamp"),
}
found = {}
for name, (mesh, material, point, direction, radius, group) in cases.items():
    here = found[name] = {}
    site = ao.Site(point, direction, radius=radius)
    for label, supports in {
        "function": [ao.Support(start)], "group": [ao.Support(group)], "free": [],
    }.items():
        part = ao.Structure(mesh, material, supports)
        low = ao.extract(part, site, n=2, method="modes")
        krylov = ao.extract(part, site, n=2)
        natural = ao.superposition(part, site, 1, static_correction=True)
        here[label] = [part.dofs, part.mass, *part.dimensions, krylov.k0, krylov.m_st,
                       low.omega[0], low.m[0], krylov.omega[0], natural.omega[0], natural.r]
    grid = ao.impact_map(part, [point], direction=direction, radius=radius, n=2, modes=1)
    here["map"] = [grid.models.k0[0], grid.models.m_st[0]]
    whole = ao.impact_map(part, direction=direction, radius=radius, n=2, modes=1)
    here["surface"] = [len(whole.points), whole.models.m_st.sum()]
    hit = ao.simulate(krylov, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), duration=2e-4, step=1e-6)
    here["fields"] = [hit.peak_force, *ao.probe(part, hit, point, times=[1e-4])[0]]
    ao.write_series(part, hit, sys.argv[1], [0, 1e-4])
    loaded = ao.Structure(mesh, material, [ao.Support(start)], attached=[
        ao.PointMass(point, 0.5), ao.Spring(point, {"x": 1e5, "y": 1e5})])
    here["attached"] = [loaded.mass, ao.extract(loaded, site, n=2).k0]
    own = compat.cell_index_map(mesh.dolfinx).size_local
    here["cells"] = mesh.comm.allgather(int(own))
print(json.dumps(found))
"""


@pytest.mark.slow
def test_ranks_without_cells(tmp_path):
    """One cell on two ranks: the same numbers as on one."""
    kinds = "quadrilateral", "hexahedron"
    cubes = [str(parts.gmsh_cube(tmp_path / f"{kind}.msh", kind, n=1)) for kind in kinds]
    one, several = one_and_several(START + TINY, str(tmp_path / "series.pvd"), *cubes)
    assert len(one) == 2
    for name, serial in one.items():
        assert several[name].pop("cells").count(0) == 1
        serial.pop("cells")
        for key, expected in serial.items():
            scale = np.abs(expected).max()
            np.testing.assert_allclose(
                several[name][key], expected, rtol=1e-6, atol=1e-12 * scale, err_msg=f"{name} {key}"
            )


GIVEN = """
from petsc4py import PETSc

def shared(n, entries):
    comm = PETSc.COMM_WORLD
    own = n - n // 4 if comm.rank else n // 4  # of few masses the first rank has none
    A = PETSc.Mat().createAIJ(((own, n), (own, n)), nnz=3, comm=comm)
    for i in range(*A.getOwnershipRange()):
        for j in range(max(i - 1, 0), min(i + 2, n)):
            A[i, j] = entries(i, j, n)
    A.assemble()
    return A

def springs(i, j, n):
    return 1e4 * (-1.0 if i != j else float(i > 0) + float(i < n - 1))

found = {}
for n in (2, 3, 4, 9):
    chain = ao.Structure.from_matrices(shared(n, springs), shared(n, lambda i, j, n: float(i == j)))
    model = ao.extract(chain, ao.Site(dof=n - 1), n=n - 1, method="modes")
    found[n] = [model.k0, model.m_st, *model.omega]
print(json.dumps(found))
"""


def test_a_free_chain_of_which_one_rank_has_no_mass():
    """Its antiresonances are 2 √(k/m) sin((2j - 1)π/(4n - 2)), those of the chain pinned there."""
    printed = run_ranks(2, START + GIVEN)
    assert len(set(printed)) == 1
    for n, (k0, m_st, *omega) in json.loads(printed[0]).items():
        j = np.arange(1, int(n))
        exact = 200 * np.sin((2 * j - 1) * np.pi / (4 * int(n) - 2))
        np.testing.assert_allclose([k0, m_st], [0, int(n)], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(omega, exact, rtol=1e-9)


MODELS = """
from antiosc.base.errors import AntioscWarning

warnings.simplefilter("ignore", AntioscWarning)
solid = ao.Solid(**parts.STEEL)
plane = ao.Solid(**parts.ALUMINIUM, plane="stress", thickness=0.01)
beam = ao.Beam(**parts.STEEL, section=ao.Section.rectangle(0.02, 0.03), orientation=(0.3, 1, 0.2))
halves = {
    "left": (2, lambda x: np.isclose(x[0], 0)),
    "soft": (3, lambda x: x[0] <= 0.1 + 1e-9),
    "hard": (3, lambda x: x[0] >= 0.1 - 1e-9),
}
block = parts.box((8, 4, 3), groups=halves)
two = {"soft": ao.Solid(3e9, 0.4, 1200.0), "hard": solid}
patch = ao.Site((0.15, 0.021, 0.04), (0.1, 0.2, -1), radius=0.016)
lever = ao.read_mesh("meshes/lever.msh")
cube = ao.read_mesh(sys.argv[1])
frame = ao.read_mesh("meshes/frame.msh")
clamp, left = [ao.Support("clamp")], [ao.Support("left")]
cases = {
    "block of two materials, patch": (block, two, left, patch),
    "bent tetrahedra, patch": (cube, solid, clamp, ao.Site((1.05, 0.5, 0.6), (-1, 0.1, 0),
                                                           radius=0.45, snap=True)),
    "free lever, patch": (lever, plane, [], ao.Site((0.135, 0.0), (-1, 0), radius=0.005)),
    "free frame": (frame, beam, [], ao.Site((0.0, 0.0, 0.33), (1, 0.3, 0))),
}
found = {}
for name, (mesh, material, supports, site) in cases.items():
    structure = ao.Structure(mesh, material, supports)
    model = ao.extract(structure, site, n=4, method="modes")
    own = compat.cell_index_map(mesh.dolfinx).size_local
    found[name] = {
        "spread": bool(mesh.comm.allreduce(int(own > 0)) == mesh.comm.size),
        "dofs": structure.dofs, "mass": structure.mass, "k0": model.k0, "m0": model.m0,
        "rigid": structure.rigid_modes.shape[1],
        "m": model.m.tolist(), "omega": model.omega.tolist(),
        "local": model.local_compliance, "participation": model.participation.sum(),
    }
print(json.dumps(found))
"""


@pytest.mark.slow
def test_two_ranks_give_the_models_of_one(tmp_path):
    cube = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron", 2, bent=True, n=4)
    one, two = one_and_several(START + MODELS, str(cube))
    assert len(one) == 4
    for name, serial in one.items():
        ranks = two[name]
        if "frame" not in name:
            assert ranks["spread"], name
        for key in ("dofs", "rigid"):
            assert ranks[key] == serial[key], (name, key)
        for key in ("mass", "local"):
            assert ranks[key] == pytest.approx(serial[key], rel=1e-12), (name, key)
        for key in ("k0", "omega", "participation"):
            np.testing.assert_allclose(ranks[key], serial[key], rtol=1e-8, err_msg=f"{name} {key}")
        m_st = serial["m0"] + sum(serial["m"])
        np.testing.assert_allclose(
            ranks["m"], serial["m"], rtol=1e-8, atol=1e-10 * m_st, err_msg=name
        )
        assert ranks["m0"] == pytest.approx(serial["m0"], abs=1e-8 * m_st), name


FIELDS = """
structure = ao.Structure(parts.box((8, 4, 3), cell="tetrahedron"), ao.Solid(**parts.STEEL),
                         [ao.Support("left")])
site = ao.Site((0.15, 0.021, 0.04), (0.1, 0.2, -1), radius=0.02)
model = ao.extract(structure, site, n=8, method="modes")
hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), duration=1e-3, step=1e-5)
times = np.linspace(0, 1e-3, 4)
moved = ao.probe(structure, hit, (0.0731, 0.0312, 0.0207), times=times)
felt = [ao.probe(structure, hit, (0.0731, 0.0312, 0.0207), q, times).tolist()
        for q in ("acceleration", "stress", "rotation")]
felt.append(ao.strain_gauge(structure, hit, (0.1, 0.02, 0.02), (1, 0, 0), 0.05, times).tolist())
ao.write_series(structure, hit, sys.argv[1], times)
print(json.dumps([felt, moved.tolist(), hit.peak_force]))
"""


def test_two_ranks_give_the_fields_of_one(tmp_path):
    results = {}
    for n in (1, 2):
        (tmp_path / str(n)).mkdir()
        printed = run_ranks(n, START + FIELDS, str(tmp_path / str(n) / "series.pvd"))
        assert len(set(printed)) == 1
        felt, moved, peak = json.loads(printed[0])
        frames = [meshio.read(p) for p in sorted((tmp_path / str(n)).glob("*.vtu"))]
        last = frames[-1]
        u = last.point_data["displacement"]
        cells = np.vstack([b.data for b in last.cells])
        # points on the seam may come twice
        order = np.lexsort(last.points[cells].mean(axis=1).round(9).T)
        by_cell = u[cells].mean(axis=1)[order]
        results[n] = np.array(moved), peak, len(frames), by_cell, felt
    one, two = results[1], results[2]
    scale = np.abs(one[0]).max()
    np.testing.assert_allclose(two[0], one[0], atol=1e-8 * scale)
    assert two[1] == pytest.approx(one[1], rel=1e-8)
    assert two[2] == one[2] == 4
    np.testing.assert_allclose(two[3], one[3], atol=1e-8 * np.abs(one[3]).max())
    for a, b in zip(one[4], two[4], strict=True):
        np.testing.assert_allclose(b, a, atol=1e-6 * np.abs(a).max())


FREE = """
warnings.simplefilter("ignore")
guide = ao.Support(lambda x: np.isclose(x[2], 0.0), fix=("y", "z"))
rows = []
thrown, sliding = ao.Motion((0.3, 0.2, 0), (1, 2, 3)), ao.Motion((0.3, 0, 0))
for supports, start in (([], thrown), ([guide], sliding)):
    structure = ao.Structure(parts.box((8, 4, 3), cell="tetrahedron"), ao.Solid(**parts.STEEL),
                             supports)
    site = ao.Site((0.17, 0.04, 0.04), (0.2, -0.3, -1))
    for model in (ao.extract(structure, site, n=6, method="modes"),
                  ao.superposition(structure, site, 5, static_correction=True)):
        hit = ao.simulate(model, ao.RigidMass(0.5, 3.0), ao.Hertz(1e9), 2e-3, gap=1e-4,
                          gravity=(1, 2, -9), initial_velocity=start)
        moved = ao.probe(structure, hit, (0.1, 0.02, 0.03), times=[1e-3, 1.5e-3])
        rows.append([*hit.momentum[-1], *hit.angular_momentum[-1], *moved.ravel(),
                     hit.energy.kinetic[0], hit.peak_force])
print(json.dumps(rows))
"""


def test_two_ranks_give_the_free_motion_of_one():
    """Momentum, angular momentum and fields of falling, spinning, sliding bodies."""
    one, two = one_and_several(START + FREE)
    for a, b in zip(one, two, strict=True):
        for part in (slice(0, 3), slice(3, 6), slice(6, 12), slice(12, 13), slice(13, 14)):
            scale = np.abs(a[part]).max()
            np.testing.assert_allclose(b[part], a[part], atol=1e-6 * scale)


KRYLOV = """
warnings.simplefilter("ignore")
block = parts.box((8, 4, 3))
frame = ao.read_mesh("meshes/frame.msh")
beam = ao.Beam(**parts.STEEL, section=ao.Section.rectangle(0.02, 0.03), orientation=(0.3, 1, 0.2))
solid = ao.Solid(**parts.STEEL)
on_block = [ao.Site((x, 0.021, 0.04), (0.1, 0.2, -1), radius=0.016) for x in (0.07, 0.15)]
on_frame = [ao.Site((0.43, 0.0, 1.3), (0.2, 1, -0.5)), ao.Site((0.0, 0.0, 0.33), (1, 0.3, 0))]
cases = {
    "block": (block, solid, [ao.Support("left")], on_block),
    "sliding block": (block, solid, [ao.Support("left", ("y", "z"))], on_block[:1]),
    "free frame": (frame, beam, [], on_frame),
}
found = {}
for name, (mesh, material, supports, sites) in cases.items():
    structure = ao.Structure(mesh, material, supports)
    models = ao.extract(structure, sites, n=10)
    top = 1.2 * models[0].omega[0]
    models += ao.extract(structure, sites, band=top / (2 * np.pi), accuracy=2e-6)
    at = np.linspace(0.05 * top, top, 40) * (1 + 0.01j)
    found[name] = {
        "fixed": [[m.k0, m.m_st, m.n] for m in models],
        "Z": [np.abs(m.dynamic_stiffness(at)).tolist() for m in models],
        "low": [[m.omega[0], m.m[0]] for m in models],
    }
print(json.dumps(found))
"""


@pytest.mark.slow
def test_krylov_models():
    # Not compared: the upper Ritz pairs, which are no property of the structure and feel the
    # rounding of every solve.
    one, two = one_and_several(START + KRYLOV)
    assert len(one) == 3
    for name, serial in one.items():
        ranks = two[name]
        for key in ("fixed", "Z", "low"):
            np.testing.assert_allclose(ranks[key], serial[key], rtol=1e-8, err_msg=f"{name} {key}")


MAP = """
warnings.simplefilter("ignore")
size = (0.12, 0.08, 0.03)
groups = {"left": (2, lambda x: np.isclose(x[0], 0)), "top": (2, lambda x: np.isclose(x[2], 0.03))}
mesh = parts.box((6, 4, 2), size, "tetrahedron", groups=groups)
part = ao.Structure(mesh, ao.Solid(**parts.STEEL), [ao.Support("left")])
impact = ao.RigidMass(0.05, 1.0), ao.Hertz(1e9), 5e-4
found = ao.impact_map(part, "top", *impact, radius=0.02, n=8, modes=15)
found.write(sys.argv[1]) if mesh.comm.rank == 0 else None
print(json.dumps({
    "points": found.points.tolist(), "m": found.models.m.tolist(), "k0": found.models.k0.tolist(),
    "omega": found.models.omega.tolist(), "error": found.error.tolist(),
    "peak": found.peak_force.tolist(), "skipped": found.skipped,
}))
"""


def test_impact_map(tmp_path):
    results, files = [], []
    for n in (1, 2):
        path = tmp_path / f"map{n}.vtu"
        printed = run_ranks(n, START + MAP, str(path))
        assert len(set(printed)) == 1  # every rank holds the whole map
        results.append(json.loads(printed[0]))
        files.append(meshio.read(path))
    one, two = results
    assert one["skipped"] == two["skipped"]
    order = [np.lexsort(np.round(r["points"], 9).T) for r in results]
    for name in ("points", "k0", "omega", "m", "error", "peak"):
        a, b = (np.array(r[name])[o] for r, o in zip(results, order, strict=True))
        limit = 1e-8
        if name in ("omega", "m", "error"):
            # the upper anti-oscillators, and the bound with them, hang on the inertia of what the
            # modes leave out: a difference of two compliances, and its rounding
            limit = 1e-6
        np.testing.assert_allclose(b, a, rtol=limit, atol=limit * np.abs(a).max(), err_msg=name)
        if name in ("omega", "m"):
            lowest = a[:, :4], b[:, :4]
            np.testing.assert_allclose(*lowest, rtol=1e-8, atol=1e-8 * np.abs(a).max())
    assert len(files[0].cells[0].data) == len(files[1].cells[0].data)


SEVERAL = """
warnings.simplefilter("ignore")
mesh = parts.box((6, 3, 2))
names = {"a": 0.07, "b": 0.12, "c": 0.15}
sites = {n: ao.Site((x, 0.021, 0.04), (0.1, 0.2, -1), radius=0.03, tangential=n == "a")
         for n, x in names.items()}
sites["again"] = sites["b"]
found = {}
for name, supports in (
    ("held", [ao.Support("left")]),
    ("free", []),
    ("sliding", [ao.Support("left", ("y", "z"))]),
):
    part = ao.Structure(mesh, ao.Solid(**parts.STEEL), supports)
    for method in ("krylov", "modes") if name == "sliding" else ("krylov",):
        model = ao.extract(part, sites, n=12, method=method)
        at = np.linspace(0.05, 1.2, 40) * model.omega[0] * (1 + 0.01j)
        H = model.site_modes().receptance(at)
        scene = ao.Scene(
            {"part": model, "ball": ao.RigidMass(0.1, 1.0)},
            [ao.Contact("part:c", "ball", ao.Hertz(1e9))],
        )
        hit = scene.run(1e-4)
        force = hit["part:c", "ball"].force
        near = ao.probe(part, hit, (0.12, 0.0, 0.04), times=[5e-5, 1e-4], body="part")
        found[f"{name} {method}"] = {
            "fixed": [model.k0.tolist(), model.m_st.tolist()],
            "dependence": model.dependence.tolist(),
            "H": (np.abs(H) / np.abs(H).max()).tolist(),
            "omega": model.omega[:4].tolist(),
            "force": float(force.max()),
            "probe": (near / np.abs(near).max()).tolist(),
        }
print(json.dumps(found))
"""


@pytest.mark.slow
def test_several_sites():
    one, two = one_and_several(START + SEVERAL)
    assert len(one) == 4
    for name, serial in one.items():
        for key, value in serial.items():
            limit = 1e-6 if key in ("force", "probe") else 1e-8
            mine, size = two[name][key], np.abs(np.array(value, dtype=float)).max()
            np.testing.assert_allclose(mine, value, atol=limit * size, err_msg=f"{name} {key}")


# -- ranks that end: new ones start for the tests after these


def test_one_rank_that_raises_fails_all():
    script = """
        from mpi4py import MPI
        if MPI.COMM_WORLD.rank == 1:
            raise ValueError("only here")
        MPI.COMM_WORLD.barrier()
    """
    with pytest.raises(AssertionError, match=r"(?s)ended with code .*only here"):
        run_ranks(2, script)


HANG = """
from mpi4py import MPI
if MPI.COMM_WORLD.rank == 0:
    MPI.COMM_WORLD.recv(source=1)
"""


def test_a_hang_is_ended():
    start = time.monotonic()
    with pytest.raises(AssertionError, match="not done after 1 s"):
        run_ranks(2, HANG, timeout=1)
    assert time.monotonic() - start < 300


@pytest.mark.parametrize("hangs", [False, True], ids=["at the start", "in a script"])
def test_ranks_end_whose_test_was_killed(hangs, monkeypatch):
    monkeypatch.setattr(mpi, "SPARE", 1)
    ranks = mpi.Ranks(2)
    if hangs:
        ranks.run("", (), 60)
        with pytest.raises(AssertionError, match="not done"):
            ranks.run(HANG, (), 1)
    ranks.close()
    try:
        ranks.process.wait(60)
    finally:
        ranks.end()
