"""Motion, strain and stress at points against transient solves of the unreduced model."""

from __future__ import annotations

import contextlib
import pickle
import warnings

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.base.texts import percent
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fields.probe import ProbeError
from antiosc.recovery import mesh_fields
from antiosc.recovery.place import Place, Reach
from antiosc.reduce.site import functional
from parts import unreduced
from sheets import RIB, SHEET, grouped, rectangle
from static_loads import quiet

SITE = ao.Site((0.13, 0.06), (0.2, -1), radius=0.034)
BALL, LAW = ao.RigidMass(mass=0.1, velocity=1.0), ao.Hertz(1e8)
DURATION = 1e-3
REACH = Reach("the point")
POINTS = [(0.2, 0.06), (0.07, 0.031), (0.1, 0.0), (0.01, 0.01), (0.15, 0.02), (0.0, 0.05)]


@pytest.fixture(scope="module")
def sheet():
    part = parts.held_sheet()
    times = np.linspace(0, DURATION, 201)
    return part, times, unreduced(part, SITE, times, BALL, LAW)


def references(part, solved, point):
    """What the whole model has at a point: quantity -> (times, …)."""
    u, v, a, _ = solved
    x = np.array([[*point, 0.0]])

    def recovered(quantity):
        found = mesh_fields.recovered(part, u.T, x, None, quantity, Place(), REACH)[0]
        return np.moveaxis(found, -1, 0)

    moved = [mesh_fields.at_point(part, w.T, x[0], None, REACH).T for w in (u, v, a)]
    names = ("displacement", "velocity", "acceleration")
    return {
        **dict(zip(names, moved, strict=True)),
        **{q: recovered(q) for q in ("strain", "stress", "rotation")},
    }


def errors(part, hit, times, solved, **options):
    """Largest error at all points over the largest value at all points, for each quantity."""
    found: dict[str, list[float]] = {}
    for point in POINTS:
        for quantity, exact in references(part, solved, point).items():
            got = ao.probe(part, hit, point, quantity, times, **options)
            assert got.shape == exact.shape
            worst, size = found.setdefault(quantity, [0.0, 0.0])
            found[quantity] = [
                max(worst, float(np.abs(got - exact).max())),
                max(size, float(np.abs(exact).max())),
            ]
    return {quantity: worst / size for quantity, (worst, size) in found.items()}


@pytest.mark.slow
def test_every_quantity_converges_to_the_unreduced_model(sheet):
    part, times, solved = sheet
    worst = {}
    for n in (6, 12, 24):
        hit = ao.simulate(ao.extract(part, SITE, n), BALL, LAW, DURATION, tol=1e-5)
        worst[n] = errors(part, hit, times, solved)
        # what is left of the force's error is that of the time integration
        assert np.abs(hit.force_at(times) - solved[3]).max() < 1e-5 * solved[3].max()
    for coarse, fine in ((6, 12), (12, 24)):
        assert all(worst[fine][q] < worst[coarse][q] for q in worst[fine])
    limits = {"displacement": 1e-5, "velocity": 3e-4, "acceleration": 1.5e-2}
    for quantity, value in worst[24].items():
        assert value < limits.get(quantity, 2e-4), quantity


@pytest.mark.slow
def test_the_error_by_the_anti_oscillators_is_that_of_the_unreduced_model(sheet):
    part, times, solved = sheet
    point = POINTS[1]
    exact = references(part, solved, point)
    bars = {}
    for n in (6, 24):
        hit = ao.simulate(ao.extract(part, SITE, n), BALL, LAW, DURATION)
        for quantity in ("velocity", "acceleration", "stress"):
            bar = ao.probe_error(part, hit, point, quantity, times).truncation
            got, right = (
                x.reshape(len(times), -1)
                for x in (ao.probe(part, hit, point, quantity, times), exact[quantity])
            )
            k = int(abs(got).max(axis=0).argmax())
            apart = abs(got - right)[:, k].max() / abs(got).max()
            if quantity != "stress":
                sizes = [np.linalg.norm(x, axis=1) for x in (got - right, got)]
                apart = sizes[0].max() / sizes[1].max()
            assert apart <= 1.5 * bar, (n, quantity)  # of accelerations it is no bound
            bars[n, quantity] = bar
    for quantity in ("velocity", "acceleration", "stress"):
        assert bars[24, quantity] < min(0.05, 0.5 * bars[6, quantity]), bars
    with pytest.raises(ao.InputError, match="half"):
        ao.probe_error(part, ao.simulate(ao.extract(part, SITE, 1), BALL, LAW, 1e-4), point)


