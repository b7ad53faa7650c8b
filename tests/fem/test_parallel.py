"""Two ranks give the models and fields of one; the helper that runs them."""

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
    "free block, patch": (block, solid, [], patch),
    "hinged block, point": (block, solid, [ao.Support("left", ("x", "z"))],
                            ao.Site((0.2, 0.05, 0.04), (0, 0, -1))),
    "bent tetrahedra, patch": (cube, solid, clamp, ao.Site((1.05, 0.5, 0.6), (-1, 0.1, 0),
                                                           radius=0.45, snap=True)),
    "free lever, patch": (lever, plane, [], ao.Site((0.135, 0.0), (-1, 0), radius=0.005)),
    "free frame": (frame, beam, [], ao.Site((0.0, 0.0, 0.33), (1, 0.3, 0))),
    "frame on pins": (frame, beam, [ao.Support(lambda x: x[2] < 1e-9, ("x", "y", "z"))],
                      ao.Site((0.0, 0.0, 1.3), (1, 0.3, 0))),
}
found = {}
for name, (mesh, material, supports, site) in cases.items():
    structure = ao.Structure(mesh, material, supports)
    model = ao.extract(structure, site, n=8, method="modes")
    own = compat.cell_map(mesh.dolfinx).size_local
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
    assert len(one) == 7
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
moved = ao.probe(structure, hit, (0.0731, 0.0312, 0.0207), times)
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
        moved = ao.probe(structure, hit, (0.1, 0.02, 0.03), [1e-3, 1.5e-3])
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
    with pytest.raises(AssertionError, match="not done after 3 s"):
        run_ranks(2, HANG, timeout=3)
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
