"""The live page of a report: its scripts, the blow that it repeats, and its verdict.

The data of the page are those of one impact of `simulate` or `strike`, or of a map; `live_meshes`
adds the struck part and the sites of a map.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from antiosc import (
    ContactLaw,
    Damping,
    ElasticPlastic,
    History,
    ImpactMap,
    LinearBody,
    ModalBody,
    SceneHistory,
)
from antiosc.base._types import Array
from antiosc.base.texts import capitalised, engineering, percent, point_text
from antiosc.engine import library
from antiosc.engine.contact.base import Compiled, is_compiled
from antiosc.engine.contact.dent import RIM
from antiosc.engine.contact.laws import Hysteretic
from antiosc.extension import QUANTITIES, ErrorBudget, hardest, softest_model, trusted
from antiosc.models.body import info_of, site_points

if TYPE_CHECKING:
    from antiosc import PeakField, Structure


#: What the page reads: numbers, texts, arrays, lists and tables of them.
Data: TypeAlias = dict[str, Any]

FOLDER = Path(__file__).with_name("page")
#: In the order in which they need each other.
SCRIPTS = ("units", "engine", "data", "view", "part", "map", "chart", "verdict", "page", "fall")
#: What begins: the page of a report, whose data lie in it, or that of `antiosc open`.
REPORT, OPEN = "start", "open"
#: The kinds of arrays on the page; JavaScript's names of them are in data.js.
KINDS = {"<f8": "f8", "<f4": "f4", "<i2": "i2", "<u4": "u4", "|u1": "u1"}


def script(begin: str = REPORT) -> str:
    """All of a page's program."""
    text = "\n".join((FOLDER / f"{name}.js").read_text("utf-8") for name in (*SCRIPTS, begin))
    return f'(() => {{\n"use strict";\n{text}}})();\n'


def style() -> str:
    """The page's style."""
    return (FOLDER / "page.css").read_text("utf-8")


def engine() -> bytes:
    """The march for WebAssembly; packaging/library.py --page makes it."""
    return (FOLDER / "engine.wasm").read_bytes()


def policy(program: str) -> str:
    """The Content-Security-Policy: this program runs, and nothing is fetched."""
    digest = base64.b64encode(hashlib.sha256(program.encode()).digest()).decode("ascii")
    own = f"script-src 'sha256-{digest}' 'wasm-unsafe-eval'"
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; {own}"