@pytest.mark.slow
def test_the_error_of_a_probe_has_that_of_the_force_which_it_follows():
    part = parts.held_sheet()
    point = POINTS[1]
    errors = []
    for options in ({}, {"error": "estimate"}):
        hit = ao.simulate(ao.extract(part, SITE, 24, **options), BALL, LAW, DURATION)
        errors.append(ao.probe_error(part, hit, point, "displacement"))
    alone, whole = errors
    bar = hit.error_budget["peak_force"]
    assert alone.force is None
    assert alone == np.inf
    assert "no error bar" in str(alone)
    assert alone.truncation == pytest.approx(whole.truncation, rel=1e-6)
    assert whole.force == pytest.approx(bar.total - bar.truncation)
    assert whole == whole.truncation + whole.mesh + whole.force > alone.truncation
    assert str(whole).startswith(f"± {percent(whole)} (anti-oscillators ")
    assert repr(whole) == str(whole)
    assert "force 2 %" in str(ProbeError(0.01, 0.02, 0.0))
    assert ProbeError(0.01, 0.02, None) == np.inf
    assert ProbeError(0.1, 0.02, 0.0) == np.inf
    assert vars(pickle.loads(pickle.dumps(whole))) == vars(whole)


@pytest.mark.slow
def test_the_error_of_a_probe_holds_cells_that_are_too_large():
    """Linear tetrahedra, one through the thickness: 1.54 mm for 2.64 mm."""
    bar, plastic = (0.148, 0.039, 0.012), ao.Solid(2.3e9, 0.36, 1050.0)
    seen = []
    for order in (1, 2):
        part = ao.Structure(
            ao.box_mesh(bar, 0.012), plastic, [ao.Support(lambda x: x[0] < 1e-9)], order=order
        )
        site = ao.Site((0.14, 0.02, 0.012), (0, 0, -1), radius=6e-3)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AccuracyWarning)  # coarse cells at the patch
            model = ao.extract(part, site, n=40, error="estimate", damping=0.02)
        hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(3e7), duration=8e-3)
        asked = {"times": np.linspace(0, 8e-3, 2001), "snap": 0.01, "filter": "CFC1000"}
        values = ao.probe(part, hit, bar, "acceleration", **asked)
        seen.append(
            (
                np.linalg.norm(values, axis=1).max(),
                ao.probe_error(part, hit, bar, "acceleration", **asked),
            )
        )
    (coarse, error), (fine, _) = seen
    assert 0.1 < abs(fine / coarse - 1) < error
    assert error.truncation + error.force < error


def gain(omega, cfc):
    """Of a second-order Butterworth filter forward and backward, at omega [rad/s]."""
    return 1 / (1 + (omega / (2 * np.pi * 2.0775 * cfc)) ** 4)


