"""What a body says of itself to a simulation, and what is taken of one that says nothing."""

from __future__ import annotations

import pytest

import antiosc as ao
from antiosc.models.body import checked_body

MODEL = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3], omega=[2e3], local_compliance=2e-8, radius=3e-3)


class Bare:
    """A foreign body: a free mass of 0.2 kg, and nothing but its modes."""

    def modal(self):
        root = 0.2**0.5
        return ao.ModalBody([0.0], [1 / root], weight=[root])


def with_more(**said):
    body = Bare()
    vars(body).update(said)
    return body


def test_a_bare_body_has_the_defaults():
    bare = checked_body("body", Bare())
    assert (bare.velocity, bare.gap, bare.local_compliance) == (0.0, 0.0, 0.0)
    assert bare.patch_radius is None
    assert bare.modal().omega.tolist() == [0.0]


def test_a_foreign_striker_hits_as_a_rigid_mass_does():
    foreign = with_more(velocity=1.5, gap=1e-4)
    hits = [
        ao.simulate(MODEL, striker, ao.Linear(1e7), 2e-3, gap=gap)
        for striker, gap in ((foreign, None), (ao.RigidMass(0.2, 1.5), 1e-4))
    ]
    assert hits[0].contacts[0][0] == pytest.approx(1e-4 / 1.5, rel=1e-9)
    assert hits[0].peak_force == pytest.approx(hits[1].peak_force, rel=1e-9)
    assert hits[0].impactor is foreign


def test_the_patch_of_a_foreign_body_counts_like_a_model_s():
    """Hertz's law without a patch's half-space compliance is stiffer: to the force of contact."""
    foreign = with_more(velocity=1.0, local_compliance=2e-8, radius=3e-3)
    wall = ao.AntiOscillators(m0=0.0, k0=1e12, m=[], omega=[])
    rigid = ao.simulate(wall, ao.RigidMass(0.2, 1.0), ao.Hertz(1e9), 2e-3)
    hit = ao.simulate(wall, foreign, ao.Hertz(1e9), 2e-3)
    assert hit.assembly.laws[0].compliance == 2e-8
    assert rigid.assembly.laws[0].compliance == 0.0
    assert checked_body("body", foreign).patch_radius == 3e-3
    assert ao.Impactor(foreign).local_compliance == ao.Impactor(MODEL).local_compliance == 2e-8
    assert ao.Impactor(MODEL).patch_radius == 3e-3