def embedded(data: Data) -> str:
    """Data as JSON that may stand in a script element: no text in it can end that."""
    text = json.dumps(
        plain(data, _packed), allow_nan=False, separators=(",", ":"), ensure_ascii=True
    )
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def plain(value: object, of_array: Callable[[Array], object] = np.ndarray.tolist) -> object:
    """A value of JSON; NaN and infinity become None, and arrays what `of_array` returns."""
    if isinstance(value, Mapping):
        return {str(key): plain(each, of_array) for key, each in value.items()}
    if isinstance(value, bytes):
        value = np.frombuffer(value, dtype=np.uint8)
    if isinstance(value, np.ndarray):
        return plain(of_array(value), of_array)
    if isinstance(value, list | tuple):
        return [plain(each, of_array) for each in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if value is None or isinstance(value, int | str) else str(value)


def _packed(values: Array) -> Data:
    """An array as base64 text with its kind."""
    own = np.ascontiguousarray(values)
    own = own.astype(own.dtype.newbyteorder("<"))
    text = base64.b64encode(own.tobytes()).decode("ascii")
    return {"$": KINDS[own.dtype.str], "of": text}


#: Relative error of the forces of the runs on the page, and of those that colour a map.
TOL, COARSE = 1e-6, 1e-3
#: Nodes of the curve of the computed case that the page keeps.
CURVE = 2000
#: Digits of an exponent.
SUPERSCRIPTS = str.maketrans("0123456789.-", "⁰¹²³⁴⁵⁶⁷⁸⁹·⁻")


def blow_of_history(hit: History, bars: ErrorBudget | None) -> Data | None:
    """The impact as data for the page; None where the page cannot repeat it.

    It repeats those of `simulate` and `strike`: one contact by a law of this package, apart at the
    start, under loads that do not change, without dampers that couple modes, of strikers that do
    not stretch. `bars`: its error budget, or empty.
    """
    if not isinstance(hit, History) or isinstance(hit, SceneHistory):
        return None
    system, law = hit.assembly.system, hit.assembly.laws[0]
    if not is_compiled(law) or system.breaks.size > 1 or system.pressed.any():
        return None
    # the page has modes that decay each for itself, and strikers that are linear
    if system.first is not None or "impactor" in hit.assembly.stretched:
        return None
    body, striker = hit.assembly.bodies["structure"], hit.assembly.bodies["impactor"]
    if not isinstance(body.modes, ModalBody) or not isinstance(striker.modes, ModalBody):
        return None
    loads = np.split(system.loads[0], [body.omega.size])
    local = law.compliance
    speed = abs(float(system.beta[0] @ system.v))
    return {
        **impact_data(law, modal_data(striker.modes, striker.start, loads[1]), hit.impactor, speed),
        "ratio": _ratio(hit.model),
        "gap": float(system.offsets[0, 0]),
        "duration": float(hit.run.time[-1]),
        "body": {**modal_data(body.modes, body.start, loads[0], local), "stretch": _stretch(hit)},
        "bars": _bars(hit, bars, local),
        "computed": _computed(hit),
    }


def impact_data(law: ContactLaw, striker: Data, impactor: LinearBody, speed: float) -> Data:
    """What does not depend on the site: the law, the striker, and where the sliders stand.

    None for what has no slider: the mass of a striker that vibrates, a measured law's stiffness.
    """
    assert isinstance(law, Compiled)
    values = law.parameters()
    rigid = striker["omega"].size == 1 and striker["omega"][0] == 0
    exponent = {library.LINEAR: 1.0}.get(law.kind, getattr(law, "exponent", 1.5))
    return {
        "tol": TOL,
        "coarse": COARSE,
        "law": {
            "kind": law.kind,
            "name": type(law).__name__,
            "params": finite_parameters(law),
            "unit": "N/m"
            if exponent == 1
            else f"N/m{format(exponent, 'g').translate(SUPERSCRIPTS)}",
            "yields": _yielding(law),
        },
        "striker": striker,
        "mass": 1 / float(striker["b"][0] ** 2) if rigid else None,
        "radius": getattr(impactor, "radius", None) if rigid else None,
        "speed": speed or None,
        "stiffness": None if law.kind == library.TABLE else values[0],
    }


def _yielding(law: ContactLaw) -> Data | None:
    """What the page says of a contact that yields; None of a law without a dent.

    strength : of the side that yields [Pa]; radius : of the sphere [m]; rim : of `Dent`.
    """
    if not isinstance(law, Hysteretic):
        return None
    if not isinstance(law, ElasticPlastic):
        return {}
    return {"strength": law.yield_strength, "radius": law.radius, "rim": RIM}


def finite_parameters(law: ContactLaw) -> list[float]:
    """Parameters of a law that JSON can hold: of Hertz's without the infinite end of its range."""
    assert isinstance(law, Compiled)
    return [value for value in law.parameters() if np.isfinite(value)]


def modal_data(
    body: ModalBody, start: Array | None = None, load: Array | None = None, local: float = 0.0
) -> Data:
    """A body in free modes, as `pose` of engine.js takes it; `local`: compliance of its patch."""
    zeros = np.zeros(body.omega.size)
    return {
        "omega": body.omega,
        "decay": zeros if body.decay is None else body.decay,
        "b": body.b,
        "v": zeros if start is None else start,
        "load": zeros if load is None else load,
        "r": body.r,
        "mobility": body.mobility,
        "local": local,
    }


def _stretch(hit: History) -> Data | None:
    """The rows of the part that stretch, its modes as rows, and the tensors; None: it is linear."""
    taken, system = hit.assembly.stretched.get("structure"), hit.assembly.system
    if taken is None:
        return None
    assert system.quadratic is not None
    assert system.cubic is not None
    return {
        "rows": system.beta[-taken.size :, hit.assembly.spans["structure"]].ravel(),
        "modes": taken.modes.T.ravel(),
        "quadratic": system.quadratic.ravel(),
        "cubic": system.cubic.ravel(),
    }


def _ratio(model: LinearBody) -> float | None:
    """The damping ratio of all modes, where the damping is just that; None of another damping."""
    damping = getattr(model, "damping", None)
    if damping is None:
        return 0.0
    plain = isinstance(damping, Damping) and isinstance(damping.ratio, float)
    return damping.ratio if plain and damping.alpha == damping.beta == 0 else None


def _bars(hit: History, budget: ErrorBudget | None, local: float) -> Data:
    """Relative errors by quantity and cause, and bodies for those of mesh and truncation.

    On the page the bar of such a cause grows as the difference that its body makes there.
    """
    if not budget:
        return {"shares": {}, "variants": {}, "word": ""}
    causes = budget.causes
    shares = {name: {c: getattr(bar, c) for c in causes} for name, bar in budget.items()}
    if not np.isfinite([v for own in shares.values() for v in own.values()]).all():
        return {"shares": {}, "variants": {}, "word": ""}
    model, variants = hit.model, {}
    moving = hit.assembly.bodies["structure"].start.any()
    linear = not hit.assembly.stretched
    if shares and linear and not moving and getattr(model, "strain_error", None) is not None:
        bodies = {"mesh": model.corrected(), "truncation": softest_model(model)}
        variants = {cause: modal_data(one.modal(), local=local) for cause, one in bodies.items()}
    return {"shares": shares, "variants": variants, "word": "numerical " if budget.law else ""}


def _computed(hit: History) -> Data:
    """The curve and the numbers of the computed case, which stay on the page."""
    time, force = hit.time, hit.force
    if time.size > CURVE:
        time = np.linspace(0.0, float(time[-1]), CURVE)
        force = hit.force_at(time)
    numbers = {name: float(getattr(hit, name)) for name in QUANTITIES}
    counts = {"restitution": hit.restitution, "contacts": len(hit.contacts)}
    counts["dent"] = 0.0 if hit.dent is None else hit.dent.depth
    return {"time": time, "force": force, **numbers, **counts}


#: The cause of the largest share of a bar -> what reduces it.
REMEDIES = {
    "mesh": "use smaller elements around the site",
    "truncation": "extract more anti-oscillators (n)",
    "time": "use a smaller tol",
    "patch": "choose another radius of the patch",
    "geometry": "use smaller or curved elements along the curved surface",
    "noise": "measure with less noise, or average more blows",
    "band": "measure up to a higher frequency",
    "model": "use solid elements in place of beams or shells",
    "stretch": "extract with a larger number of motions (stretch=)",
    "law": "give the yield strength of your material, and what it may be off by (yield_range)",
}
#: What is said of a striker, with its unit, and the word before it.
STRIKER_WORDS = {"mass": ("kg", "of"), "velocity": ("m/s", "at")}


class Headline(NamedTuple):
    """What struck what, its numbers (name, value with bar), and sentences of the verdict.

    `kinds` of the sentences tell the page what to say in their place when a slider is moved.
    """

    about: str
    numbers: list[tuple[str, str]]
    sentences: list[str]
    kinds: Sequence[str] = ()


def headline_of_history(
    hit: History,
    structure: Structure | None,
    budget: ErrorBudget | None,
    fields: Mapping[str, PeakField],
    worst: Data | None,
) -> Headline:
    """The headline of an impact of two bodies.

    `fields`: its `PeakField`s by quantity; `worst`: the largest stress of the picture, if known.
    """
    numbers = [
        (
            name.replace("_", " "),
            budget.shown(name, 3) if budget else engineering(getattr(hit, name), unit),
        )
        for name, unit in QUANTITIES.items()
    ]
    e = hit.restitution
    numbers.append(("restitution", "not defined" if e is None else f"{e:.3f}"))
    told = [
        ("contact", hit.verdict),
        *(("doubt" if i else "stress", s) for i, s in enumerate(_stresses(fields, worst))),
        ("energy", _absorbed(hit)),
        ("accuracy", _accuracy(budget)),
    ]
    kinds, sentences = zip(*(pair for pair in told if pair[1]), strict=True)
    return Headline(_struck(hit, structure), numbers, list(sentences), kinds)


def headline_of_map(found: ImpactMap) -> Headline:
    """The headline of a map."""
    numbers = [("sites", f"{len(found)}")]
    sentences = []
    if found.peak_force is not None and found.contact_time is not None:
        worst_site, own = hardest(found), trusted(found)
        high = float(found.peak_force[worst_site])
        for name, unit in (("peak_force", "N"), ("contact_time", "s")):
            ends = (float(end(getattr(found, name)[own])) for end in (np.nanmin, np.nanmax))
            text = " to ".join(engineering(each, unit) for each in ends)
            numbers.append((name.replace("_", " "), text))
        where = point_text(found.points[worst_site])
        sentences.append(f"The largest force, {engineering(high, 'N')}, arises at {where}.")
        if found.doubtful.any():
            sentences.append(f"{found.doubtful.sum()} doubtful sites are left out of these.")
    if found.peak_stress is not None:
        sentences.append(_most_dangerous(found))
    worst = float(found.error.max())
    sentences.append(
        f"The free modes leave an error of Z of at most {percent(worst)} up to"
        f" {engineering(found.band, 'Hz')}; the mesh's error is not estimated."
    )
    about = f"{_body(found.impactor)} strikes {_named(found.info.get('structure', 'a part'))}."
    return Headline(about if found.impactor else "Models over a surface", numbers, sentences)


def _most_dangerous(found: ImpactMap) -> str:
    """The place that a blow stresses most, and whether it yields."""
    assert found.peak_stress is not None
    assert found.stress_points is not None
    share = found.exposure
    i = hardest(found, of=found.peak_stress if share is None else share)
    text = (
        f"A blow at {point_text(found.points[i])} stresses the part most:"
        f" {engineering(found.peak_stress[i], 'Pa')} at {point_text(found.stress_points[i])}"
    )
    if share is None:
        return f"{text}; the material has no yield_strength to compare it with."
    count = int(np.sum(share >= 1))
    where = f"at {count} of {len(found)} sites" if count else "nowhere"
    return f"{text}, {share[i]:.3g} of the yield strength; yield is reached {where}."


def _struck(hit: History, structure: Structure | None) -> str:
    part = "a model" if structure is None else _named(structure.describe())
    places = list(site_points(hit.model).values())
    where = f" at {point_text(places[0])}" if len(places) == 1 else ""
    return f"{_body(hit.impactor)} strikes {part}{where}."


def _body(body: LinearBody | None) -> str:
    """A striker in words: "A sphere of 32.9 g at 2.00 m/s"."""
    kind = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(body).__name__).lower()
    text = [f"{'An' if kind[0] in 'aeiou' else 'A'} {kind}"]
    for name, (unit, word) in STRIKER_WORDS.items():
        value = getattr(body, name, None)
        if isinstance(value, float) and value:
            text.append(f"{word} {engineering(value, unit)}")
    return " ".join(text)


