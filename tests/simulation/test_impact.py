"""Impacts against closed forms, balances and mechanics that know nothing of the integrator."""

from __future__ import annotations

import subprocess
import sys
from functools import cache

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation.march.convergence import difference
from scenes import HERTZ, case_two, hertz_impact, random_model, rigid


def test_two_bodies_through_hertz_alone():
    m1, m2, v = 0.24, 0.5, 1.3
    mu = m1 * m2 / (m1 + m2)
    peak, time = hertz_impact(mu, v, HERTZ)
    hit = ao.simulate(rigid(m2), ao.RigidMass(m1, v), ao.Hertz(HERTZ), 3 * time, tol=1e-5)
    assert hit.peak_force == pytest.approx(peak, rel=1e-5)
    assert hit.contact_time == pytest.approx(time, rel=1e-5)
    assert hit.impulse == pytest.approx(2 * mu * v, rel=1e-6)
    assert hit.restitution == pytest.approx(1.0, abs=1e-6)
    assert hit.contacts[0][0] == 0.0
    assert hit.status == 0


def test_mass_on_a_spring_is_half_a_sine():
    """Linear contact on a massless spring: F = v sqrt(k m) sin(w t) with k in series."""
    k, c, m, v = 3e6, 2e6, 0.7, 0.4
    series = 1 / (1 / k + 1 / c)
    w = np.sqrt(series / m)
    spring = ao.AntiOscillators(m0=0.0, k0=k, m=[], omega=[])
    hit = ao.simulate(spring, ao.RigidMass(m, v), ao.Linear(c), 4 / w, tol=1e-6)
    inside = hit.time < 0.99 * np.pi / w
    exact = v * np.sqrt(series * m) * np.sin(w * hit.time[inside])
    assert hit.force[inside] == pytest.approx(exact, abs=1e-5 * exact.max())
    assert hit.contact_time == pytest.approx(np.pi / w, rel=1e-5)
    assert hit.displacement[inside] == pytest.approx(exact / k, abs=1e-5 * exact.max() / k)


class TestTwoModels:
    """A second anti-oscillator structure as the striker, Article Fig. 1."""

    def test_the_two_structures_may_be_exchanged(self, rng):
        a = random_model(rng, 3, supported=False)
        b = random_model(rng, 4, supported=False)
        law = ao.Hertz(1e8)
        one = ao.simulate(a, ao.Impactor(b, 1.0), law, 5e-3, step=1e-6)
        two = ao.simulate(b, a, law, 5e-3, initial_velocity=1.0, step=1e-6)
        # the same impact seen from a frame that moves with the other body
        assert two.peak_force == pytest.approx(one.peak_force, rel=1e-9)
        assert two.impulse == pytest.approx(one.impulse, rel=1e-9)

    def test_supported_striker_may_be_touched(self, rng):
        a, b = random_model(rng, 3, supported=False), random_model(rng, 3)
        hit = ao.simulate(a, b, ao.Hertz(1e8), 5e-3, initial_velocity=1.0, gap=1e-4)
        assert hit.contacts[0][0] == pytest.approx(1e-4, rel=1e-9)
        assert hit.energy.drift < 1e-3


class TestErrorControl:
    @pytest.mark.sample
    @pytest.mark.parametrize("tol", [1e-2, 1e-3, 1e-4])
    def test_tolerance_is_kept(self, tol):
        model, striker = case_two(9)
        law = ao.Hertz(HERTZ)
        truth = ao.simulate(model, striker, law, 4e-3, step=5e-8)
        hit = ao.simulate(model, striker, law, 4e-3, tol=tol)
        l2, peak, _ = difference(hit.run, truth.run, np.inf)
        assert max(l2, peak) <= tol
        assert hit.error["force"] <= tol
        assert l2 <= 2 * hit.error["force"]


@pytest.mark.slow
def test_runs_without_the_finite_element_packages_and_loads_little():
    script = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {"dolfinx", "gmsh", "petsc4py", "slepc4py", "mpi4py", "ufl",
                                  "basix", "ffcx", "matplotlib", "meshio"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Blocked())
import antiosc as ao
model = ao.AntiOscillators(m0=0.1, k0=1e5, m=[0.2], omega=[1e3])
hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 5e-3)
assert hit.peak_force > 0
late = {"scipy.optimize", "scipy.integrate", "scipy.interpolate", "scipy.spatial"}
assert not late & sys.modules.keys(), late & sys.modules.keys()
try:
    ao.read_mesh
except ao.MissingDependencyError as error:
    print("says:", error)
else:
    raise SystemExit("no error")
import numpy as np
part = ao.Structure.from_matrices(np.diag([2e5, 1e5]), np.eye(2))
try:
    ao.extract(part, ao.Site(dof=0), n=1, error="estimate")
except ao.MissingDependencyError:
    pass
else:
    raise SystemExit("no error")
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "dolfinx" in done.stdout


