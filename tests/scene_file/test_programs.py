"""Scenes of every kind as the programs that they are, written as users of the API write them."""

from __future__ import annotations

import pytest

from antiosc.scene_file.read import read
from antiosc.scene_file.scene import compiled
from scene_files import (
    BODIES,
    DECK,
    HIT,
    LAW,
    MASS,
    MATERIAL,
    MATRICES,
    MESH,
    MODEL,
    SITE,
)

pytest.importorskip("dolfinx")

SPHERE = 'kind = "Sphere"\nradius = 0.01\nE = 2.1e11\nnu = 0.3\nrho = 7850\nvelocity = 1.0\n'
STRIKE = f"{MASS}{LAW}[strike]\nduration = 2e-3\ntol = 0.1\n"

# the same in Python
READ = 'structure = ao.read_model(path="part.inp")\n'
LOAD = 'model = ao.AntiOscillators.load(path="model.npz")\n'
AT = "ao.Site(point=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))"
SOLID = "ao.Solid(E=7e10, nu=0.3, rho=2.7e3)"
REDUCE = f"model = ao.extract(structure, {AT})\n"
BODY, HERTZ = (
    "impactor = ao.RigidMass(mass=0.05, velocity=1.0)\n",
    "contact = ao.Hertz(stiffness=5e8)\n",
)
SIMULATE = f"{BODY}{HERTZ}history = ao.simulate(model, impactor, contact, duration=2e-3)\n"
TOLD, SUMMARY = "print(structure.describe())\n", "print(history.summary())\n"
SWEPT = "print(batch.peak_force, batch.contact_time, batch.restitution)\n"
FOUND = "print({k: (v.min(), v.max()) for k, v in found.quantities().items()})\n"
STRUCK = f"""\
{BODY}{HERTZ}history = ao.strike(
    {{}},
    {AT},
    impactor,
    contact,
{{}}    duration=2e-3,
    tol=0.1,
)
model = history.model
"""
OWN = "structure = history.structure\n"

