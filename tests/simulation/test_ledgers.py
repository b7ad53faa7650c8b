"""What is told of a run, at its nodes and between them, by quadrature of the motion itself."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from audited_scenes import SCENES, checked
from march_audit import Motion, Steps

SHARES = np.linspace(0, 1, 101)

Array = NDArray[np.float64]
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)
#: Other laws of the same kind have the same ledgers.
ALIKE = ("Hertz1", "Power3", "Gonthier6", "Thornton7", "Tabulated10")
NAMES = [name for name in SCENES if name not in ALIKE]


def history(name: str) -> tuple[ao.SceneHistory, Steps]:
    found = checked(name)
    hit = ao.SceneHistory(found.made, found.run, {}, 0, "Completed.")
    return hit, Steps(found.made.system, found.run)


def felt(hit: ao.SceneHistory, one: Motion) -> tuple[Array, Array]:
    """External forces (n, P) on the columns of all sites, and those with the contacts' too."""
    a = hit.assembly
    pushes = np.zeros((one.time.size, a.stacked.B.shape[1]))
    for load in a.scene.loads:
        name, _, site = load.end.partition(":")
        body = a.bodies[name]
        column = a.stacked.columns[name].start + body.sites[site][0]
        pushes[:, column] += np.interp(one.time, load.times, load.forces)
    return pushes, pushes - one.force @ a.G


def to_nodes(halves: list[Array]) -> Array:
    """Sums (2 n + 1,) at the nodes of what each first and second half of the steps gives."""
    return np.append(0.0, np.cumsum(np.stack(halves, axis=1).ravel()))


@pytest.mark.parametrize("name", NAMES)
def test_energies_are_the_integrals_of_their_powers(name: str) -> None:
    hit, steps = history(name)
    a, system, energy = hit.assembly, hit.assembly.system, hit.energy
    highest = float(np.max(energy.kinetic + energy.strain + energy.contact))
    work: dict[str, list[Array]] = {"loads": [], "damping": [], "contacts": []}
    rising = (felt(hit, steps.at(1.0))[0] - felt(hit, steps.at(0.0))[0]) / steps.h
    for first in (0.0, 0.5):
        sums = dict.fromkeys(work, np.zeros(len(steps.h)))
        for point, weight in zip((POINTS + 1) / 4 + first, WEIGHTS / 4, strict=True):
            one = steps.at(float(point))
            pushes, _ = felt(hit, one)
            # what a load does on the compliance without mass: the sites follow the forces
            follow = (rising - one.force_rate @ a.G) @ a.stacked.r
            power = {
                "loads": np.sum(one.load * one.v, axis=1) + np.sum(pushes * follow, axis=1),
                "damping": np.sum(2 * system.decay * one.v**2, axis=1),
                "contacts": np.sum(one.force * one.rate, axis=1),
            }
            for key, each in power.items():
                sums[key] = sums[key] + weight * steps.h[:, 0] * each
        for key, each in sums.items():
            work[key].append(each)
    total = {key: to_nodes(halves) for key, halves in work.items()}
    at = [steps.at(0.5), steps.at(1.0)]
    for nodes, one in ((slice(1, None, 2), at[0]), (slice(2, None, 2), at[1])):
        _, forces = felt(hit, one)
        kinetic = np.sum(one.v**2, axis=1) / 2
        strain = np.sum((system.omega * one.q) ** 2, axis=1) / 2
        strain += np.einsum("ni,ij,nj->n", forces, a.stacked.r, forces) / 2
        np.testing.assert_allclose(energy.kinetic[nodes], kinetic, rtol=0, atol=1e-9 * highest)
        np.testing.assert_allclose(energy.strain[nodes], strain, rtol=0, atol=1e-9 * highest)
    np.testing.assert_allclose(energy.gravity, total["loads"], rtol=0, atol=1e-6 * highest)
    kept = energy.contact + energy.dissipated
    taken = kept[0] + total["contacts"] + total["damping"]
    np.testing.assert_allclose(kept, taken, rtol=0, atol=3e-4 * highest)
    assert energy.drift == pytest.approx(np.abs(kept - taken).max() / highest, abs=1e-6)
    assert np.diff(energy.dissipated).min() > -1e-4 * highest
    stored = np.zeros(hit.time.size)
    for c, law in enumerate(a.laws):
        if law.has_memory:
            return
        stored += [law.energy(float(depth), law.touch(1.0)) for depth in hit.run.depth[:, c]]
        first, count = system.contacts[["first_tangential", "n_tangential"]][c]
        rubs = np.sum(hit.run.force[:, first : first + count] ** 2, axis=1)
        stored += rubs / 2 / (system.contacts["tangential_stiffness"][c] or 1.0)
    np.testing.assert_allclose(energy.contact, stored, rtol=0, atol=1e-9 * highest)