@pytest.mark.parametrize("kind", ["history", "scene"])
@pytest.mark.parametrize("quantity", ["displacement", "acceleration", "stress"])
def test_a_filtered_vibration_has_the_gains_of_the_filter(sheet, kind, quantity):
    """After the contact every mode is a sine, to the end of the run and beyond it."""
    part = sheet[0]
    if kind == "history":
        hit = ao.simulate(ao.extract(part, SITE, 2), BALL, LAW, 8e-3)
    else:
        model = ao.extract(part, {"tip": SITE}, 2)
        contact = ao.Contact("part:tip", "ball", LAW)
        hit = ao.Scene({"part": model, "ball": BALL}, [contact]).run(8e-3)
    ends = [end for one in hit.contact_histories for _, end in one.contacts]
    assert max(ends) < 3e-3
    of_body = {"body": "structure" if kind == "history" else "part"}
    times = np.linspace(5e-3, 8e-3, 400)  # from 2 ms after the contact
    signal, seen = (
        ao.probe(part, hit, POINTS[1], quantity, times, **of_body, **asked).reshape(400, -1)
        for asked in ({}, {"filter": "CFC1000"})
    )
    omega = hit.of(of_body["body"])[1].omega
    assert omega[0] < 1e4 < omega[1]
    waves = np.hstack([np.cos(np.outer(times, omega)), np.sin(np.outer(times, omega))])
    amplitudes, *_ = np.linalg.lstsq(waves, signal, rcond=None)
    np.testing.assert_allclose(waves @ amplitudes, signal, atol=1e-6 * np.abs(signal).max())
    expected = waves @ (np.tile(gain(omega, 1000), 2)[:, None] * amplitudes)
    assert np.abs(expected).max() < 0.95 * np.abs(signal).max()
    np.testing.assert_allclose(seen, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("kind", ["history", "scene"])
def test_rates_of_a_damped_body_are_derivatives(sheet, kind):
    """Velocity and acceleration against differences of the displacement, in contact and after."""
    part = sheet[0]
    if kind == "history":
        model = ao.extract(part, SITE, 6, damping=0.2)
        hit = ao.simulate(model, BALL, LAW, DURATION, tol=1e-6)
    else:
        model = ao.extract(part, {"tip": SITE}, 6, damping=0.2)
        contact = ao.Contact("part:tip", "ball", LAW)
        hit = ao.Scene({"part": model, "ball": BALL}, [contact]).run(DURATION, tol=1e-6)
    h = 1e-7
    middles = np.linspace(0.05, 0.95, 19) * DURATION
    u = [ao.probe(part, hit, (0.2, 0.06), times=middles + k * h, body="structure" if kind ==
                  "history" else "part") for k in (-1, 0, 1)]  # fmt: skip
    found = [
        ao.probe(part, hit, (0.2, 0.06), q, middles, body="structure" if kind == "history" else
                 "part") for q in ("velocity", "acceleration")
    ]  # fmt: skip
    for rate, difference in zip(
        found, ((u[2] - u[0]) / (2 * h), (u[2] - 2 * u[1] + u[0]) / h**2), strict=True
    ):
        np.testing.assert_allclose(rate, difference, atol=5e-3 * np.abs(rate).max())


def test_a_residual_compliance_adds_its_stress():
    """At rest under a force, a superposition of two modes with correction: σ of K⁻¹bF."""
    part = parts.held_sheet()
    hit = quiet(ao.superposition(part, SITE, 2, static_correction=True), 5.0)
    b = functional(part, SITE).b
    free = np.setdiff1d(np.arange(len(b)), part.fixed)
    u = np.zeros((len(b), 1))
    u[free, 0] = np.linalg.solve(csr(part.K)[free][:, free].toarray(), 5 * b[free])
    for point in POINTS:
        x = np.array([[*point, 0.0]])
        exact = mesh_fields.recovered(part, u, x, None, "stress", Place(), REACH)[0, ..., 0]
        found = ao.probe(part, hit, point, "stress", body="part")[-1]
        np.testing.assert_allclose(found, exact, atol=1e-6 * np.abs(exact).max())


def test_a_strain_gauge_is_the_stretch_between_its_ends(sheet):
    part, times, _ = sheet
    hit = ao.simulate(ao.extract(part, SITE, 12), BALL, LAW, DURATION)
    middle, d, length = np.array([0.115, 0.03]), np.array([0.6, 0.8]), 0.01
    gauge = ao.strain_gauge(part, hit, middle, d, length, times)
    a, b = (ao.probe(part, hit, middle + s * length / 2 * d, times=times) for s in (-1, 1))
    stretch = (b - a) @ d / length
    np.testing.assert_allclose(gauge, stretch, atol=1e-9 * np.abs(stretch).max())
    tensor = ao.probe(part, hit, middle, "strain", times)[:, :2, :2] @ d @ d
    assert np.abs(gauge - tensor).max() < 0.1 * np.abs(tensor).max()
    with pytest.raises(ao.InputError, match="off the structure"):
        ao.strain_gauge(part, hit, (0.195, 0.02), (1, 0), 0.03, times)


def test_a_loaded_shell_bends():
    """A clamped strip under a slow force: σ = 6M/(bt²) at both surfaces, N, V, M by statics."""
    part = ao.Structure(
        parts.plate((12, 2), (0.3, 0.02), "triangle"),
        ao.Shell(E=70e9, nu=0.0, rho=2700.0, thickness=4e-3),
        [ao.Support("left")],
    )
    site = ao.Site((0.27, 0.01, 0), (0, 0, 1), radius=0.01)
    hit = quiet(ao.extract(part, site, 6), 5.0)
    x = 0.1
    M = 5.0 * (0.27 - x) / 0.02
    top, bottom, middle = (
        ao.probe(part, hit, (x, 0.01), "stress", surface=s)[-1] for s in ("top", "bottom", "middle")
    )
    size = 6 * M / 4e-3**2  # the free end rises: the top is pressed
    np.testing.assert_allclose([top[0, 0], bottom[0, 0]], [-size, size], rtol=2e-2)
    assert abs(middle[0, 0]) < 1e-6 * size
    # shear 3/2 Q/t in the middle
    np.testing.assert_allclose(abs(middle[0, 2]), 1.5 * 5.0 / 0.02 / 4e-3, rtol=5e-2)
    forces = ao.probe(part, hit, (x, 0.01), "section_forces")[-1]
    np.testing.assert_allclose(abs(forces[[3, 6]]), [M, 5.0 / 0.02], rtol=5e-2)
    equal = ao.probe(part, hit, (x, 0.01), "von_mises")[-1]
    assert equal == pytest.approx(size, rel=2e-2)


@pytest.mark.parametrize("outline", [True, False])
def test_von_mises_of_a_beam_is_that_of_its_worst_fibre(outline):
    """σ = M h/2I of a cantilever under a force; the centroid alone has no bending."""
    side = 0.01
    square = ao.Section.rectangle(side, side)
    section = square if outline else ao.Section(A=square.A, I=square.I)
    part = ao.Structure(
        parts.line(0.2, 8), ao.Beam(**parts.STEEL, section=section), [ao.Support("left")]
    )
    hit = quiet(ao.extract(part, ao.Site((0.2, 0.0), (0, 1)), 6), 5.0)
    told = contextlib.nullcontext() if outline else pytest.warns(ao.AccuracyWarning, match="fibre")
    with told:
        stress = ao.probe(part, hit, (0.1, 0.0), "von_mises")[-1]
    bent = 5.0 * 0.1 * side / 2 / square.I
    assert stress == pytest.approx(bent if outline else 0.0, rel=2e-2, abs=1e-6 * bent)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*patch", "ignore:.*half-space")
def test_a_part_that_an_assembly_turns_feels_the_same():
    """Motion and tensors of the turned part are those of the part itself, turned."""
    whole = ao.Structure(parts.box((4, 2, 2)), ao.Solid(**parts.STEEL), [ao.Support("left")])
    turn = ao.Placement(axis=(1, 2, 3), angle=0.7, shift=(0.1, 0.0, 0.2))
    joined = ao.assemble({"block": whole}, at={"block": turn})
    R = turn.rotation
    point, d = np.array([0.2, 0.02, 0.04]), np.array([0.0, 0.2, -1.0])
    hits = [
        ao.simulate(ao.extract(one, ao.Site(x, e, radius=0.03), 6), BALL, LAW, 3e-4)
        for one, x, e in ((whole, point, d), (joined, turn.placed(point[None])[0], R @ d))
    ]
    assert hits[1].peak_force == pytest.approx(hits[0].peak_force, rel=1e-6)
    at, times = np.array([0.07, 0.03, 0.01]), np.linspace(0, 3e-4, 21)
    there = turn.placed(at[None])[0]
    for quantity in ("acceleration", "rotation", "stress", "strain"):
        own = ao.probe(whole, hits[0], at, quantity, times)
        seen = ao.probe(joined, hits[1], there, quantity, times, part="block")
        expected = own @ R.T if own.ndim == 2 else R @ own @ R.T
        np.testing.assert_allclose(seen, expected, atol=1e-4 * np.abs(own).max())


def test_section_forces_of_a_plane_beam():
    """A cantilever under a slow force at its end: V = F, M = F (l − x), to rounding."""
    beam = ao.Beam(**parts.STEEL, section=ao.Section.rectangle(0.01, 0.02))
    part = ao.Structure(parts.line(0.8, 4), beam, [ao.Support("left")])
    hit = quiet(ao.extract(part, ao.Site((0.8, 0.0), (0, 1)), 6), 5.0)
    N, V, M = ao.probe(part, hit, (0.3, 0.0), "section_forces")[-1]
    np.testing.assert_allclose([V, M], [5.0, 5.0 * 0.5], rtol=1e-5)
    assert abs(N) < 1e-6
    fibre = ao.probe(part, hit, (0.3, 0.0), "stress", fibre=(0.01, 0.0))[-1]
    np.testing.assert_allclose(fibre[0, 0], -M * 0.01 / beam.section.I, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*patch")
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_a_stiffener_takes_its_share_of_the_moment(cell):
    """A T section under a slow force: plane sections stay plane, N of the rib by statics."""
    length, width, force, x = 1.0, 0.05, 5.0, 0.3
    mesh = grouped(rectangle((24, 2), length, width, cell), lambda at: np.isclose(at[1], width / 2))
    part = ao.Structure(
        mesh, {"sheet": SHEET, "rib": RIB}, [ao.Support(lambda at: np.isclose(at[0], 0))]
    )
    end = length - 0.05
    site = ao.Site((end, width / 2, 0), (0, 0, 1), radius=0.02)
    hit = quiet(ao.extract(part, site, 8), force)
    rib, E = RIB.section, RIB.E
    areas, centres = np.array([width * 0.004, rib.A]), np.array([0.0, RIB.offset])
    own = np.array([width * 0.004**3 / 12, rib.I])
    middle = areas @ centres / areas.sum()
    bend = force * (end - x) / (E * (own.sum() + areas @ (centres - middle) ** 2))

    def probed(quantity, **options):
        return ao.probe(part, hit, (x, width / 2, 0), quantity, stiffener="rib", **options)[-1]

    forces = probed("section_forces")
    N = E * rib.A * bend * (centres[1] - middle)
    np.testing.assert_allclose(abs(forces[[0, 5]]), [N, E * rib.I * bend], rtol=2e-2)
    above = probed("stress", fibre=(0.015, 0.0), axes="local")[0, 0]
    assert abs(above) == pytest.approx(E * bend * (centres[1] + 0.015 - middle), rel=2e-2)
    with pytest.raises(ao.InputError, match=r"no stiffener.*'rib'"):
        ao.probe(part, hit, (x, 0, 0), "stress", stiffener="ribs")
