"""The estimate on two ranks is that of one."""

from __future__ import annotations

import numpy as np
import pytest

from mpi import one_and_several

pytestmark = pytest.mark.mpi

SCRIPT = """
    import json, warnings, numpy as np
    import antiosc as ao
    from antiosc.fem.error.model_errors import estimator
    from mpi4py import MPI
    from parts import STEEL, box, plate
    from sheets import sheet
    warnings.simplefilter("ignore")
    solid = ao.Solid(**STEEL)
    plane = ao.Solid(**STEEL, plane="stress", thickness=0.01)
    found = []
    for order in (1, 2):
        for mesh, material, site in (
            (box((6, 3, 2), (0.12, 0.06, 0.04), "tetrahedron"), solid,
             ao.Site((0.08, 0.03, 0.04), (0, 0, -1), radius=0.015)),
            (box((6, 3, 2), (0.12, 0.06, 0.04)), solid,
             ao.Site((0.08, 0.03, 0.04), (0, 0, -1), radius=0.015)),
            (plate((8, 4)), plane, ao.Site((0.15, 0.06), (0, -1), radius=0.02)),
        ):
            part = ao.Structure(mesh, material, [ao.Support("left")], order=order)
            model = ao.extract(part, site, n=4, error="estimate")
            cells = estimator(part).of_cells(model.shapes).sum()
            patch = model.info["patch"]
            found.append([
                *np.linalg.norm(model.strain_error, axis=0).tolist(),
                part.comm.allreduce(float(cells)),
                patch["faces"], patch.get("compliance", 0.0),
            ])
    def polar(s, t):
        return (1 + s) * np.cos(np.pi / 2 * t), (1 + s) * np.sin(np.pi / 2 * t)
    low = ao.Support(plane=((0, 0), (0, 1)))
    part = ao.Structure(sheet((2, 9), polar, "triangle"), plane, [low], order=1)
    top = ao.Site((2**0.5, 2**0.5), (-1, -1), radius=0.2, snap=True)
    model = ao.extract(part, top, n=3, error="estimate")
    facts = model.info["geometry"]
    found.append([*np.abs(facts["stiffness"]).tolist(), facts["mass"]])
    print(json.dumps(found))
"""


def test_two_ranks_find_what_one_finds():
    one, two = one_and_several(SCRIPT)
    for some, whole in zip(two, one, strict=True):
        np.testing.assert_allclose(some, whole, rtol=1e-6)
