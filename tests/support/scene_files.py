"""Scene files for tests: a mass on a beam of given matrices, and a way to run the command."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from antiosc_app import cli
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import read_document
from antiosc_app.scene_file.run import SceneResults, make_results
from antiosc_app.scene_file.scene import COMMAND_STUDIES
from paths import DEMOS, MESHES

SCENES = DEMOS / "scenes"

#: The beam of given matrices, and the start of the table of its site.
MATRICES = f"""\
[matrices]
K = "{SCENES}/beam_K.mtx"
M = "{SCENES}/beam_M.mtx"
map = "{SCENES}/beam_nodes.txt"
[sites.middle]
node = 9
"""
#: The bracket, held at its clamp, and the site in its eye.
BRACKET = f"""\
[geometry]
source = "{MESHES}/bracket.msh"
order = 1
[material]
kind = "Solid"
E = 70e9
nu = 0.33
rho = 2700
[structure]
order = 1
[[supports]]
where = "clamp"
[sites.eye]
point = [0.020, 0.040, 0.075]
direction = [-0.2, -0.6, -0.8]
radius = 4e-3
snap = true
"""
# sections that scenes have in common
MASS = '[impactor]\nkind = "RigidMass"\nmass = 0.05\nvelocity = 1.0\n'
LAW = '[contact]\nkind = "Hertz"\nstiffness = 5e8\n'
HIT = f"{MASS}{LAW}[simulate]\nduration = 2e-3\n"
SITE = "[sites.a]\npoint = [0, 0, 0]\ndirection = [0, 0, 1]\n"
MATERIAL = '[{}]\nkind = "Solid"\nE = 7e10\nnu = 0.3\nrho = 2700\n'
DECK, MESH = '[deck]\npath = "part.inp"\n', '[geometry]\nsource = "part.msh"\n'
MODEL = '[model]\npath = "model.npz"\n'
BODIES = """\
[bodies.a]
kind = "RigidMass"
mass = 1.0
velocity = 1.0
[bodies.b]
kind = "Obstacle"
[[contacts]]
a = "a"
b = "b"
law = {kind = "Linear", stiffness = 1e6}
[run]
duration = 1e-3
"""
#: A complete scene of NumPy and SciPy alone, line by line.
BEAM = f"""\
title = "a mass on a beam"
{MATRICES}dof = "z"
[extract]
n = 6
{HIT}"""
PROBE = "[probes.quarter]\npoint = [0.2, 0.0, 0.0]\n"
SWEEP = "[sweep]\nimpactor.velocity = [0.5, 1.0, 2.0]\nsimulate.duration = [3e-3, 2e-3, 2e-3]\n"
FRAME = f"""\
{MATRICES}direction = [0, 0, -1]
[sites.end]
node = 14
direction = [0, 0, 1]
[bodies.ball]
kind = "Sphere"
radius = 0.01
E = 210e9
nu = 0.3
rho = 7850
velocity = 1
[bodies.stop]
kind = "Obstacle"
[[contacts]]
a = "structure:middle"
b = "ball"
law = {{ kind = "Hertz.from_radii", radii1 = 0.01, E1 = 210e9, nu1 = 0.3, E2 = 210e9, nu2 = 0.3 }}
[[contacts]]
a = "structure:end"
b = "stop"
law = {{ kind = "Linear", stiffness = 1e6 }}
gap = 1e-5
[run]
duration = 1e-3
[output]
plot = "svg"
"""
STRIKE = f"""\
{BRACKET}[impactor]
kind = "RigidMass"
mass = 0.03
velocity = 2.0
[contact]
kind = "Hertz"
stiffness = 1e9
[strike]
duration = 3e-4
tol = 0.5
"""
#: A box that falls, what it is asked for; a plate with sensors that tell a blow.
FALL = """\
[geometry]
source = "box.geo"
size = 0.06
[material]
kind = "Solid"
E = 70e9
nu = 0.33
rho = 2700
[drop]
height = 0.2
tilt = [10, 5, 0]
until = 1
modes = 3
corner_radius = 1e-3
floor = {friction = 0.3, material = {E = 30e9, nu = 0.2, rho = 2400}}
"""
ASKED = """\
[accelerometers.middle]
at = [0.06, 0.03, 0.03]
filter = "CFC1000"
[worst]
"""
BLOW = """\
[geometry]
source = "plate.geo"
size = 0.15
gdim = 3
[material]
kind = "Shell"
E = 210e9
nu = 0.3
rho = 7850.0
thickness = 4e-3
[[supports]]
where = "rim"
[sensors.left]
point = [0.07, 0.06, 0.0]
direction = [0, 0, 1]
[sensors.right]
point = [0.33, 0.08, 0.0]
direction = [0, 0, 1]
quantity = "velocity"
[impactor]
kind = "RigidMass"
mass = 0.3
velocity = 2.0
[contact]
kind = "Hertz"
stiffness = 4e7
[find]
signals = "signals.csv"
where = [[0.1, 0.1, 0.0], [0.3, 0.2, 0.0]]
direction = [0, 0, -1]
unknown = ["place"]
modes = 5
"""


def written(folder: Path, text: str, name: str = "scene.toml") -> Path:
    """A scene file."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def antiosc(*arguments: Any) -> int:
    """The exit code of the command, which tells all that it can."""
    command, *others = map(str, arguments)
    return cli.main([command, *others, *(["--verbose"] if command in COMMAND_STUDIES else [])])


def numbers(folder: Path) -> dict[str, Any]:
    """What result.json holds."""
    found: dict[str, Any] = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    return found


def objects(path: Path, command: str = "run") -> SceneResults:
    """What a scene makes when it runs, but for its stresses."""
    names = [name for name in COMMAND_STUDIES[command].made_fields if name != "stresses"]
    return make_results(compile_document(read_document(path)), names)


def table(path) -> dict[str, np.ndarray]:
    with path.open(newline="") as stream:
        head, *rows = csv.reader(stream)
    values = np.array([[float(cell or "nan") for cell in row] for row in rows])
    return dict(zip(head, values.T, strict=True))