def _named(described: str) -> str:
    """What `Structure.describe` begins with: the name of the mesh, without its numbers."""
    return re.split("[:,]", described, maxsplit=1)[0]


def _stresses(fields: Mapping[str, PeakField], worst: Data | None) -> list[str]:
    """Whether strengths are reached, and where; else the largest stress of the picture."""
    sentences = []
    for peak in fields.values():
        if peak.exposure is not None:
            sentences.append(f"{capitalised(peak.margin().sentence)}.")
        if peak.doubt:
            sentences.append(f"{capitalised(peak.doubt).rstrip('.')}.")
    if not fields and worst is not None:
        value, time = engineering(worst["value"], "Pa"), engineering(worst["time"], "s")
        sentences.append(
            f"The largest von Mises stress is about {value} at {point_text(worst['place'])},"
            f" {time}; the material has no yield_strength to compare it with."
        )
    return sentences


def _absorbed(hit: History) -> str:
    """The share of the striker's energy that stays in the part."""
    if len(hit.assembly.bodies) != 2 or not hit.contacts:
        return ""
    striker = list(hit.at([0.0, hit.time[-1]]).values())[1]
    before, after = (float(striker.kinetic[k] + striker.strain[k]) for k in (0, -1))
    if before <= 0 or after > before:
        return ""
    return (
        f"Of the striker's {engineering(before, 'J')}, {percent(1 - after / before)} stay in the"
        " part and the contact."
    )


