"""Solids with directions: an isotropic one in any axes, bars along and across, turned bodies."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.fem.elements.shell import GivenSheet

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore:the compliance under a point")]
E, NU, RHO = 70e9, 0.33, 2700.0
#: About a pine's, Pa.
WOOD = {"E": (12e9, 0.9e9, 0.5e9), "nu": (0.4, 0.42, 0.45), "G": (0.8e9, 0.75e9, 0.07e9)}


def turn(angle: float) -> np.ndarray:
    """Rotation about (1, 2, 3)."""
    n = np.array([1, 2, 3]) / np.sqrt(14)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


def k0(part: ao.Structure, point, direction=(0.3, 0.5, 0.8)) -> float:
    return ao.extract(part, ao.Site(point, direction), n=3).k0


@pytest.mark.slow
def test_an_isotropic_matrix_is_a_solid_in_any_axes():
    mesh = parts.box()
    plain = ao.Structure(mesh, ao.Solid(E, NU, RHO), ao.Support("left"))
    tip = mesh.dolfinx.geometry.x.max(axis=0)
    G = E / (2 * (1 + NU))
    made = ao.AnisotropicSolid.orthotropic((E,) * 3, (NU,) * 3, (G,) * 3, RHO, turn(0.7)[:2])
    np.testing.assert_allclose(made.voigt, ao.Solid(E, NU, RHO).voigt, atol=1e-4 * E * 1e-8)
    other = ao.Structure(mesh, made, ao.Support("left"))
    assert k0(other, tip) == pytest.approx(k0(plain, tip), rel=1e-9)
    assert other.mass == pytest.approx(plain.mass, rel=1e-12)


@pytest.mark.slow
def test_a_turned_body_of_a_turned_material_is_the_same(tmp_path):
    R = turn(1.1)
    deck = "*NODE\n"
    grid = [(x, y, z) for z in (0, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    stiff = {}
    for name, Q in {"straight": np.eye(3), "turned": R}.items():
        rows = "".join(
            f"{n + 1}," + ",".join(f"{c:.17g}" for c in Q @ p) + "\n" for n, p in enumerate(grid)
        )
        cells = "*ELEMENT,TYPE=C3D8,ELSET=ALL\n1,1,2,3,4,5,6,7,8\n2,5,6,7,8,9,10,11,12\n"
        path = tmp_path / f"{name}.inp"
        path.write_text(deck + rows + cells)
        foot = ao.Support(near=((Q @ [0.5, 0.5, 0]).tolist(), 0.75))
        material = ao.AnisotropicSolid.orthotropic(**WOOD, rho=500.0, axes=np.eye(3) @ Q.T)
        part = ao.Structure(ao.read_mesh(path), material, foot)
        stiff[name] = k0(part, Q @ [1, 1, 2], Q @ [0.3, 0.5, 0.8])
    assert stiff["turned"] == pytest.approx(stiff["straight"], rel=1e-9)


DECK = (
    "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,2\n6,1,0,2\n7,1,1,2\n8,0,1,2\n"
    "*ELEMENT,TYPE=C3D8,ELSET=ALL\n1,1,2,3,4,5,6,7,8\n"
    "*BOUNDARY\n1,1,3\n2,2,3\n3,3\n4,3\n*EQUATION\n2\n6,3,1.,5,3,-1.\n2\n7,3,1.,5,3,-1.\n"
    "2\n8,3,1.,5,3,-1.\n*DENSITY\n500.\n"
)


@pytest.mark.slow
@pytest.mark.parametrize("oriented", [False, True])
def test_a_deck_of_wood_is_as_stiff_as_the_modulus_along_it(tmp_path, oriented):
    """Upright, direction 3 carries; with an *ORIENTATION direction 1."""
    constants = "*ELASTIC,TYPE=ENGINEERING CONSTANTS\n12E9,.9E9,.5E9,.4,.42,.45,.8E9,.75E9\n.07E9\n"
    section = "*SOLID SECTION,ELSET=ALL,MATERIAL=W" + (",ORIENTATION=UP" if oriented else "")
    up = "*ORIENTATION,NAME=UP\n0,0,1,1,0,0\n"
    text = DECK.replace("*DENSITY", f"{up}{section}\n*MATERIAL,NAME=W\n{constants}*DENSITY")
    path = tmp_path / "wood.inp"
    path.write_text(text)
    part = ao.read_model(path)
    assert part.mass == pytest.approx(1000, rel=1e-12)
    stiff = k0(part, (0.2, 0.3, 2), (0, 0, 1))
    assert stiff == pytest.approx((12e9 if oriented else 0.5e9) / 2, rel=1e-8)


def test_waves_in_bars_run_at_the_speed_of_the_stiffest_direction():
    """√(E/ρ): of the fibres, of layers at any angle, of an isotropic sheet."""
    wood = ao.AnisotropicSolid.orthotropic(**WOOD, rho=500.0, axes=np.roll(np.eye(3), 1, 1))
    assert wood.bar_speed() == pytest.approx(np.sqrt(12e9 / 500.0), rel=1e-12)
    shear = {"G12": 5e9, "G13": 5e9, "G23": 3e9}
    ply = ao.Layer(E1=140e9, E2=10e9, nu12=0.3, **shear, rho=1600.0, thickness=1e-3)
    for layers in ([ply], [ply, ply.rotated(90)]):
        speed = ao.Laminate(layers, axis=(1, 0, 0)).bar_speed()
        assert speed == pytest.approx(np.sqrt(140e9 / 1600.0), rel=1e-12)
    plane = np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]]) * E / (1 - NU**2)
    t = 2e-3
    sheet = GivenSheet(t * plane, t**3 / 12 * plane, 1e7 * np.eye(2), RHO * t, RHO * t**3 / 12, t)
    assert sheet.bar_speed() == pytest.approx(np.sqrt(E / RHO), rel=1e-12)
