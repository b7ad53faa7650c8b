"""Parts of the march against closed forms: responses, crossings, chords, errors, differences."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from antiosc.engine import library, march
from antiosc.engine.equilibrium import set_initial_forces
from antiosc.engine.system import CONTACT_RECORD, System
from antiosc.impact.assembly import assemble_scene
from march_audit import motion
from march_builds import built
from scenes import case_two

Array = NDArray[np.float64]
OMEGA, DECAY = np.array([0.0, 300.0, 2e3, 9e3, 3e4]), np.array([0.0, 4.0, 0.0, 90.0, 0.0])


def system(laws: list[ao.ContactLaw], **given: Array) -> System:
    """Modes, loads and gaps at random for the laws."""
    rng, p = np.random.default_rng(3), len(laws)
    a = rng.normal(size=(p, p))
    own = {
        "omega": OMEGA, "decay": DECAY, "beta": rng.normal(size=(p, OMEGA.size)),
        "R": 1e-7 * a @ a.T, "breaks": np.array([0.0, 0.2, 0.7]),
        "loads": rng.normal(size=(3, OMEGA.size)), "offsets": rng.normal(size=(3, p)) * 1e-6,
        "q": rng.normal(size=OMEGA.size) * 1e-5, "v": rng.normal(size=OMEGA.size),
    }  # fmt: skip
    contacts = np.zeros(p, CONTACT_RECORD)
    expected = {"mass": 1.0, "expected_depth": 1e-4, "expected_speed": 2.0, "first_tangential": p}
    for name, value in expected.items():
        contacts[name] = value
    return System(**{**own, **given}, laws=laws, contacts=contacts)


@pytest.mark.slow
def test_the_structures_have_the_sizes_of_the_librarys() -> None:
    sizes = (ctypes.c_size_t * 15)()
    built().part_sizes(sizes)
    mirrored = (library.UserLaw, library.CLaw, library.CContact, library.CSystem)
    mirrored += (
        library.COptions,
        library.CRecord,
        library.CSummary,
        library.CDifference,
        library.CSolution,
    )
    expected = [ctypes.sizeof(each) for each in mirrored]
    expected += [library.TOUCH_RECORD.itemsize]
    batches = (
        library.CNumbers,
        library.CImpact,
        library.CExpectedContact,
        library.COutcome,
        library.CPulseNodes,
    )
    assert list(sizes) == [*expected, *map(ctypes.sizeof, batches)]


def test_the_march_is_a_collocation_of_order_four() -> None:
    """Against a march of fixed steps in NumPy, written for one contact of one spring."""
    model, mass = case_two(9)
    made = assemble_scene(
        ao.Scene({"a": model, "b": mass}, [ao.Contact("a", "b", ao.Linear(1e6))]), 1e-4
    )
    set_initial_forces(made.system, made.scene.preload)
    s = made.system
    found = march.run(s, 1e-4, 1e-7, fine=made.contact_time_estimate / 200)
    errors = []
    for count in (8, 16):
        q, v, f = s.q.copy(), s.v.copy(), 0.0
        for _ in range(count):
            q, v, f = collocated(s, 1e6, q, v, f, 1e-4 / count)
        errors.append(abs(f / found.force[-1, 0] - 1))
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] > 10


def collocated(s: System, k: float, q: Array, v: Array, f0: float, h: float) -> tuple:
    """A step under the parabola of the force that meets F = k delta at h/2 and h."""
    b = s.beta[0]

    def moved(f: Array, t: float) -> tuple[Array, Array]:
        a = np.array([f[0], (4 * f[1] - 3 * f[0] - f[2]) / h, 4 * (f[0] - 2 * f[1] + f[2]) / h**2])
        return motion(s.omega, s.decay, np.full((1, 1), t), q[None], v[None], -a[:, None, None] * b)

    zero = np.array([f0, 0.0, 0.0])
    free = np.array([b @ moved(zero, t)[0][0] for t in (h / 2, h)])
    unit = [zero + np.eye(3)[i] for i in (1, 2)]
    give = free[:, None] - [[b @ moved(e, t)[0][0] for e in unit] for t in (h / 2, h)]
    f = np.append(f0, np.linalg.solve(np.eye(2) + k * give, k * free))
    (q1,), (v1,) = moved(f, h)
    return q1, v1, f[2]
