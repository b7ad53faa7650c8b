"""Decks as structures: materials, sections, units and supports against closed forms and solves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.reduce.extraction.eigenmodes import ModeSolver
from assemblies import stiffness
from mpi import run_ranks
from paths import DECKS


def model_of(folder: Path, text: str, **options) -> ao.Structure:
    path = folder / "part.inp"
    path.write_text(text)
    return ao.read_model(path, **options)


MATERIAL = "*MATERIAL, NAME=M\n*ELASTIC\n1E9, .3\n*DENSITY\n1000.\n"


#: A cantilever of 200 mm whose centroid lies 30 mm above its nodes.
EXCENTRIC = """BEGIN BULK
GRID,1,,0.,0.,0.,,123456
GRID,2,,100.,0.,0.
GRID,3,,200.,0.,0.
CBAR,1,1,1,2,0.,0.,1.,GGG
,,,0.,0.,30.,0.,0.,30.
CBAR,2,1,2,3,0.,0.,1.,GGG
,,,0.,0.,30.,0.,0.,30.
PBAR,1,1,200.,6666.,1666.,4000.
MAT1,1,210000.,,.3,7.85-9
ENDDATA
"""


@pytest.mark.mpi
def test_ranks_share_the_structure_of_a_deck():
    script = """
        import sys, warnings
        import antiosc as ao
        from mpi4py import MPI
        warnings.simplefilter("ignore")
        plate = ao.read_model(sys.argv[1] + "/plate.bdf", unit="mm")
        model = ao.extract(plate, ao.Site((0.25, 0.05, 0), (0, 0, 1)), n=4)
        print(plate.dofs, f"{plate.mass:.9g} {model.k0:.9g}")
        try:
            ao.read_model(sys.argv[1] + "/mixed.inp")
        except ao.MeshError as error:
            print(error)
    """
    one, two = run_ranks(1, script, str(DECKS)), run_ranks(2, script, str(DECKS))
    assert two == [*one, *one]
    assert "have no section" in one[0]


WRONG = [
    ("yield_strength", 0.0),
    ("unit", "km"),
    ("merge", 0.0),
    ("density", -1.0),
    ("timeout", 0.0),
    ("comm", 3),
]
WRONG += [("supports", ["clamp"]), ("attached", 3), ("parts", []), ("parts", 3), ("root", "none")]


@pytest.mark.parametrize(("option", "value"), WRONG)
def test_wrong_arguments_are_named_before_a_deck_is_looked_for(tmp_path, option, value):
    with pytest.raises(ao.InputError, match=f"{option} must be"):
        ao.read_model(tmp_path / "part.inp", **{option: value})


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")  # a metre for a millimetre
@pytest.mark.parametrize(
    "deck", ["bar.bdf", "plate.bdf", "cantilever.inp", "block.inp", "layers.inp", "excentric"]
)
def test_frequencies_do_not_depend_on_the_unit_of_a_deck(tmp_path, deck):
    """K and M both scale with force over length: in any unit K φ = ω²M φ is the same problem."""
    path = DECKS / deck
    if deck == "excentric":
        path = tmp_path / "bar.bdf"
        path.write_text(EXCENTRIC)
    in_metres, doubled = (ModeSolver(ao.read_model(path, unit=u)).lowest(4) for u in ("m", 2.0))
    np.testing.assert_allclose(doubled.omega[:4], in_metres.omega[:4], rtol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tube.inp", "tube_mixed.inp"])
def test_a_support_holds_what_lies_between_its_nodes(tmp_path, name):
    text = (DECKS / name).read_text() + "*SOLID SECTION, ELSET=TUBE, MATERIAL=M\n" + MATERIAL
    tube = model_of(tmp_path, text + "*BOUNDARY\nFOOT, PINNED\n")
    by_hand = ao.Structure(
        tube.mesh, ao.Solid(1e9, 0.3, 1000.0), [ao.Support(lambda x: np.isclose(x[1], 0))]
    )
    assert tube.dofs == by_hand.dofs
    assert tube.mass == pytest.approx(1000 * np.pi / 8 * 3, rel=2e-4)


@pytest.mark.slow
def test_a_beam_deck_in_millimetres_is_the_beam_in_metres():
    with pytest.warns(
        ao.AntioscWarning, match=r"not taken: 1 \*CLOAD .line 35.*1 \*PLASTIC .*1 \*S"
    ):
        beam = ao.read_model(DECKS / "cantilever.inp", unit="mm")
    E, G, L, b, h = 210e9, 210e9 / 2.6, 0.2, 0.01, 0.02
    assert beam.mass == pytest.approx(7850 * L * b * h + 0.2, rel=1e-12)
    A = b * h
    for direction, width, height, spring in (((0, 1, 0), b, h, 0), ((0, 0, 1), h, b, 12500)):
        tip = ao.Site((L, 0, 0), direction)
        bending = width * height**3 / 12
        exact = 1 / (L**3 / (3 * E * bending) + L / (5 / 6 * G * A)) + spring
        assert stiffness(beam, tip) == pytest.approx(exact, rel=1e-9)
        model = ao.extract(beam, tip, n=8)
        assert model.k0 == pytest.approx(exact, rel=1e-8)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the facets at the site")  # one cell is as wide as the block
def test_a_solid_deck_has_its_materials_and_supports():
    with pytest.warns(ao.AntioscWarning, match=r"not taken: 1 \*STEP"):
        block = ao.read_model(DECKS / "block.inp", unit="mm")
    assert block.mass == pytest.approx(1e-6 * (7800 + 2700), rel=1e-12)
    mesh = ao.read_mesh(DECKS / "block.inp", unit="mm")
    steel, alu = ao.Solid(210e9, 0.3, 7800.0), ao.Solid(70e9, 0.33, 2700.0)
    supports = [
        ao.Support(lambda x: np.isclose(x[2], 0)),
        ao.Support(lambda x: np.isclose(x[0], 0), "x"),
    ]
    by_hand = ao.Structure(mesh, {"LOWER": steel, "UPPER": alu}, supports)
    assert block.dofs == by_hand.dofs
    site = ao.Site((0.01, 0.005, 0.015), (-1, 0, 0), radius=5e-3)
    assert stiffness(block, site) == pytest.approx(stiffness(by_hand, site), rel=1e-10)
    assert ao.extract(block, site, n=6).k0 == pytest.approx(stiffness(block, site), rel=1e-8)