def test_public_names_exist():
    for name, module in ao._MODULES.items():
        if not module.startswith(("antiosc.fem", "antiosc.studies.maps")):
            assert hasattr(ao, name), name
    assert sorted(ao.__all__) == sorted(set(ao.__all__))
    assert dir(ao) == sorted([*ao.__all__, "__version__"])
    with pytest.raises(AttributeError, match="no_such"):
        _ = ao.no_such


def test_a_run_over_which_no_phase_is_left_is_refused():
    model = ao.AntiOscillators(m0=1e20, k0=0.0, m=[1e-40], omega=[1e40])
    ball, law = ao.RigidMass(1e60, -1.0), ao.Hertz(1e-20)
    with pytest.raises(ao.AccuracyError, match=r"the fastest motion, 1e\+40 rad"):
        ao.simulate(model, ball, law, 1e60)
    with pytest.raises(ao.AccuracyError, match="rounding destroys the phase"):
        ao.simulate_many(model, ball, law, 1e60)


# --- Impacts of two bodies by every method: motion, energies and impulses -------------------------


POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
LAWS = {
    "hertz": ao.Hertz(1e9),
    "spring": ao.Linear(3e6),
    "damped": ao.HuntCrossley(1e9, 0.5),
    "plastic": ao.Thornton(1e9, 2e-6),
    "laminate": ao.YangSun(1e9, 1e-6),
}
FIXED = ["newmark", "conserving", "leapfrog"]
METHODS = ["exact", *FIXED, "DOP853"]
MASS, SPEED, GRAVITY, DURATION = 0.3, 1.5, -200.0, 1.5e-3


@cache
def impact(law: str, method: str, m0: float = 0.05) -> ao.History:
    """A damped free structure is struck twice by a mass that falls on it."""
    model = ao.AntiOscillators(
        m0=m0, k0=0.0, m=[0.4, 0.1, 0.05], omega=[2e3, 7e3, 1.2e4],
        participation=[m0, 0.4, 0.1, 0.05], damping=ao.Damping(ratio=0.02, alpha=30.0),
    )  # fmt: skip
    step = None if method == "exact" else 1e-5
    return ao.simulate(
        model, ao.RigidMass(MASS, SPEED), LAWS[law], DURATION, method, step=step, tol=1e-4,
        gravity=GRAVITY, gap=2e-5, initial_velocity=0.2,
    )  # fmt: skip


every = pytest.mark.parametrize(
    ("law", "method"),
    [
        (law, method)
        for law in LAWS
        for method in METHODS
        if method != "DOP853" or law in ("hertz", "laminate")
    ],
)


@every
def test_what_a_history_tells_fits_together(law: str, method: str) -> None:
    """With a fixed step the middle of one is interpolated."""
    hit = impact(law, method)
    p, t = hit.assembly.system, hit.time
    q, v = hit.states(t)
    size, force = hit.assembly.spans["structure"].stop, hit.force
    node = np.arange(t.size) % (2 if method in FIXED else 1) == 0
    node[-1] = False
    u, w = -q[:, :size] @ p.beta[0][:size], q[:, size:] @ p.beta[0][size:]
    for mine, exact in (
        (hit.displacement, u),
        (hit.impactor_displacement, w),
        (hit.velocity, -v[:, :size] @ p.beta[0][:size]),
        (hit.impactor_velocity, v[:, size:] @ p.beta[0][size:]),
        (hit.indentation, w - u - 2e-5),
    ):
        atol = (4e-6 if method == "DOP853" else 1e-8) * np.abs(exact).max()
        np.testing.assert_allclose(mine[node], exact[node], rtol=0, atol=atol)
    # forces are those of the law, and none between the contacts
    events = np.array(hit.contacts)
    assert len(events) >= 1
    inside = node & np.any((t[:, None] > events[:, 0]) & (t[:, None] < events[:, 1]), axis=1)
    outside = ~np.any((t[:, None] >= events[:, 0]) & (t[:, None] <= events[:, 1]), axis=1)
    assert not force[outside].any()
    if law in ("hertz", "spring"):
        own = [LAWS[law].force(float(d), 0.0, ()) for d in hit.indentation[inside]]
        atol = 1e-6 * force.max()
        np.testing.assert_allclose(force[inside], own, rtol=0, atol=atol)
    # impulses: of the parabolas of force up to each node, and of the momentum
    parts = [
        weight * np.diff(t) * hit.force_at(t[:-1] + share * np.diff(t))
        for share, weight in zip((POINTS + 1) / 2, WEIGHTS / 2, strict=True)
    ]
    area = np.append(0.0, np.cumsum(np.sum(parts, axis=0)))
    atol = (1e-8 if method == "exact" else 3e-6) * area[-1]  # parabolas may fall below 0
    np.testing.assert_allclose(hit.cumulative_impulse, area, rtol=0, atol=atol)
    given = MASS * GRAVITY * t[-1]
    lost = MASS * (SPEED - hit.impactor_velocity[-1]) + given
    assert hit.impulse == pytest.approx(lost, rel=1e-7)
    assert hit.impulse == pytest.approx(area[-1], rel=1e-2)
    dense = hit.force_at(np.linspace(0, t[-1], 40_001))
    assert hit.peak_force == pytest.approx(dense.max(), rel=1e-3)
