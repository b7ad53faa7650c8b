"""Decks as structures: materials, sections, units and supports against closed forms and solves."""

from __future__ import annotations

import warnings
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


@pytest.mark.slow
def test_of_separate_pieces_one_is_read(tmp_path):
    """The error names what chooses one."""
    other = "GRID,4,,0.,900.,0.\nGRID,5,,9.,900.,0.\nCBAR,9,2,4,5,0.,0.,1.\n"
    other += "PBAR,2,1,200.,6666.,1666.,4000.\n"
    (tmp_path / "bar.bdf").write_text(EXCENTRIC.replace("ENDDATA", other))
    with pytest.raises(ao.MeshError, match=r"2 pieces.*piece 1.*'2'"):
        ao.read_model(tmp_path / "bar.bdf", unit="mm")
    with pytest.warns(ao.AntioscWarning, match=r"piece 1 of 2 .*: 200 × 0 × 0 mm; 2.*: 9 × 0 × 0"):
        bar = ao.read_model(tmp_path / "bar.bdf", unit="mm", piece=1)
    assert bar.mass == pytest.approx(7850 * 0.2 * 200e-6)
    with pytest.raises(ao.InputError, match="piece"):
        ao.read_model(tmp_path / "bar.bdf", piece=0)


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
def test_a_layered_deck_stacks_toward_the_normals_of_its_cells():
    plate = ao.read_model(DECKS / "layers.inp")
    ply = (140e9, 10e9, 0.3, 5e9, 5e9, 3e9, 1600.0, 0.001)
    core = ao.Layer.isotropic(1e9, 0.3, 100.0, 0.002)
    layers = [ao.Layer(*ply), core, ao.Layer(*ply, angle=45)]
    # normals are downward: from y, 30° about the orientation's own z
    axis = (-np.sin(np.pi / 6), np.cos(np.pi / 6), 0)
    by_hand = ao.Structure(
        ao.read_mesh(DECKS / "layers.inp", gdim=3),
        ao.Laminate(layers, axis, (0, 0, -1)),
        [ao.Support(lambda x: np.isclose(x[0], 0))],
    )
    assert plate.mass == pytest.approx(2 * (2 * 1.6 + 0.2), rel=1e-12)
    assert plate.dofs == by_hand.dofs
    site = ao.Site((1.2, 0.5, 0), (0, 0, 1))
    assert stiffness(plate, site) == pytest.approx(stiffness(by_hand, site), rel=1e-9)


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


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:of block.inp are not taken")
def test_one_strength_of_several_materials_is_told():
    """The block is of steel and aluminium; the other deck is of one material."""
    each = "E = 70.0 GPa, 2700 kg/m³, E = 210 GPa, 7800 kg/m³"
    told = rf"yield strength 250 MPa is taken for all 2 materials of block.inp \({each}\)"
    with pytest.warns(ao.AntioscWarning, match=told):
        ao.read_model(DECKS / "block.inp", unit="mm", yield_strength=250e6)
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        ao.read_model(DECKS / "block.inp", unit="mm")
        ao.read_model(DECKS / "c3d8.inp", yield_strength=250e6)
    assert not any("is taken for all" in str(one.message) for one in raised)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:of block.inp are not taken", "ignore:the yield strength")
def test_a_strength_by_name_is_that_of_all_materials():
    path = DECKS / "block.inp"
    block = ao.read_model(path, unit="mm", yield_strength="steel S235")
    own = ao.material("steel S235")
    for one, _ in block.matrices.parts:
        assert (one.yield_strength, one.yield_range) == (own.yield_strength, own.yield_range)
    with pytest.raises(ao.InputError, match="yield"):
        ao.read_model(path, unit="mm", yield_strength="concrete C30/37")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:of block.inp are not taken", "ignore:the facets at the site")
@pytest.mark.filterwarnings("ignore:the yield strength 250 MPa is taken for all")
def test_a_deck_with_a_yield_strength_knows_from_which_force_it_yields():
    """Hertz: F = (π p0)³ R²/(6 E*²), p0 from von Mises below a ball (Johnson, eq. 3.45)."""
    block = ao.read_model(DECKS / "block.inp", unit="mm", yield_strength=250e6)
    site = ao.Site((0.005, 0.005, 0.02), (0, 0, -1), radius=2e-3)
    ball = ao.Sphere(radius=0.01, material="bearing steel 100Cr6", velocity=1.0)
    hit = ao.simulate(ao.extract(block, site, n=6), ball, duration=1e-4)
    steel, upper = ao.material("bearing steel 100Cr6"), ao.Solid(70e9, 0.33, 2700.0)
    one, other = ((1 - m.nu**2) / m.E for m in (steel, upper))
    z = np.linspace(0.1, 1.0, 10001)
    across = (1 + upper.nu) * (1 - z * np.arctan(1 / z)) - 0.5 / (1 + z**2)
    p0 = 250e6 / np.max(1 / (1 + z**2) - across)
    force = (np.pi * p0) ** 3 * ball.radius**2 * (one + other) ** 2 / 6
    assert hit.law.yield_force == pytest.approx(force, rel=1e-3)
    assert "The contact yields: a dent of" in hit.verdict