def _accuracy(budget: ErrorBudget | None) -> str:
    """What limits the accuracy, and what to do."""
    if budget is None:
        return (
            "There is no error bar, for the mesh's error is not estimated:"
            ' error="estimate" of extract gives one.'
        )
    bar = budget["peak_force"]
    cause = max(budget.causes, key=lambda name: getattr(bar, name))
    largest = (
        f"The largest part of the bar of the peak force comes from the {cause},"
        f" {percent(getattr(bar, cause))}: to narrow it, {REMEDIES[cause]}."
    )
    return f"{budget.law} {largest}".lstrip()


#: Density [kg/m^3] of the ball as which a striker of unknown size is drawn.
STEEL = 7850.0


def caption(data: Data) -> str:
    """What the picture of the set-up shows, in words."""
    if "fall" in data:
        return "Drag to turn; red: the impacts, click one."
    text = "Drag to turn; dark: held by supports; the arrow is the direction of impact."
    place = data.get("place")
    if place and place["radius"] and not data["blow"]["radius"]:
        text += " The striker is drawn as a steel ball of its mass."
    return text


def striker_place(hit: History, own: Data) -> Data | None:
    """The place of the striker in the picture; None for a site without coordinates."""
    points, direction = list(site_points(hit.model).values()), info_of(hit.model).direction
    if len(points) != 1 or len(points[0]) != 3 or direction is None or len(direction) != 3:
        return None
    radius, mass = own["radius"], own["mass"]
    if radius is None and mass is not None:
        radius = (mass / (STEEL * 4 / 3 * pi)) ** (1 / 3)
    return {"point": list(points[0]), "direction": list(direction), "radius": radius}
