"""Parts that are hundreds of metres long, or of no known material, are told of the units."""

from __future__ import annotations

import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.errors import AntioscWarning
from antiosc.fem.mesh.units import tell_of_units

pytestmark = pytest.mark.fem

CIRCLE = ao.Section.circle(0.02)
FOAM = ao.Layer.isotropic(E=1e5, nu=0.3, rho=48.0, thickness=20e-3)
SKIN = ao.Layer.isotropic(E=70e9, nu=0.3, rho=1600.0, thickness=1e-3)


@pytest.mark.parametrize(
    ("material", "speed"),
    [
        (ao.Solid(E=210e3, nu=0.3, rho=7850.0), "5.17"),  # MPa with kg/m³
        (ao.Solid(E=210e9, nu=0.3, rho=7.85e-9), r"5.17e\+09"),  # Pa with t/mm³
        (ao.Beam(E=210e3, nu=0.3, rho=7850.0, section=CIRCLE), "5.17"),
        (ao.Shell(E=210e9, nu=0.3, rho=7.85, thickness=1e-3), r"1.64e\+05"),
        (ao.Laminate([FOAM]), "45.6"),
    ],
)
def test_materials_in_other_units(material, speed):
    with pytest.warns(AntioscWarning, match=rf"√\(E/ρ\) = {speed} m/s.*units are SI"):
        tell_of_units(1.0, [material])


def test_materials_in_si_units_are_told_nothing_of():
    steel = ao.Solid(**parts.STEEL)
    rubber, diamond = ao.Solid(5e6, 0.49, 1100.0), ao.Solid(1.05e12, 0.1, 3510.0)
    tell_of_units(99.0, [steel, rubber, diamond, ao.Laminate([SKIN, FOAM, SKIN])])


def test_a_structure_in_millimetres_is_told_of():
    mesh = parts.box(n=(2, 1, 1), size=(200.0, 50.0, 40.0))
    with pytest.warns(AntioscWarning, match=r"210 m long, more than 100 m: units are SI"):
        ao.Structure(mesh, ao.Solid(**parts.STEEL), [ao.Support("left")])
    with pytest.warns(AntioscWarning, match=r"wave speed in a Solid of this part"):
        ao.Structure(parts.box(n=(2, 1, 1)), ao.Solid(210e3, 0.3, 7850.0), [ao.Support("left")])


def test_alike_materials_are_told_of_once():
    alike = [ao.Solid(210e3, 0.3, 7850.0), ao.Solid(210e3, 0.2, 7850.0)]
    with pytest.warns(AntioscWarning) as told:
        tell_of_units(1.0, [*alike, ao.Truss(210e3, 0.3, 7850.0, 1e-3)])
    assert ["Solid" in str(one.message) for one in told] == [True, False]
