"""The bar of a force on a soft layer, against a punch on a bonded layer by Hankel's transform."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import j1

import antiosc as ao
from antiosc_studies.drops.layer_error import Imprint, edge_share, imprint_of


def stiffness(thickness: float) -> float:
    """Stiffness of a rigid punch of radius 1 on a bonded layer without lateral strain (nu = 0),
    over that of an elastic foundation.

    The pressure is a sum of discs whose mean displacements are equal; Johnson 1985, 5.8 has the
    transform of the layer.
    """
    xi = np.linspace(1e-4, 400, 100_001)
    x = np.minimum(xi * thickness, 300)
    layer = (6 * np.sinh(2 * x) - 4 * x) / (6 * np.cosh(2 * x) + 10 + 4 * x * x)
    r = np.sin(np.linspace(0, np.pi / 2, 25)[1:])
    J = j1(np.outer(r, xi))
    compliance = 4 * np.pi * np.outer(r, r) * ((J * layer / xi**2) @ J.T) * (xi[1] - xi[0])
    area = np.pi * r * r
    return float(area @ np.linalg.solve(compliance, area) * thickness / np.pi)


@pytest.mark.parametrize("thickness", [0.1, 0.3, 1.0, 3.0, 10.0])
def test_the_layer_beside_a_punch_helps_no_more_than_the_bar_holds(thickness: float) -> None:
    share = edge_share(Imprint(0.0, np.pi, 2 * np.pi, 1.0), thickness)
    known = stiffness(thickness) - 1
    assert 0 < known < share < 2 * known


@pytest.mark.fem
@pytest.mark.parametrize(("tilt", "exponent"), [((0, 0, 0), 1), ((20, 0, 0), 2), ((20, 15, 0), 3)])
def test_faces_edges_and_corners_leave_their_imprints(
    tilt: tuple[float, float, float], exponent: int
) -> None:
    a, b = 0.1, 0.06
    part = ao.Structure(ao.box_mesh((a, b, 0.02), size=0.02), ao.material("steel S235"))
    soft = ao.SoftLayer(0.02, 15e6, range=(10e6, 20e6))
    fall = ao.drop(part, 0.1, tilt, ao.Floor(layer=soft), until=1, modes=3)
    imprint = imprint_of(fall.episodes[0])
    assert imprint.exponent == pytest.approx(exponent, rel=0.01)
    if exponent == 1:
        assert imprint.area == pytest.approx(a * b, rel=1e-3)
        assert imprint.perimeter == pytest.approx(2 * (a + b), rel=1e-3)
    of_range = (15 / 10) ** (1 / (exponent + 1)) - 1
    assert fall.law_error is not None
    assert fall.law_error > 1 - 1 / (1 + of_range)
    assert fall.no_bar() == ""


@pytest.mark.fem
@pytest.mark.filterwarnings("ignore")
def test_a_layer_that_is_pressed_to_its_ground_has_no_bar_and_a_remedy() -> None:
    part = ao.Structure(ao.box_mesh((0.1, 0.06, 0.02), size=0.02), ao.material("steel S235"))
    thin = ao.Floor(layer=ao.SoftLayer(1e-3, 1e5))
    fall = ao.drop(part, 0.5, (20, 15, 0), thin, until=1, modes=3)
    assert fall.law_error is None
    assert "thicker or a stiffer" in fall.no_bar()


def test_a_range_lies_about_its_modulus() -> None:
    with pytest.raises(ao.InputError, match="about E"):
        ao.SoftLayer(0.01, 1e6, range=(2e6, 3e6))
