"""Mistakes between the sections of a scene, each by its whole sentence and line, and programs."""

from __future__ import annotations

import pytest

from antiosc.scene_file.problems import SceneFileError
from antiosc.scene_file.read import read
from antiosc.scene_file.scene import Compiled, compiled
from scene_files import BODIES, DECK, HIT, MATERIAL, MATRICES, MESH, MODEL, SITE

pytest.importorskip("dolfinx")

MAT = MATERIAL.format("material")


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A scene file in the working folder, beside files that are not opened."""
    monkeypatch.chdir(tmp_path)
    for name in ("part.msh", "part.inp", "model.npz"):
        (tmp_path / name).write_text("not read")

    def of(text: str) -> Compiled:
        (tmp_path / "scene.toml").write_text(text)
        return compiled(read("scene.toml"))

    return of


#: Scenes, and the line and sentence of each mistake.
WRONG = {
    "two sources": (
        DECK + MODEL + HIT,
        [
            (1, "the scene has no site: give [sites.NAME] with point and direction."),
            (3, "[deck] and [model] both say what is struck; keep one of them."),
        ],
    ),
    "nothing": (
        HIT,
        [
            (1, "the scene does not say what is struck: give one of [geometry], [deck], "
                "[matrices], [parts], [model]."),
        ],
    ),
    "joints": (
        MODEL + HIT + '[[joints]]\nkind = "Weld"\na = "x"\nb = "y"\n[at.x]\n'
        '[points]\np = [0, 0, 0]\n[assembly]\n',
        [
            (12, "[joints] belongs to an assembly; this scene has no [parts.NAME]."),
            (16, "[at] belongs to an assembly; this scene has no [parts.NAME]."),
            (17, "[points] belongs to an assembly; this scene has no [parts.NAME]."),
            (19, "[assembly] belongs to an assembly; this scene has no [parts.NAME]."),
        ],
    ),
    "beside deck": (
        DECK + SITE + HIT + MAT + '[structure]\norder = 1\n[[supports]]\nwhere = "x"\n',
        [
            (15, "[material] has no place beside [deck]: a deck has its own materials."),
            (20, "[structure] has no place beside [deck]: a deck has its own materials."),
        ],
    ),
    "beside model": (
        MODEL + HIT + MAT + '[[supports]]\nwhere = "x"\n[[attached]]\n',
        [
            (12, "[material] has no place beside [model]: a saved model has its own."),
            (17, "[supports] has no place beside [model]: a saved model has its own."),
            (19, "[attached] has no place beside [model]: a saved model has its own."),
        ],
    ),
    "no material": (
        MESH + SITE + HIT,
        [
            (1, "there is no [material]; it takes kind and the constants, as in `[material]` "
                '`kind = "Solid"`.'),
        ],
    ),
    "sites of a model": (
        MODEL + SITE + HIT,
        [
            (3, "[sites] belong to a structure; this scene has none of its own."),
        ],
    ),
    "no site": (
        DECK + HIT,
        [
            (1, "the scene has no site: give [sites.NAME] with point and direction."),
        ],
    ),
    "two sites": (
        DECK + SITE + SITE.replace(".a", ".b") + HIT,
        [
            (3, "[simulate] takes one site, and there are several: give [[contacts]] between "
                '"structure:SITE" and [bodies.NAME].'),
        ],
    ),
    "one": (
        MODEL + HIT + '[scene]\n[base]\n[[loads]]\n[motion.a]\n',
        [
            (12, "[scene] belongs to a scene of several contacts: give [[contacts]]."),
            (13, "[base] belongs to a scene of several contacts: give [[contacts]]."),
            (14, "[loads] belongs to a scene of several contacts: give [[contacts]]."),
            (15, "[motion] belongs to a scene of several contacts: give [[contacts]]."),
        ],
    ),
    "single and many": (
        BODIES + HIT,
        [
            (7, "[impactor] describes one impact and [contacts] a scene of several contacts; "
                "keep one of the two."),
        ],
    ),
    "no impactor": (
        MODEL + '[simulate]\nduration = 1e-3\n',
        [
            (1, "the scene has no [contact], the contact law between structure and impactor: "
                "give its kind."),
            (1, "the scene has no [impactor], what strikes the structure: give its kind."),
        ],
    ),
    "strike": (
        DECK + SITE + HIT + '[strike]\nduration = 1e-3\ntol = 0.1\n[extract]\nn = 3\n',
        [
            (13, "[strike] chooses what [simulate] says; keep one of the two."),
            (18, "[strike] chooses what [extract] says; keep one of the two."),
        ],
    ),
    "strike of a model": (
        MODEL + HIT.replace("[simulate]", "[strike]"),
        [
            (10, "[strike] needs a structure and one site, [sites.NAME]."),
        ],
    ),
    "strike of two": (
        DECK + SITE + SITE.replace(".a", ".b") + HIT.replace("[simulate]", "[strike]"),
        [
            (16, "[strike] needs a structure and one site, [sites.NAME]."),
        ],
    ),
    "structure": (
        DECK + SITE + BODIES + '[bodies.structure]\nkind = "Obstacle"\n',
        [
            (18, "the body 'structure' is the structure of this scene."),
        ],
    ),
    "ends": (
        DECK + SITE + BODIES.replace('a = "a"', 'a = "structure:x"').replace('b = "b"', 'b = "c"'),
        [
            (13, "contacts[0].a: the site of 'structure' 'x' does not exist. There is a."),
            (14, "contacts[0].b: the body 'c' does not exist. There is structure, a, b."),
        ],
    ),
    "end without site": (
        DECK + SITE + BODIES.replace('a = "a"', 'a = "structure"'),
        [
            (13, "contacts[0].a: the site of 'structure' '' does not exist. There is a."),
        ],
    ),
    "site of a mass": (
        BODIES.replace('a = "a"', 'a = "a:x"'),
        [
            (8, "contacts[0].a: the site of 'a' 'x' does not exist. There is none."),
        ],
    ),
    "no run": (
        BODIES.replace('[run]\nduration = 1e-3\n', ''),
        [
            (1, "a scene of several contacts needs [run] with its duration."),
        ],
    ),
    "no contacts": (
        BODIES[:BODIES.index('[[contacts]]')]+'[run]\nduration = 1e-3\n',
        [
            (1, "a scene of several bodies needs [[contacts]]."),
        ],
    ),
    "law": (
        BODIES.replace('law = {kind = "Linear", stiffness = 1e6}', 'law = 3'),
        [
            (10, 'contacts[0].law must be a table, as law = {kind = "Hertz", stiffness = 1e9}.'),
        ],
    ),
    "no law": (
        BODIES.replace('law = {kind = "Linear", stiffness = 1e6}\n', ''),
        [
            (7, 'contacts[0].law must be a table, as law = {kind = "Hertz", stiffness = 1e9}.'),
        ],
    ),
    "contact": (
        'contacts = [3]\n' + BODIES[:BODIES.index('[[contacts]]')]+'[run]\nduration = 1e-3\n',
        [
            (1, "contacts[0] must be a table, [[contacts]]."),
        ],
    ),
    "loads": (
        BODIES + '[[loads]]\nend = "c"\ntimes = [0.0, 1.0]\nforces = [0.0, 1.0]\n'
        '[motion.c]\nvelocity = [0, 0, 1]\n',
        [
            (14, "loads[0].end: the body 'c' does not exist. There is a, b."),
            (17, "motion.c: the body 'c' does not exist. There is a, b."),
        ],
    ),
    "probes": (
        MODEL + HIT + '[probes.a]\npoint = [0, 0, 0]\n',
        [
            (12, "[probes] need a structure of this scene and its simulation."),
        ],
    ),
    "probes without": (
        DECK + SITE + '[probes.a]\npoint = [0, 0, 0]\n',
        [
            (6, "[probes] need a structure of this scene and its simulation."),
        ],
    ),
    "sweep": (
        BODIES + '[sweep]\nimpactor.mass = [1.0]\n',
        [
            (13, "[sweep] varies [impactor], [contact] and [simulate]; give all three."),
        ],
    ),
    "sweep law": (
        MODEL + HIT + '[sweep]\ncontact.stiffness = [1e8, 2e8]\n'
        'impactor.velocity = [1.0, 2.0, 3.0]\n',
        [
            (12, "the lists of [sweep] must be equally long; got contact.stiffness: 2, "
                "impactor.velocity: 3."),
        ],
    ),
    "sweep kind": (
        MODEL + HIT.replace('"Hertz"\nstiffness = 5e8', '"impactor.hertz"') + '[sweep]\n'
        'contact.stiffness = [1e8]\nsimulate.n = [1]\n',
        [
            (7, "contact lacks 'E', a number."),
            (7, "contact lacks 'nu', a number."),
            (12, "[sweep] cannot vary [contact], whose kind is wrong or a law of the impactor; "
                'give a law by itself, as kind = "Hertz".'),
            (13, "sweep.simulate has no key 'n'. It takes duration, step, initial_velocity, "
                "gravity."),
        ],
    ),
    "sweep section": (
        MODEL + HIT + '[sweep]\nextract.n = [1]\nmodel = 3\n'
        'simulate.method = ["exact"]\nimpactor.mass = []\n',
        [
            (13, "[sweep] has lists of impactor, contact, simulate, as impactor.velocity = "
                "[1.0, 2.0]; got 'extract'."),
            (14, "[sweep] has lists of impactor, contact, simulate, as impactor.velocity = "
                "[1.0, 2.0]; got 'model'."),
            (15, "sweep.simulate has no key 'method'. It takes duration, step, "
                "initial_velocity, gravity."),
            (16, "sweep.impactor.mass must have 1 to 100000 values; got 0."),
        ],
    ),
    "sweep method": (
        MODEL + HIT + 'method = "exact"\n[sweep]\nimpactor.mass = [1.0]\n',
        [
            (12, "[simulate] has 'method', which a sweep does not take; it takes duration, "
                "step, tol, initial_velocity, gravity, max_contacts, max_steps."),
        ],
    ),
    "empty sweep": (
        MODEL + HIT + '[sweep]\n',
        [
            (12, "[sweep] holds no list of values, as impactor.velocity = [1.0, 2.0]."),
        ],
    ),
    "map": (
        MODEL + HIT + '[map]\non = "x"\n',
        [
            (12, "[map] needs a structure of [geometry], [deck] or [parts]."),
            (13, "map has no key 'on'; did you mean 'n' (a whole number: Anti-oscillators at "
                "each site, by the Krylov method on the free modes)? It takes where, "
                "duration, direction, radius, n, modes, band, accuracy."),
        ],
    ),
    "parts": (
        '[parts.a]\nsource = 3\n[parts]\nb = 2\n' + SITE,
        [
            (1, "parts.a lacks a geometry or a deck."),
            (2, "[parts.a] has no section 'source'; did you mean [structure], options of the "
                "structure? There is geometry, deck, material, supports, attached, structure."),
            (4, "parts.b must be a table, [parts.b]."),
        ],
    ),
    "parts2": (
        '[parts.a.deck]\npath = "part.inp"\n[parts.b.geometry]\nsource = "part.msh"\n'
        '[[joints]]\nkind = "Weld"\na = "c:x"\nb = "b:y"\n[at.d]\nshift = [0, 0, 1]\n' + SITE,
        [
            (3, "there is no [parts.b.material]; it takes kind and the constants, as in "
                '`[parts.b.material]` `kind = "Solid"`.'),
            (7, "joints[0].a: the part 'c' does not exist. There is a, b."),
            (9, "at.d: the part 'd' does not exist. There is a, b."),
        ],
    ),
    "material beside parts": (
        '[parts.a.deck]\npath = "part.inp"\n' + MAT + SITE,
        [
            (3, "[material] has no place beside [parts]: each part has its own: "
                "[parts.NAME.material]."),
        ],
    ),
    "material beside matrices": (
        MATRICES + 'dof = "z"\n' + MAT,
        [
            (8, "[material] has no place beside [matrices]: matrices have their own; fix "
                'nodes by supports = {12 = "all"} in [matrices].'),
        ],
    ),
    "fix": (
        MESH + MAT + SITE + '[[supports]]\nwhere = "x"\nfix = ["x", "w"]\n'
        '[[supports]]\nwhere = "y"\nfix = "q"\n',
        [
            (13, "supports[0].fix: the component 'w' does not exist. There is all, x, y, z, "
                "rx, ry, rz."),
            (16, "supports[1].fix: the component 'q' does not exist. There is all, x, y, z, "
                "rx, ry, rz."),
        ],
    ),
    "wrong forms": (
        'title = 3\ngeometry = 1\nsupports = 2\n[[sites]]\npoint = 1\n',
        [
            (1, "there is no [material]; it takes kind and the constants, as in `[material]` "
                '`kind = "Solid"`.'),
            (1, 'title must be a text in "quotes".'),
            (2, "geometry must be a table, [geometry]."),
            (3, "supports must be a list of tables, [[supports]]."),
            (4, "sites must be a table of names, [sites.NAME]."),
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_every_mistake_is_told_with_its_line(scene, case):
    text, told = WRONG[case]
    with pytest.raises(SceneFileError) as caught:
        scene(text)
    assert str(caught.value).splitlines() == [
        f"scene.toml:{line}: {sentence}" for line, sentence in told
    ]


RUNS = {
    "simulate": MODEL + HIT + 'n = "auto"\n',
    "extract": MATRICES + 'dof = "z"\n[extract]\nn = 0\n' + HIT,
    "damping": MATRICES + 'dof = "z"\n[extract]\ndamping = [0.02, 0.01]\n' + HIT,
}


@pytest.mark.parametrize("case", RUNS)
def test_a_value_is_checked_by_the_rule_of_its_function(scene, case):
    """A number of anti-oscillators may be "auto" for one function, 0 for another."""
    scene(RUNS[case])


@pytest.mark.parametrize("damping", ["5", "[0.02, 2]", "{ratio = 5.0}"])
def test_a_damping_ratio_in_per_cent_is_told_with_its_line(scene, damping):
    with pytest.raises(SceneFileError, match=r"scene.toml:9: .*0\.05 is 5 %"):
        scene(f'{MATRICES}dof = "z"\n[extract]\ndamping = {damping}\n{HIT}')
