"""The part of the live page of every element family: a surface, and the largest stress."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc_app import live_data, live_meshes

ALUMINIUM = parts.ALUMINIUM
SECTION = ao.Section.rectangle(0.01, 0.01)


def cantilever(axis=(1, 0, 0), up=(0, 0, 1)):
    beam = ao.Beam(**ALUMINIUM, section=SECTION, orientation=up)
    return ao.Structure(parts.line(0.5, 10, axis), beam, [ao.Support("left")])


def plane_beam():
    beam = ao.Beam(**ALUMINIUM, section=SECTION)
    return ao.Structure(parts.line(0.5, 10), beam, [ao.Support("left")])


def truss():
    points = [(0, 0, 0), (0.5, 0, 0), (0, 0.5, 0), (0.2, 0.2, 0.5)]
    feet = {"feet": (0, lambda x: np.isclose(x[2], 0))}
    mesh = parts.frame(points, [(0, 3), (1, 3), (2, 3)], 1, groups=feet)
    return ao.Structure(mesh, ao.Truss(**ALUMINIUM, area=1e-4), [ao.Support("feet")])


def solid():
    return ao.Structure(parts.box(), ao.Solid(**ALUMINIUM), [ao.Support("left")])


def shell():
    sheet = ao.Shell(**ALUMINIUM, thickness=2e-3)
    return ao.Structure(parts.plate((8, 4), (0.2, 0.1)), sheet, [ao.Support("left")])


def mast_on_block():
    """Beams on a solid: the nodes of both are in one list."""
    beam = ao.Beam(**ALUMINIUM, section=SECTION, orientation=(1, 0, 0))
    mast = ao.Structure(parts.line(0.3, 6, (0, 0, 1)), beam)
    stiff = dict.fromkeys("xyz", 1e7) | dict.fromkeys(("rx", "ry", "rz"), 1e4)
    at = {"mast": (0.1, 0.025, 0.04)}
    joint = ao.Bushing(("block", at["mast"], 0.02), ("mast", at["mast"]), stiffness=stiff)
    return ao.assemble({"block": solid(), "mast": mast}, [joint], at=at)


FAMILIES = {
    "beam": (cantilever, ao.Site((0.5, 0, 0), (0, 0, 1))),
    "plane beam": (plane_beam, ao.Site((0.5, 0), (0, 1))),
    "truss": (truss, ao.Site((0.2, 0.2, 0.5), (0, 0, -1))),
    "plane": (parts.held_sheet, ao.Site((0.13, 0.06), (0.2, -1), radius=0.034)),
    "shell": (shell, ao.Site((0.2, 0.05, 0), (0, 0, 1), radius=0.01)),
    "solid": (solid, ao.Site((0.2, 0.025, 0.04), (0, 0, -1), radius=0.015)),
    "mixed": (mast_on_block, ao.Site((0.1, 0.025, 0.34), (1, 0, 0), part="mast")),
}


def largest_stress(data, hit):
    """The largest von Mises stress [Pa] that the picture of a page shows."""
    x = live_meshes._field_amplitudes(hit, np.linspace(0.0, hit.time[-1], 300))
    values = []
    for field in data["stress"]:
        scale, parts = field["scale"], field["fields"].reshape(len(field["scale"]), -1)
        amplitudes = scale * (x @ field["factors"].reshape(len(scale), -1).T)
        tensors = (amplitudes @ parts).reshape(len(x), -1, 6)
        values.append(ao.von_mises(tensors).max())
    return max(values)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("family", FAMILIES)
def test_the_page_has_the_stress_of_peak_field(family):
    make, site = FAMILIES[family]
    part = make()
    hit = ao.simulate(ao.extract(part, site, n=2), ao.RigidMass(0.02, 1.0), ao.Hertz(1e7), 2e-3)
    data = live_data.data_of_history(hit, part, None)["part"]
    count = len(data["points"])
    assert data["faces"].max() == count - 1
    assert data["faces"].shape[1] == 3
    peak = ao.peak_field(part, hit).largest(1)[0][0]
    assert largest_stress(data, hit) == pytest.approx(peak, rel=0.05)
    held = np.asarray(data["held"])
    assert 0 < held.sum() < count


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_page_has_the_membrane_stress_of_a_sheet_that_stretches():
    """Its fields are those of the run: motion and stress, from modes, force and pairs of modes."""
    sheet = ao.Shell(**ALUMINIUM, thickness=1e-3)
    rim = ao.Support(lambda x: np.isclose(x[0] * (0.2 - x[0]) * x[1] * (0.1 - x[1]), 0))
    part = ao.Structure(parts.plate((8, 4), (0.2, 0.1)), sheet, [rim])
    model = ao.extract(part, ao.Site((0.1, 0.05, 0), (0, 0, 1), radius=0.01), n=10, stretch=4)
    hit = ao.simulate(model, ao.RigidMass(0.2, 2.0), ao.Hertz(1e7), 4e-3)
    data = live_data.data_of_history(hit, part, None)["part"]
    peak = ao.peak_field(part, hit).largest(1)[0][0]
    assert largest_stress(data, hit) == pytest.approx(peak, rel=0.05)
    t = 1e-3
    taken = hit.assembly.stretch_forces["structure"]
    q = hit.states([t])[0][0, hit.assembly.stacked.spans["structure"]]
    x = np.concatenate([q, hit.force_at([t]), taken.pairs((q @ taken.modes)[None])[0]])
    motion = data["motion"]
    amplitudes = motion["scale"] * (motion["factors"].reshape(len(motion["scale"]), -1) @ x)
    shown = (amplitudes @ motion["fields"].reshape(len(amplitudes), -1)).reshape(-1, 3)
    found = np.linalg.norm(shown, axis=1).max()
    moved = np.linalg.norm(hit.field(t).reshape(-1, 6)[:, :3], axis=1).max()
    assert found == pytest.approx(moved, rel=0.02)