#: (scene, command, program)
PROGRAMS = {
    "deck": (f'{DECK}unit = "mm"\n{SITE}{HIT}', "run",
             READ.replace(")", ', unit="mm")') + REDUCE + SIMULATE + TOLD + SUMMARY),
    "mesh": (
        MESH + MATERIAL.format("material") + SITE + '[structure]\norder = 2\n[[supports]]\n'
        'where = "foot"\nfix = ["x", "y"]\n[[attached]]\nkind = "PointMass"\nwhere = [0, 0, 1]\n'
        f"mass = 2\n[extract]\nn = 5\n{HIT}[probes.tip]\npoint = [1, 0, 0]\n",
        "run",
        f"""\
mesh = ao.read_mesh(source="part.msh")
structure = ao.Structure(
    mesh,
    {SOLID},
    supports=[ao.Support(where="foot", fix=("x", "y"))],
    attached=[ao.PointMass(where=(0.0, 0.0, 1.0), mass=2.0)],
    order=2,
)
model = ao.extract(
    structure,
    {AT},
    n=5,
)
{SIMULATE}probes = {{"tip": ao.probe(structure, history, point=(1.0, 0.0, 0.0))}}
{TOLD}{SUMMARY}""",
    ),
    "materials": (
        MESH + MATERIAL.format("material.a") + MATERIAL.format("material.b") + SITE + HIT, "run",
        f"""\
mesh = ao.read_mesh(source="part.msh")
structure = ao.Structure(
    mesh,
    {{
        "a": {SOLID},
        "b": {SOLID},
    }},
)
{REDUCE}{SIMULATE}{TOLD}{SUMMARY}""",
    ),
    "model": (MODEL + HIT, "run", LOAD + SIMULATE + SUMMARY),
    "sweep": (
        f"{DECK}{SITE}{HIT}[sweep]\nimpactor.velocity = [1, 2.5]\n"
        "simulate.duration = [1e-3, 2e-3]\n", "sweep",
        f"""\
{READ}{REDUCE}impactors = ao.sweep(ao.RigidMass, mass=0.05, velocity=(1.0, 2.5))
{HERTZ}batch = ao.simulate_many(model, impactors, contact, duration=(1e-3, 2e-3))
{TOLD}{SWEPT}""",
    ),
    "sweep of laws": (
        f"{MODEL}{HIT}[sweep]\ncontact.stiffness = [1e8, 2e8]\n", "sweep",
        f"""\
{LOAD}{BODY}contacts = ao.sweep(ao.Hertz, stiffness=(1e8, 2e8))
batch = ao.simulate_many(model, impactor, contacts, duration=2e-3)
{SWEPT}""",
    ),
    "a law of each impactor": (
        f'{MODEL}[impactor]\n{SPHERE}[contact]\nkind = "impactor.hertz"\nE = 7e10\nnu = 0.33\n'
        "[simulate]\nduration = 2e-3\n[sweep]\nimpactor.radius = [0.01, 0.02]\n", "sweep",
        f"""\
{LOAD}impactors = ao.sweep(
    ao.Sphere,
    radius=(0.01, 0.02),
    E=2.1e11,
    nu=0.3,
    rho=7850.0,
    velocity=1.0,
)
contacts = [impactor.hertz(E=7e10, nu=0.33) for impactor in impactors]
batch = ao.simulate_many(model, impactors, contacts, duration=2e-3)
{SWEPT}""",
    ),
    "a law of the impactor": (
        f'{MODEL}[impactor]\n{SPHERE}[contact]\nkind = "impactor.hertz"\nE = 7e10\nnu = 0.33\n'
        "[simulate]\nduration = 2e-3\n", "run",
        f"""\
{LOAD}impactor = ao.Sphere(radius=0.01, E=2.1e11, nu=0.3, rho=7850.0, velocity=1.0)
contact = impactor.hertz(E=7e10, nu=0.33)
history = ao.simulate(model, impactor, contact, duration=2e-3)
{SUMMARY}""",
    ),
    "bodies": (
        BODIES, "run",
        f"""\
bodies = {{"a": ao.RigidMass(mass=1.0, velocity=1.0), "b": ao.Obstacle()}}
scene = ao.Scene(bodies, [ao.Contact(law=ao.Linear(stiffness=1e6), a="a", b="b")])
history = scene.run(duration=1e-3)
{SUMMARY}""",
    ),
    "scene": (
        DECK + SITE + BODIES.replace('"a"', '"structure:a"')
        + "[scene]\ngravity = [0, 0, -9.81]\n[[loads]]\n"
        'end = "structure:a"\ntimes = [0.0, 1.0]\nforces = [0.0, 1.0]\n[motion.a]\n'
        "velocity = [0, 0, 1]\n", "run",
        f"""\
{READ}model = ao.extract(
    structure,
    {{"a": {AT}}},
)
bodies = {{
    "structure": model,
    "a": ao.RigidMass(mass=1.0, velocity=1.0),
    "b": ao.Obstacle(),
}}
scene = ao.Scene(
    bodies,
    [ao.Contact(law=ao.Linear(stiffness=1e6), a="structure:a", b="b")],
    loads=[ao.Load(end="structure:a", times=(0.0, 1.0), forces=(0.0, 1.0))],
    motion={{"a": ao.Motion(velocity=(0.0, 0.0, 1.0))}},
    gravity=(0.0, 0.0, -9.81),
)
history = scene.run(duration=1e-3)
{TOLD}{SUMMARY}""",
    ),
    "strike of a file": (
        MESH + MATERIAL.format("material") + SITE + '[[supports]]\nwhere = "foot"\n' + STRIKE,
        "run",
        STRUCK.format('"part.msh"', f"    material={SOLID},\n"
                      '    supports=[ao.Support(where="foot")],\n') + OWN + TOLD + SUMMARY,
    ),
    "strike of a mesh": (
        MESH + "order = 1\n" + MATERIAL.format("material") + SITE + STRIKE, "run",
        'mesh = ao.read_mesh(source="part.msh", order=1)\n'
        + STRUCK.format("mesh", f"    material={SOLID},\n") + OWN + TOLD + SUMMARY,
    ),
    "strike of a deck": (DECK + SITE + STRIKE, "run",
                         READ + STRUCK.format("structure", "") + TOLD + SUMMARY),
    "map": (
        f'{DECK}{MASS}{LAW}[map]\nwhere = "top"\nduration = 1e-3\nn = 4\n', "map",
        f"""\
{READ}{BODY}{HERTZ}found = ao.impact_map(
    structure,
    impactor=impactor,
    contact=contact,
    where="top",
    duration=1e-3,
    n=4,
)
{TOLD}{FOUND}""",
    ),
    "map of a simulation": (
        f'{DECK}{SITE}{HIT}[map]\nwhere = "top"\n', "map",
        f"""\
{READ}{BODY}{HERTZ}found = ao.impact_map(
    structure,
    impactor=impactor,
    contact=contact,
    where="top",
    duration=2e-3,
)
{TOLD}{FOUND}""",
    ),
    "map of a structure": (f'{DECK}[map]\nwhere = "top"\n', "map",
                           f'{READ}found = ao.impact_map(structure, where="top")\n{TOLD}{FOUND}'),
    "parts": (
        '[parts.p.deck]\npath = "part.inp"\n[parts.q.geometry]\nsource = "part.msh"\n'
        + MATERIAL.format("parts.q.material") + '[[parts.q.supports]]\nwhere = "foot"\n[[joints]]\n'
        'kind = "Weld"\na = "p:x"\nb = "q:y"\n[at.q]\nshift = [0, 0, 1]\n[points]\n'
        f'hub = [1, 2, 3]\n[[supports]]\nwhere = "hub"\n{SITE}{HIT}', "run",
        f"""\
structure = ao.assemble(
    {{
        "p": ao.read_model(path="part.inp"),
        "q": ao.Structure(
            ao.read_mesh(source="part.msh"),
            {SOLID},
            supports=[ao.Support(where="foot")],
        ),
    }},
    joints=[ao.Weld(a="p:x", b="q:y")],
    at={{"q": ao.Placement(shift=(0.0, 0.0, 1.0))}},
    points={{"hub": (1.0, 2.0, 3.0)}},
    supports=[ao.Support(where="hub")],
)
{REDUCE}{SIMULATE}{TOLD}{SUMMARY}""",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", PROGRAMS)
def test_a_scene_is_the_program_that_users_write(tmp_path, monkeypatch, case):
    text, command, program = PROGRAMS[case]
    monkeypatch.chdir(tmp_path)
    for name in ("part.msh", "part.inp", "model.npz"):
        (tmp_path / name).write_text("not read")
    (tmp_path / "scene.toml").write_text(text)
    found = compiled(read("scene.toml"))
    assert found.program(command).text() == f"import antiosc as ao\n\n{program}"
    done = {"run": ["antiosc run"], "sweep": ["antiosc run", "antiosc sweep"]}
    done["map"] = ["antiosc run", "antiosc map"] if "[simulate]" in text else ["antiosc map"]
    assert found.does() == done[command]


def test_the_files_of_a_scene_lie_beside_it(tmp_path):
    (tmp_path / "scene.toml").write_text(f"{MATRICES}dof = 1\n")
    found = read(tmp_path / "scene.toml")
    assert found.file("../part.msh") == str(tmp_path.parent / "part.msh")
