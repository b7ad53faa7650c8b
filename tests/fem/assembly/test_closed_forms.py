"""A plate on posts, every joint at once, and the page's example, against other ways to the same."""

from __future__ import annotations

import re
import runpy

import numpy as np
import pytest
import scipy.linalg

import antiosc as ao
import every_joint
from antiosc.closed_form.plates import SupportedPlate
from assemblies import box, line
from paths import ROOT

pytestmark = [
    pytest.mark.filterwarnings("ignore:the joints leave parts free"),
    pytest.mark.filterwarnings("ignore:the facets at the site"),
]

A, B, T = 0.5, 0.4, 2e-3
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
NYLON = {"E": 3e9, "nu": 0.35, "rho": 1150.0}
POSTS = [(0.125, 0.1), (0.375, 0.1), (0.125, 0.3), (0.375, 0.3)]
STRUCK = (0.25, 0.15)
LENGTH, WIDE = 0.1, 1e-3


def exact(omega: np.ndarray) -> np.ndarray:
    """Receptance at the site, with the posts' E A (ω/c) cot(ωL/c) at four points of the plate."""
    plate = SupportedPlate(**STEEL, thickness=T, a=A, b=B)
    m = np.arange(1, 240)
    frequencies = plate.mindlin(m[:, None], m).ravel()
    x, y = np.array([STRUCK, *POSTS]).T
    shapes = [np.outer(np.sin(m * np.pi * a / A), np.sin(m * np.pi * b / B)).ravel()
              for a, b in zip(x, y, strict=True)]  # fmt: skip
    phi = 2 / np.sqrt(plate.surface_density * A * B) * np.array(shapes)
    area, wave = np.pi / 4 * WIDE**2, np.sqrt(NYLON["E"] / NYLON["rho"])
    found = []
    for w in omega:
        h = (phi / (frequencies**2 - w**2)) @ phi.T
        post = NYLON["E"] * area * (w / wave) / np.tan(w * LENGTH / wave)
        coupled = h[1:, 1:] + np.eye(4) / post
        found.append(h[0, 0] - h[0, 1:] @ np.linalg.solve(coupled, h[1:, 0]))
    return np.array(found)


@pytest.mark.slow
def test_a_plate_on_four_posts():
    """Supported edges, four rods that stand on the ground: below, at and above the first modes."""
    sides = [ao.Support("x0", ("x", "y", "z", "rx")), ao.Support("x1", ("x", "z", "rx"))]
    sides += [ao.Support("y0", ("y", "z", "ry")), ao.Support("y1", ("z", "ry"))]
    sheet = ao.Structure(box((0, 0), (A, B), (16, 16), "quadrilateral"), ao.Shell(**STEEL,
                         thickness=T), sides)  # fmt: skip
    rod = ao.Beam(**NYLON, section=ao.Section.circle(WIDE))
    post = ao.Structure(line((0, 0, -LENGTH), (0, 0, 0), 4), rod, [ao.Support("start")])
    names = [f"post {k}" for k in range(4)]
    whole = ao.assemble(
        {"sheet": sheet, **dict.fromkeys(names, post)},
        [ao.Ball(("sheet", (*xy, 0.0)), f"{name}:end")
         for name, xy in zip(names, POSTS, strict=True)],
        {name: (*xy, 0.0) for name, xy in zip(names, POSTS, strict=True)},
    )  # fmt: skip
    model = ao.extract(whole, ao.Site((*STRUCK, 0.0), (0, 0, -1), part="sheet"), n=40)
    omega = np.array([50.0, 300.0, 520.0, 700.0, 1100.0, 1600.0, 2300.0])
    reference = exact(omega)
    found = model.modal().receptance(omega).real
    # the mesh leaves a share of the compliance under the load itself
    np.testing.assert_allclose(found, reference, rtol=5e-3, atol=3e-3 * reference[0])
    # without the posts it is another plate
    bare = ao.extract(sheet, ao.Site((*STRUCK, 0.0), (0, 0, -1)), n=40).modal()
    assert np.abs(bare.receptance(omega).real / reference - 1).max() > 0.5
    first = model.modal().omega[0]
    around = exact(np.array([0.995 * first, 1.005 * first]))
    assert around[0] > 0 > around[1]  # the first natural frequency lies between


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*.Bolt. spans")
def test_every_joint_against_dense_matrices():
    """Tie, Rigid, Mean, Weld, Hinge, Ball, Slider, Bolt, Bushing, Equation, superelement, mass."""
    part = every_joint.assembly()
    K, M, b = every_joint.dense(every_joint.parts())
    assert part.dofs == len(K)
    model = ao.extract(part, every_joint.SITE, n=40)
    for omega in np.array([0.0, 0.3, 0.77, 1.4, 2.5]) * model.omega[0]:
        exact = 1 / (b @ scipy.linalg.solve(K - omega**2 * M, b))
        assert model.dynamic_stiffness(omega).real == pytest.approx(exact, rel=1e-9)


PAGE = (ROOT / "docs" / "assemblies.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_example_runs(tmp_path, capsys):
    program = "\n".join(re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL))
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    names = runpy.run_path(str(tmp_path / "program.py"))
    assert "peak force" in capsys.readouterr().out
    part, hit = names["both"], names["hit"]
    screws = 4 * 7850.0 * np.pi * 3e-3**2 * 6e-3
    assert part.mass == pytest.approx(2700.0 * 0.2 * 0.1 * 0.025 + screws, rel=1e-9)
    ball = 7850.0 * 4 / 3 * np.pi * 0.01**3
    assert hit.impulse == pytest.approx(ball * (1.0 - hit.impactor_velocity[-1]), rel=1e-6)
