"""The largest stress of a part is sought alike with and without a yield strength."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.texts import engineering
from antiosc_app import headline, results
from antiosc_app.scene_file.scene import stress_fields

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]
ALUMINIUM = 70e9, 0.33, 2700.0
DROPPED = ao.RigidMass(0.05, 0.3, tip_radius=0.02)
BALL = ao.Sphere(0.01, material="bearing steel 100Cr6", velocity=0.5)


def held(part, site, striker=DROPPED, strength=None):
    """(largest stress, stress fields, part, impact) of a held aluminium part, by Hertz's law."""
    if part == "shell":
        mesh, at, made = ao.box_mesh((0.12, 0.06), size=0.02, gdim=3), (*site, 0.0), ao.Shell
        material = made(*ALUMINIUM, thickness=3e-3, yield_strength=strength)
    else:
        mesh, at, made = ao.box_mesh((0.12, 0.06, 0.03), size=0.02), (*site, 0.03), ao.Solid
        material = made(*ALUMINIUM, yield_strength=strength)
    structure = ao.Structure(mesh, material, [ao.Support("-x")])
    model = ao.extract(structure, ao.Site(at, (0, 0, -1), radius=4e-3), n=6, error="estimate")
    law = ao.Hertz(stiffness() if striker is BALL else 2e9)
    hit = ao.simulate(model, striker, law, 1e-3)
    fields = stress_fields(structure, hit)
    judged = headline.judged_stress_data(fields)
    return judged, fields, structure, hit


@pytest.mark.slow
@pytest.mark.parametrize("part", ["solid", "shell"])
def test_a_largest_stress_is_that_of_the_same_blow_on_a_part_with_a_strength(part):
    """Of a striker without a material, whose contact is not known to yield with either."""
    (known, _, _, hit), (bare, fields, _, same) = (
        held(part, (0.08, 0.03), strength=strength) for strength in (1e9, None)
    )
    assert same.peak_force == pytest.approx(hit.peak_force, rel=1e-12)
    assert bare["stress_place"] == known["stress_place"]
    assert bare["stress"] == pytest.approx(known["stress"], rel=1e-12)
    (told,) = headline.stress_sentences(fields, 0.0)
    head = headline.sentences_of_history(same, same.error_budget, fields)
    for text in (told, " ".join(head)):
        assert "no yield strength" in text
        assert ("rigidly held faces" in text) == (part == "solid")
    numbers = results._stress_numbers(fields)["von_mises"]["outside"]
    assert numbers["value"] == bare["stress"]
    with pytest.raises(ao.InputError, match="strength"):
        fields["von_mises"].margin()


@pytest.mark.slow
def test_the_zone_of_a_contact_that_may_yield_is_left_out_of_a_solid():
    """Within three radii of it, by Hertz's law, a = (R depth)^(1/2) with R of the ball."""
    _, fields, _, hit = held("solid", (0.03, 0.03), BALL)
    worst = fields["von_mises"].worst_point
    radius = np.sqrt(BALL.radius * (hit.peak_force / stiffness()) ** (2 / 3))
    assert f"3 radii of the contact ({engineering(3 * radius, 'm', 2)})" in worst.scope
    assert worst.errors[1] > 2 * worst.value  # its patch is larger than the contact


def stiffness():
    """Hertz's stiffness of the ball on aluminium, 4/3 E* R^(1/2)."""
    steel, (E, nu, _) = ao.material("bearing steel 100Cr6"), ALUMINIUM
    flexibility = (1 - nu**2) / E + (1 - steel.nu**2) / steel.E
    return 4 / 3 / flexibility * np.sqrt(BALL.radius)
