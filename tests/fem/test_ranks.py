"""Several ranks: other arguments on one of them, errors of one of them, ranks without cells."""

from __future__ import annotations

import json

import numpy as np
import pytest

import parts
from mpi import START, one_and_several, run_ranks

pytestmark = pytest.mark.mpi

DIFFERENT = """
rank, folder = MPI.COMM_WORLD.rank, sys.argv[1]
solid, left = ao.Solid(**parts.STEEL), [ao.Support("left")]
mesh = parts.box((4, 2, 2))
part = ao.Structure(mesh, solid, left)
other = ao.Structure(mesh, solid, left)
site = ao.Site((0.1, 0.025, 0.04), (0, 0, -1), radius=0.04)
warnings.simplefilter("ignore")
model = ao.extract(part, site, n=4)
hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), duration=2e-4)
faster = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), duration=(2 + rank) * 1e-4)
limit = 0.01 * (1 + rank)
vector = (1.0 + rank) * np.ones(part.K.getSize()[0])

def one(x):
    if rank == 1:
        raise KeyError("here alone")
    return x[0] < 1e-9

calls = {
    "n": lambda: ao.extract(part, site, n=4 + rank),
    "tol": lambda: ao.extract(part, site, n=4, tol=1e-8 * (1 + rank)),
    "site": lambda: ao.extract(part, ao.Site((0.1 + rank * 0.05, 0.025, 0.04), (0, 0, -1)), n=4),
    "site, vector": lambda: ao.extract(part, ao.Site(vector=vector), n=4),
    "structure": lambda: ao.extract([part, other][rank % 2], site, n=4),
    "structure, none": lambda: ao.extract(part if rank else None, site, n=4),
    "material": lambda: ao.Structure(mesh, ao.Solid(1e9 * (1 + rank), 0.3, 1.0), left),
    "supports": lambda: ao.Structure(mesh, solid, [ao.Support(lambda x: x[0] <= limit)]),
    "order": lambda: ao.Structure(mesh, solid, left, order=1 + rank % 2),
    "source": lambda: ao.read_mesh(f"{folder}/{rank}.msh"),
    "where": lambda: ao.impact_map(part, ["left", "right"][rank % 2]),
    "point": lambda: ao.probe(part, hit, (0.1 + 0.01 * rank, 0.02, 0.02)),
    "history": lambda: ao.probe(part, faster, (0.1, 0.02, 0.02)),
    "path": lambda: ao.write_series(part, hit, f"{folder}/{rank}.pvd"),
    "static_correction": lambda: ao.superposition(part, site, 3, static_correction=rank == 0),
    "a call": lambda: ao.full(part, site) if rank else ao.superposition(part, site, 3),
    "too few": lambda: ao.extract(part, site) if rank else ao.extract(part),
}
for name, call in calls.items():
    try:
        call()
        print(name, "| passed")
    except Exception as error:  # and the ranks go on together
        print(name, "|", type(error).__name__, "|", error)
print(ao.extract(part, site, n=4).n)
"""


def test_other_arguments_are_refused_by_all_ranks(tmp_path):
    printed = [text.splitlines() for text in run_ranks(3, START + DIFFERENT, str(tmp_path))]
    assert all(lines == printed[0] for lines in printed)
    assert printed[0][-1] == "4"
    assert len(printed[0]) == 18
    for line in printed[0][:-1]:
        name, kind, text = line.split(" | ")
        assert kind == "InputError", line
        if name == "a call":
            assert "superposition where rank 1 calls full" in text
        else:
            named = {"too few": "site", "structure, none": "structure"}.get(name, name)
            assert "needs the same arguments on every MPI rank" in text, line
            assert f"; {named.split(',')[0]} differs: " in text, line
    assert not list(tmp_path.iterdir())


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
    with warnings.catch_warnings():
        warnings.simplefilter("error")
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
beam = ao.Beam(**parts.STEEL, section=ao.Section.rectangle(0.02, 0.03))
solid, shell = ao.Solid(**parts.STEEL), ao.Shell(**parts.STEEL, thickness=0.05)
plane = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
start = lambda x: np.isclose(x[0], 0)
cases = {
    "line": (parts.line(1.0, 1), beam, (1.0, 0.0), (0.2, -1.0), None, "left"),
    "rectangle": (ao.read_mesh(sys.argv[2]), plane, (1.0, 0.5), (-1, 0.1), 0.3, "clamp"),
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
    here["fields"] = [hit.peak_force, *ao.probe(part, hit, point, [1e-4])[0]]
    ao.write_series(part, hit, sys.argv[1], [0, 1e-4])
    loaded = ao.Structure(mesh, material, [ao.Support(start)], attached=[
        ao.PointMass(point, 0.5), ao.Spring(point, {"x": 1e5, "y": 1e5})])
    here["attached"] = [loaded.mass, ao.extract(loaded, site, n=2).k0]
    own = compat.cell_map(mesh.dolfinx).size_local
    here["cells"] = mesh.comm.allgather(int(own))
print(json.dumps(found))
"""


@pytest.mark.slow
def test_ranks_without_cells(tmp_path):
    """One cell on two ranks: the same numbers as on one."""
    kinds = "quadrilateral", "hexahedron"
    cubes = [str(parts.gmsh_cube(tmp_path / f"{kind}.msh", kind, n=1)) for kind in kinds]
    one, several = one_and_several(START + TINY, str(tmp_path / "series.pvd"), *cubes)
    assert len(one) == 4
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
    A = PETSc.Mat().createAIJ(((PETSc.DECIDE, n), (PETSc.DECIDE, n)), nnz=3, comm=comm)
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


def test_a_free_chain_of_fewer_masses_than_ranks():
    """Its antiresonances are 2 √(k/m) sin((2j - 1)π/(4n - 2)), those of the chain pinned there."""
    printed = run_ranks(3, START + GIVEN)
    assert len(set(printed)) == 1
    for n, (k0, m_st, *omega) in json.loads(printed[0]).items():
        j = np.arange(1, int(n))
        exact = 200 * np.sin((2 * j - 1) * np.pi / (4 * int(n) - 2))
        np.testing.assert_allclose([k0, m_st], [0, int(n)], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(omega, exact, rtol=1e-9)
