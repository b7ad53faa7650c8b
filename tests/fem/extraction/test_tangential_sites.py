"""Sites that know their displacements across the direction of impact, as friction needs them."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from marks import FREE_ON_PURPOSE
from parts import STEEL, box
from several import CORNERS, block_with_corners

pytestmark = FREE_ON_PURPOSE


@pytest.fixture(scope="module")
def block() -> ao.Structure:
    return block_with_corners()


def _slanted(**options: object) -> ao.Site:
    return ao.Site((0.11, 0.02, 0.04), (0.1, 0.2, -1), radius=0.03, **options)


def test_a_site_may_know_its_tangential_displacements(block):
    model = ao.extract(block, {"near": _slanted(tangential=True), "far": CORNERS["far"]}, 10)
    assert model.sites == ("near", "far")
    assert model.columns == {"near": (0, 1, 2), "far": (3,)}
    assert model.k0.shape == (4, 4)
    three = model.direction[:3]
    np.testing.assert_allclose(three @ three.T, np.eye(3), atol=1e-12)
    alone = ao.extract(block, _slanted(), 10)
    at_rest = model.site_modes().receptance(0.0).real
    assert at_rest[0, 0] == pytest.approx(1 / alone.k0, rel=1e-9)
    assert np.linalg.eigvalsh(at_rest)[0] > 0
    # where the plane of the site is turned, the displacement in space is the same one
    turned = ao.extract(block, {"near": ao.Site((0.11, 0.02, 0.04), (0, 0, -1), radius=0.03,
                                                tangential=True)}, 10)  # fmt: skip
    R = three @ turned.direction.T
    other = R @ turned.site_modes().receptance(0.0).real @ R.T
    np.testing.assert_allclose(other, at_rest[:3, :3], atol=1e-9 * at_rest.max())


def test_tangential_directions_that_supports_hold():
    rails = ao.Support(lambda x: np.isclose(x[2], 0), ["x", "y", "z"])
    wall = ao.Support(lambda x: np.isclose(x[2], 0.04), ["y"])
    block = ao.Structure(box((6, 3, 2)), ao.Solid(**STEEL), [rails, wall])
    site = ao.Site((0.1, 0.025, 0.04), (0, 0, -1), radius=0.025, tangential=True)
    model = ao.extract(block, {"top": site}, 6)
    along_y = np.abs(model.direction[:, 1]) > 0.5
    np.testing.assert_array_equal(model.dependence[along_y], 0.0)
    assert model.k0.shape == (2, 2)
    np.testing.assert_array_equal(model.site_modes().b[:, along_y], 0.0)


@pytest.mark.sample
@pytest.mark.parametrize(("mu", "slides"), [(0.05, True), (5.0, False)])
def test_an_oblique_blow_rubs(mu, slides):
    """A free block thrown askew on the floor: its momentum is what the contact's forces give."""
    free = ao.Structure(box((6, 3, 2)), ao.Solid(**STEEL))
    foot = ao.Site((0.1, 0.025, 0.0), (0, 0, 1), radius=0.025, tangential=True)
    model = ao.extract(free, {"foot": foot}, 12)
    scene = ao.Scene(
        {"block": model, "floor": ao.Obstacle()},
        [ao.Contact("block:foot", "floor", ao.Hertz(1e9), gap=1e-5, friction=mu)],
        motion={"block": ao.Motion(velocity=(1.0, 0.0, -0.5))},
    )
    hit = scene.run(2e-3)
    contact, momentum = hit["block:foot", "floor"], hit.bodies["block"].momentum
    change = momentum[-1] - momentum[0]
    assert contact.impulse > 0.5 * free.mass
    np.testing.assert_allclose(change[2], contact.impulse, rtol=1e-9)
    if slides:
        np.testing.assert_allclose(change[0], -mu * contact.impulse, rtol=0.02)
    else:
        assert abs(change[0]) < 0.5 * mu * contact.impulse
    assert hit.energy.drift < 2e-3


def test_tangential_directions_belong_to_named_sites(block):
    with pytest.raises(ao.InputError, match="belong to a model of named sites"):
        ao.extract(block, _slanted(tangential=True))
    with pytest.raises(ao.InputError, match="need a Site with a direction"):
        ao.Site(dof=3, tangential=True)
    model = ao.extract(block, {"near": _slanted()}, 4)
    contact = ao.Contact("part:near", "floor", ao.Hertz(1e9), friction=0.1)
    scene = ao.Scene({"part": model, "floor": ao.Obstacle()}, [contact])
    with pytest.raises(ao.InputError, match="tangential=True"):
        scene.run(1e-4)


@pytest.mark.slow
def test_tangential_directions_of_an_assembly():
    top = {"top": (2, lambda x: np.isclose(x[2], 0.05)), "foot": (2, lambda x: np.isclose(x[2], 0))}
    under = {"under": (2, lambda x: np.isclose(x[2], 0))}
    plate = ao.Structure(box((4, 3, 1), (0.2, 0.1, 0.01), groups=under), ao.Solid(**STEEL))
    post = ao.Structure(
        box((2, 2, 2), (0.02, 0.02, 0.05), groups=top), ao.Solid(**STEEL), [ao.Support("foot")]
    )
    both = ao.assemble(
        {"plate": plate, "post": post},
        joints=[ao.Tie("post:top", "plate:under")],
        at={"plate": (0, 0, 0.05)},
    )
    site = ao.Site((0.15, 0.05, 0.06), (0, 0.6, -0.8), radius=0.043, tangential=True)
    model = ao.extract(both, {"far": site}, 8)
    np.testing.assert_allclose(model.direction @ model.direction.T, np.eye(3), atol=1e-12)
    # the displacement in space is the same whatever directions it is taken along
    across = ao.Site((0.15, 0.05, 0.06), (0, 0, -1), radius=0.043, tangential=True)
    other = ao.extract(both, {"far": across}, 8)
    R = model.direction @ other.direction.T
    at_rest = R @ other.site_modes().receptance(0.0).real @ R.T
    found = model.site_modes().receptance(0.0).real
    np.testing.assert_allclose(found, at_rest, atol=1e-9 * np.abs(at_rest).max())


def test_a_plane_part_has_one_tangential_direction():
    plate = ao.Structure(
        box((8, 3), (0.2, 0.05), "quadrilateral"),
        ao.Solid(**STEEL, plane="stress", thickness=0.01),
        [ao.Support("left")],
    )
    site = ao.Site((0.15, 0.05), (0, -1), radius=0.03, tangential=True)
    model = ao.extract(plate, {"top": site}, 6)
    np.testing.assert_allclose(model.direction, [[0, -1, 0], [1, 0, 0]], atol=1e-15)
