"""Models of nearby structures against extractions of the same structures."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import scipy.sparse

import antiosc as ao

SITE = ao.Site(dof=3)
#: A plate of 0.3 m by 0.2 m.
HALVES = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.15, 0.2};
Rectangle(2) = {0.15, 0, 0, 0.15, 0.2};
BooleanFragments{Surface{1}; Delete;}{Surface{2}; Delete;}
Physical Surface("left") = {1};
Physical Surface("right") = {2};
"""
RANGES = {"soft": (0.8, 1.2), "heavy": (0.7, 1.3)}


def chain(soft: float, heavy: float, supported: bool = True, size: int = 30) -> ao.Structure:
    """Springs and masses in a row; those of one half depend on the parameters."""
    half = np.arange(size) < size // 2
    k, m = np.where(half, 1e6 * soft**3, 1e6), np.where(half, 0.1, 0.1 * heavy)
    k[0] *= supported
    K = np.diag(k + np.append(k[1:], 0.0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    return ao.Structure.from_matrices(
        scipy.sparse.csr_matrix(K), scipy.sparse.diags(m).tocsr(), backend="scipy"
    )


def free(soft: float, heavy: float) -> ao.Structure:
    return chain(soft, heavy, supported=False)


def peak(model: ao.AntiOscillators) -> float:
    """The force of the first touch, which later ones do not exceed."""
    hit = ao.simulate(model, ao.RigidMass(0.01, 1.0), ao.Hertz(1e9), 2e-4, tol=1e-5)
    return hit.peak_force


@pytest.mark.sample(case=1)
@pytest.mark.parametrize("build", [chain, free])
def test_models_between_extractions_are_those_of_extractions(build):
    models = ao.nearby(build, SITE, RANGES, n=6, tol=1e-4)
    assert models.error <= 1e-4
    made = models.extractions
    rng = np.random.default_rng(3)
    for _ in range(2):
        given = {name: rng.uniform(*range_) for name, range_ in RANGES.items()}
        true, found = ao.extract(build(**given), SITE, n=6), models(**given)
        assert found.m_st == pytest.approx(true.m_st, rel=1e-4)
        assert found.k0 == pytest.approx(true.k0, rel=1e-4)
        assert peak(found) == pytest.approx(peak(true), rel=3e-4)
    assert models.extractions == made
    outside = {"soft": 1.5, "heavy": 1.0}
    assert models(**outside).m_st == pytest.approx(ao.extract(build(**outside), SITE, n=6).m_st)
    assert models.extractions == made + 1


def test_models_go_to_processes_and_are_drawn_from():
    models = ao.nearby(chain, SITE, {"soft": ao.normal(1.0, 0.03), "heavy": (0.8, 1.2)}, n=4)
    again = pickle.loads(pickle.dumps(models))
    assert np.array_equal(again(soft=1.01, heavy=0.9).omega, models(soft=1.01, heavy=0.9).omega)

    def run(soft, heavy):
        return models(soft=soft, heavy=heavy), ao.RigidMass(0.2, 1.0), ao.Hertz(1e8), 0.02

    inputs = {"soft": ao.normal(1.0, 0.02), "heavy": ao.uniform(0.8, 1.2)}
    many = ao.monte_carlo(run, inputs, 20)
    assert not many.failed
    assert str(models.extractions) in repr(models)


def test_an_error_that_is_too_large_is_refused():
    """The degree of the polynomials ends before that of this stiffness."""

    def steep(soft):
        return chain(float(np.exp(6 * soft)), 1.0)

    with pytest.raises(ao.AccuracyError, match="narrower"):
        ao.nearby(steep, SITE, {"soft": (-1.0, 1.0)}, n=4, tol=1e-3)


@pytest.mark.parametrize(
    ("build", "ranges"),
    [
        (chain, {}),
        (chain, {"soft": (1.0, 1.0), "heavy": (0.8, 1.2)}),
        (chain, {"soft": 1.0, "heavy": (0.8, 1.2)}),
        (lambda size: chain(1.0, 1.0, size=int(size)), {"size": (20, 30)}),
        (lambda soft: soft, {"soft": (1.0, 2.0)}),
    ],
)
def test_what_is_no_family_is_refused(build, ranges):
    with pytest.raises(ao.InputError):
        ao.nearby(build, SITE, ranges)


def test_parameters_have_their_names():
    models = ao.nearby(chain, SITE, RANGES, n=4)
    with pytest.raises(ao.InputError, match="heavy"):
        models(soft=1.0)


@pytest.mark.fem
@pytest.mark.slow
def test_plates_of_two_thicknesses(tmp_path):
    """The thickness of either half by 10 %: within 2e-4 of extraction, on meshed shells."""
    (tmp_path / "plate.geo").write_text(HALVES)
    mesh = ao.read_mesh(tmp_path / "plate.geo", size=0.05, gdim=3)

    def build(left, right):
        halves = {
            name: ao.Shell(E=70e9, nu=0.3, rho=2700.0, thickness=t)
            for name, t in (("left", left), ("right", right))
        }
        clamped = ao.Support(lambda x: np.isclose(x[0], 0.0) | np.isclose(x[0], 0.3))
        return ao.Structure(mesh, halves, [clamped])

    site = ao.Site(point=(0.1, 0.08, 0.0), direction=(0, 0, -1), radius=0.01)
    ranges = {"left": (1.8e-3, 2.2e-3), "right": (1.8e-3, 2.2e-3)}
    models = ao.nearby(build, site, ranges, n=15, tol=1e-4)
    given = {"left": 1.87e-3, "right": 2.14e-3}
    true, found = ao.extract(build(**given), site, n=15), models(**given)
    assert found.k0 == pytest.approx(true.k0, rel=2e-4)
    assert found.omega[:4] == pytest.approx(true.omega[:4], rel=2e-4)
    assert peak(found) == pytest.approx(peak(true), rel=2e-4)


@pytest.mark.fem
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the compliance under a point load")
def test_plates_of_other_lengths():
    """Nodes move with the length, and the site with them."""
    pytest.importorskip("dolfinx")
    from parts import plate

    def build(length):
        material = ao.Solid(E=70e9, nu=0.3, rho=2700.0, plane="stress", thickness=0.01)
        return ao.Structure(plate((4, 2), (length, 0.1)), material, [ao.Support("left")], order=1)

    def site(length):
        return ao.Site((length, 0.1), (0, -1))

    models = ao.nearby(build, site, {"length": (0.24, 0.36)}, n=10)
    true, found = ao.extract(build(0.31), site(0.31), n=10), models(length=0.31)
    assert found.k0 == pytest.approx(true.k0, rel=1e-3)
    assert peak(found) == pytest.approx(peak(true), rel=1e-3)


@pytest.mark.fem
def test_the_contact_follows_from_the_surface_of_the_drawn_structure():
    """A block of drawn modulus, strength and patch, against extractions of the same block."""
    mesh = ao.box_mesh((0.06, 0.06, 0.02), size=0.0075)

    def build(E, strength, radius):
        material = ao.Solid(E=E, nu=0.3, rho=2700.0, yield_strength=strength)
        held = ao.Support(lambda x: np.isclose(x[2], 0.0))
        return ao.Structure(mesh, material, [held], order=1)

    def site(E, strength, radius):
        return ao.Site(point=(0.03, 0.03, 0.02), direction=(0, 0, -1), radius=radius)

    ranges = {"E": (50e9, 90e9), "strength": (100e6, 400e6), "radius": (8e-3, 11e-3)}
    models = ao.nearby(build, site, ranges, n=8, tol=1e-3)
    striker = ao.Sphere(radius=0.01, material="100Cr6", velocity=2.0)
    peaks = []
    for values in ((55e9, 350e6, 10.5e-3), (85e9, 120e6, 8.5e-3)):
        given = dict(zip(ranges, values, strict=True))
        true, found = ao.extract(build(**given), site(**given), n=8), models(**given)
        hits = [ao.simulate(one, striker, "auto", 1e-4) for one in (true, found)]
        assert type(hits[1].law) is type(hits[0].law)
        assert hits[1].peak_force == pytest.approx(hits[0].peak_force, rel=1e-3)
        assert found.radius == pytest.approx(given["radius"])
        matter = found.surface("").matter
        assert matter.E / given["E"] == pytest.approx(1.0)
        peaks.append(hits[0].peak_force)
    assert abs(peaks[1] / peaks[0] - 1) > 0.1
