"""The commented scene that `antiosc new` writes."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

import antiosc
from antiosc import checks
from antiosc.errors import AntioscError, InputError
from antiosc.scene_file.build import Call
from antiosc.scene_file.group_names import Outline, outline

#: Endings of decks, which describe materials and supports themselves.
DECK_ENDINGS = {".inp", ".bdf", ".nas", ".fem", ".dat"}

HEAD = """\
# A scene of antiosc: what strikes what, and how. All numbers are in SI units.
# Lines that begin with # are comments. Paths begin at the folder of this file.
#
#   antiosc check {name}              looks for mistakes, without meshing
#   antiosc run {name} --dry-run      tells what a run will cost
#   antiosc run {name} --report report.html

title = "A first scene"
"""

GEOMETRY_SECTION = """
# -- the structure: a mesh (.msh, .vtu, .unv, …) or a CAD file (.step, .iges, .brep, .geo) --------
[geometry]
source = {source}
# unit = "mm"       # of the coordinates of a mesh; CAD files state their own
{size}       # largest element of a CAD file, m
# refine = [[[0.0, 0.0, 0.0], 1e-3]]    # small elements around a point: [point, size]

[material]
kind = "Solid"      # or Shell, Beam, Truss, Laminate, AnisotropicSolid
E = 210e9           # Young's modulus, Pa
nu = 0.3            # Poisson's ratio
rho = 7850.0        # density, kg/m³
# Groups of cells may have materials of their own: [material.GROUP] in place of [material].

[[supports]]                                        # one such table for each support
plane = {plane}          # the nodes on a plane: [point, normal]
# where = "clamp"                                   # or the nodes of a named group of the mesh
# fix = ["x", "z"]                                  # by default all components

# [[attached]]                                      # masses and springs
# kind = "PointMass"
# where = [0.1, 0.0, 0.0]
# mass = 0.2

# [structure]                                       # options: order, solver
"""

DECK = """
# -- the structure: a deck of Abaqus, CalculiX or Nastran, with its materials and supports --------
[deck]
path = {source}
unit = "mm"         # of the deck: mm, N, t, MPa

# [[supports]]      # more supports than those of the deck
# where = "clamp"
"""

REST = """
# In place of it: [matrices] (K and M of another program), [parts.NAME] with [[joints]] (an
# assembly, with [at.NAME], [points] and [assembly]), [deck], [geometry] or [model] (a model that
# was saved). docs/scene_files.md describes all sections.

[sites.tip]                         # where the structure is struck
point = {point}             # m
direction = [0.0, 0.0, -1.0]        # in which the impactor pushes
radius = 2e-3                       # of the patch over which the force is spread; beams need none
snap = true                         # the nearest point, 2 % of the part's size away or less

[extract]                           # the reduction to anti-oscillators
n = 20

# -- the impact -----------------------------------------------------------------------------------
[impactor]
kind = "Sphere"     # or RigidMass, Obstacle
radius = 0.01       # m
E = 210e9
nu = 0.3
rho = 7850.0
velocity = 1.0      # m/s, toward the structure

[contact]
kind = "impactor.hertz"     # Hertz's law of this sphere on a surface; or Hertz, Linear, …
E = 210e9                   # of the surface
nu = 0.3
# radii = 0.02              # radius of curvature of the surface, m; flat by default

[simulate]
duration = 1e-3     # s
# tol = 1e-3        # relative error of the force

# [strike] in place of [extract] and [simulate] chooses mesh, model and step for an error:
# [strike]
# duration = 1e-3
# tol = 0.05        # largest relative error of peak force, impulse and contact time

# A scene of several bodies has, in place of [impactor], [contact] and [simulate]:
# [bodies.NAME], [[contacts]], [run], and [scene], [motion.NAME], [[loads]], [base] where needed.

# -- what is written ------------------------------------------------------------------------------
# [probes.top]                      # points whose motion is wanted
# point = {point}

[output]
csv = true          # history.csv, probes.csv
json = true         # result.json
# plot = "png"      # pictures of the force and of the model
# fields = true     # series.pvd, for ParaView
# model = true      # model.npz, for [model] of other scenes

# -- many impacts ---------------------------------------------------------------------------------
# [sweep]                           # antiosc sweep: one run for each value
# impactor.velocity = [0.5, 1.0, 2.0]

# [map]                             # antiosc map: the same impact at many points
# where = "top"                     # a group of faces; without it the whole surface
# radius = 2e-3
"""


def text(name: str, part: str | None, around: Outline | None = None) -> str:
    """The scene as a text; `part` is the file of the structure, as the scene names it.

    `around`: its box; the site lies in the middle of its upper side.
    """
    source = part or "part.step"
    quoted = '"' + source.replace("\\", "\\\\").replace('"', '\\"') + '"'
    deck = Path(source).suffix.lower() in DECK_ENDINGS
    size = "size = 5e-3" if part is None or _cad(source) else "# size = 5e-3"
    body = DECK if deck else GEOMETRY_SECTION
    point, plane = [0.0, 0.0, 0.1], [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    if around is not None:
        low, high = around.low.tolist(), around.high.tolist()
        point = [*(float(f"{c:.4g}") for c in (around.low + around.high)[:2] / 2), high[2]]
        flat = low[2] == high[2]
        plane = [low, [1.0, 0.0, 0.0] if flat else [0.0, 0.0, 1.0]]
    rest = REST.replace("{point}", f"{point}")
    return HEAD.format(name=name) + body.format(source=quoted, size=size, plane=plane) + rest


def _cad(source: str) -> bool:
    return Path(source).suffix.lower() in {".step", ".stp", ".iges", ".igs", ".brep", ".geo"}


def _outline(part: str) -> tuple[Outline | None, list[str]]:
    """The outline of a file, and a sentence that tells it or why it is not known."""
    name = Path(part).name
    deck = Path(part).suffix.lower() in DECK_ENDINGS
    made = {"path": part, "unit": "mm"} if deck else {"source": part}
    try:
        found = outline(Call(antiosc.read_model if deck else antiosc.read_mesh, made))
    except (AntioscError, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else str(error).rstrip(".")
        return None, [f"the box of {name} is not known: {why}."]
    return found, [f"{name} reaches {found.text()}."]


def write(path: str | os.PathLike[str], part: str | None = None) -> tuple[Path, list[str]]:
    """Write a new scene file, complete or absent; its path, and what is told of the part.

    InputError if it exists.
    """
    target = checks.new_file("the scene file", path)
    around: Outline | None = None
    told: list[str] = []
    if part is not None:
        checks.path("the file of the part", part)
        around, told = _outline(part)
        part = os.path.relpath(part, target.parent)
    content = text(target.name, part, around)
    if not content.isprintable() and any(c not in "\n" and not c.isprintable() for c in content):
        raise InputError(f"the name {checks.shown(part or target.name)} has control characters.")
    beside = target.with_name(f".antiosc-{secrets.token_hex(6)}.toml")
    try:
        with beside.open("x", encoding="utf-8") as stream:
            stream.write(content)
        try:
            os.link(beside, target)  # fails if the target exists; a rename would replace it
        finally:
            beside.unlink()
    except FileExistsError:
        raise InputError(
            f"{str(target)!r} exists already, and is left as it is; choose another name."
        ) from None
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {error.strerror}.") from None
    return target, told
