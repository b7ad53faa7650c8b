"""What strikes and what is held stands in the table of a run, and in its report."""

from __future__ import annotations

import re

import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("jinja2")

from scene_files import BEAM, BODIES, antiosc, objects, written

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]
#: A box of 100 x 60 x 20 mm.
BOX = """\
[geometry]
source = "box.geo"
size = 0.02
order = 1
[material]
name = "aluminium 6061-T6"
[structure]
order = 1
{supports}
[sites.top]
point = [0.05, 0.03, 0.02]
direction = {direction}
radius = 0.01
[extract]
n = 4
{striker}
[simulate]
duration = 2e-4
"""
BALL = '[impactor]\nkind = "Sphere"\nradius = 0.01\nvelocity = 1.5\nmaterial = "steel S235"\n'
BLUNT = (
    '[impactor]\nkind = "RigidMass"\nmass = 0.5\nvelocity = 1\ntip_radius = 0.02\nE = 2e9\nnu = 0.3'
)
SIDE = '[[supports]]\nwhere = "-x"\n'
PLANES = """\
[[supports]]
plane = [[0, 0, 0], [0, 0, 1]]
fix = "z"
[[supports]]
near = [[0.1, 0, 0], 1e-3]
"""


def rows_of(tmp_path, capsys, text: str) -> dict[str, str]:
    """The rows of striker, direction and supports that a run prints, each of them once."""
    (tmp_path / "box.geo").write_text(
        'SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.1, 0.06, 0.02};'
    )
    path = written(tmp_path, text)
    report = tmp_path / "page.html"
    assert antiosc("run", path, "--report", report) == 0
    found = re.findall(r"^(striker|direction|held) +(.*)$", capsys.readouterr().out, re.M)
    assert len(dict(found)) == len(found)
    return dict(found)


@pytest.mark.parametrize(
    ("supports", "held"),
    [(SIDE, "-x: "), (PLANES, "plane z = 0 m along z, within 1.00 mm of (100, 0, 0) mm: ")],
)
@pytest.mark.slow
def test_a_run_tells_the_striker_and_the_supports(tmp_path, capsys, supports, held):
    text = BOX.format(supports=supports, direction="[0, 0, -1]", striker=BALL)
    rows = rows_of(tmp_path, capsys, text)
    mass = 7850 * 4 / 3 * 3.14159265 * 10**3 / 1e6  # g
    assert rows["striker"] == (f"sphere of {mass:.1f} g at 1.50 m/s, radius 10.0 mm, steel S235")
    part = objects(tmp_path / "scene.toml").structure
    dofs = len(
        part.fixed
    )  # three of a node, or z alone on the plane, and of its corner x and y too
    count = dofs // 3 if supports == SIDE else dofs - 2
    assert rows["held"] == f"{held}{count} nodes"
    assert "direction" not in rows


def test_an_oblique_blow_has_its_direction_and_a_free_part_is_told(tmp_path, capsys):
    oblique = "[0, 0.5, -0.8660254]"
    text = BOX.format(supports="", direction=oblique, striker=BLUNT)
    rows = rows_of(tmp_path, capsys, text)
    assert rows == {
        "striker": "rigid mass of 500 g at 1.00 m/s, tip radius 20.0 mm, E = 2.00 GPa",
        "direction": "(0, 0.5, -0.866), 30° from the normal",
        "held": "nothing: free",
    }
    page = re.sub("(?s)<script.*?</script>", "", (tmp_path / "page.html").read_text())
    assert page.count("tip radius 20.0 mm, E = 2.00 GPa") == 1
    assert page.count("500 g at 1.00 m/s") == 1  # in the headline
    assert page.count("nothing: free") == page.count("30° from the normal") == 1


def test_what_has_no_mesh_or_several_bodies_tells_what_is_known(tmp_path, capsys):
    assert rows_of(tmp_path, capsys, BEAM) == {"striker": "rigid mass of 50.0 g at 1.00 m/s"}
    assert rows_of(tmp_path, capsys, BODIES) == {}