@pytest.mark.parametrize("name", ["Hertz2", "plate", "rod", "slips", "loaded", "given step"])
def test_bodies_between_the_nodes_move_by_their_equations(name: str) -> None:
    hit, steps = history(name)
    a, system = hit.assembly, hit.assembly.system
    for share in (0.0, 0.37, 0.5, 0.93):
        one = steps.at(share)
        _, forces = felt(hit, one)
        at = one.load - one.force @ system.beta - system.omega**2 * one.q
        at -= 2 * system.decay * one.v
        for body, found in hit.at(one.time).items():
            j, k = a.stacked.spans[body], a.stacked.columns[body]
            residual = forces[:, k] @ a.stacked.r[k, k]
            way, speed = one.q[:, j] @ found.placed.modes.B, one.v[:, j] @ found.placed.modes.B
            pairs = [
                (found.q, one.q[:, j]),
                (found.v, one.v[:, j]),
                (found.a, at[:, j]),
                (found.forces, forces[:, k]),
                (found.kinetic, np.sum(one.v[:, j] ** 2, axis=1) / 2),
                (
                    found.strain,
                    np.sum((system.omega[j] * one.q[:, j]) ** 2, axis=1) / 2
                    + np.sum(forces[:, k] * residual, axis=1) / 2,
                ),
            ]
            for site, columns in found.placed.sites.items():
                if len(columns) > 1 or not found.placed.modes.B.size:
                    continue
                c = columns[0]
                pairs.append((found.displacement(site), (way + residual)[:, c]))
                pairs.append((found.velocity(site), speed[:, c]))
                pairs.append((found.acceleration(site), at[:, j] @ found.placed.modes.B[:, c]))
            for mine, exact in pairs:
                atol = 1e-8 * np.abs(exact).max(initial=1e-12)
                np.testing.assert_allclose(mine, exact, rtol=0, atol=atol)
    nodes, same = hit.bodies, hit.at(hit.time)
    for body in nodes:
        for each in ("q", "v", "a", "forces"):
            mine, other = getattr(nodes[body], each), getattr(same[body], each)
            atol = 1e-8 * np.abs(other).max(initial=1e-12)
            np.testing.assert_allclose(mine, other, rtol=0, atol=atol)


@pytest.mark.parametrize("name", NAMES)
def test_contacts_have_the_impulse_the_peak_and_the_times_of_their_force(name: str) -> None:
    hit, steps = history(name)
    start, slope, bend = steps.force
    dense = np.stack([start + u * steps.h * (slope + u * steps.h * bend / 2) for u in SHARES])
    area = np.sum(steps.h * (start + steps.h * (slope / 2 + steps.h * bend / 6)), axis=0)
    for c, contact in enumerate(hit.assembly.scene.contacts):
        found = hit[contact.a, contact.b]
        assert found.impulse == pytest.approx(area[c], rel=1e-9, abs=1e-15)
        assert found.peak_force == pytest.approx(max(dense[:, :, c].max(), 0.0), rel=1e-4)
        law, middle = hit.assembly.laws[c], slice(1, None, 2)
        closed = hit.run.force[middle, c] != 0 if law.has_memory else hit.run.depth[middle, c] > 0
        times = np.reshape(found.contacts, (-1, 2))
        assert np.ptp(times, axis=1).sum() == pytest.approx(steps.h[closed].sum())
        spans = np.subtract.outer(times[:, 1], times[:, 0])  # the main impact is contacts in a row
        assert found.contact_time in (spans if times.size else [0.0])
        rows = hit.assembly.system.friction_rows[c]
        first, count = rows.start, rows.stop - rows.start
        np.testing.assert_array_equal(found.friction, hit.run.force[:, first : first + count])
