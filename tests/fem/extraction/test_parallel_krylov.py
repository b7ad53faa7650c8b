"""Two ranks give what one gives: Krylov models at several sites, bands, impact maps and files."""

from __future__ import annotations

import json

import meshio
import numpy as np
import pytest

from mpi import START, one_and_several, run_ranks

pytestmark = pytest.mark.mpi

MODELS = """
warnings.simplefilter("ignore")
block = parts.box((8, 4, 3))
frame = ao.read_mesh("meshes/frame.msh")
beam = ao.Beam(**parts.STEEL, section=ao.Section.rectangle(0.02, 0.03), orientation=(0.3, 1, 0.2))
solid = ao.Solid(**parts.STEEL)
on_block = [ao.Site((x, 0.021, 0.04), (0.1, 0.2, -1), radius=0.016) for x in (0.07, 0.15)]
on_frame = [ao.Site((0.43, 0.0, 1.3), (0.2, 1, -0.5)), ao.Site((0.0, 0.0, 0.33), (1, 0.3, 0))]
cases = {
    "block": (block, solid, [ao.Support("left")], on_block),
    "free block": (block, solid, [], on_block),
    "sliding block": (block, solid, [ao.Support("left", ("y", "z"))], on_block[:1]),
    "frame": (frame, beam, [ao.Support("feet")], on_frame),
    "free frame": (frame, beam, [], on_frame),
}
found = {}
for name, (mesh, material, supports, sites) in cases.items():
    structure = ao.Structure(mesh, material, supports)
    models = ao.extract(structure, sites, n=20)
    models += ao.extract(structure, sites, band=1.2 * models[0].omega[0], accuracy=1e-6)
    band = 1.2 * models[0].omega[0]
    at = np.linspace(0.05 * band, band, 40) * (1 + 0.01j)
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
    one, two = one_and_several(START + MODELS)
    assert len(one) == 5
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
        near = ao.probe(part, hit, (0.12, 0.0, 0.04), [5e-5, 1e-4], body="part")
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
