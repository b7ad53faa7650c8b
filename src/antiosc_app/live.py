"""The live page of a report: its scripts, the impact that it repeats, and its verdict.

The page's data are those of one impact of `simulate` or `strike`, or of a map; `live_meshes` adds
the struck part and the sites of a map.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np

from antiosc import (
    IMPACTORS,
    ContactLaw,
    Damping,
    ElasticPlastic,
    History,
    ImpactMap,
    LinearBody,
    ModalBody,
    SceneHistory,
    YangSun,
    named_impactor,
    simulate,
)
from antiosc.base import materials
from antiosc.base._types import Array
from antiosc.base.errors import NARROWING, AntioscError, InputError, warnings_to
from antiosc.base.texts import (
    COMPARED,
    SMALLER_CELLS,
    capitalised,
    engineering,
    exceeds,
    percent,
    plus_minus,
    point_text,
    restitution_text,
    rounded_down,
    where_to_change,
)
from antiosc.engine import library
from antiosc.engine.contact.base import Compiled, is_compiled
from antiosc.engine.contact.cracking import SMALL, name_of
from antiosc.engine.contact.dent import RIM
from antiosc.engine.contact.laws import Hysteretic
from antiosc.engine.contact.peak_error import by_strain, elastic_strain
from antiosc.engine.contact.surfaces import Matter
from antiosc.extension import (
    DEFLECTION,
    QUANTITIES,
    ErrorBudget,
    SiteMotion,
    brittle_sides,
    by_hertz,
    contact_time_note,
    hardest,
    left_out_text,
    low_band,
    out_of_reach,
    softest_model,
    trusted,
    unknown_dent,
    unstretched_text,
    weaker_side,
)
from antiosc.models.auto_contact import choice_of, piercing
from antiosc.models.body import info_of, site_points
from antiosc.models.stretch import MOST_ASKED, NARROWED
from antiosc_app.scene_file.run import coarse_cells, error_budget, has_sheets
from antiosc_app.symmetry import symmetry_note

if TYPE_CHECKING:
    from antiosc import Fall, Margin, PeakField, Structure
    from antiosc_studies.drops.fall import WorstField


#: Data of the page: numbers, texts, arrays, and lists and tables of these.
Data: TypeAlias = dict[str, Any]

FOLDER = Path(__file__).with_name("page")
#: Scripts of the page in the order of their dependence.
SCRIPTS = ("units", "engine", "data", "view", "part", "map", "chart", "verdict", "page", "fall")
#: Starting scripts: of a report, which contains its data, and of `antiosc open`.
REPORT = "start"
OPEN = "open"
#: The kinds of arrays on the page; JavaScript's names of them are in data.js.
KINDS = {"<f8": "f8", "<f4": "f4", "<i2": "i2", "<u4": "u4", "|u1": "u1"}


def script(begin: str = REPORT) -> str:
    """The whole program of a page."""
    text = "\n".join((FOLDER / f"{name}.js").read_text("utf-8") for name in (*SCRIPTS, begin))
    return f'(() => {{\n"use strict";\n{text}}})();\n'


def style() -> str:
    """The style sheet of the page."""
    return (FOLDER / "page.css").read_text("utf-8")


def engine() -> bytes:
    """The march compiled to WebAssembly (by packaging/library.py --page)."""
    return (FOLDER / "engine.wasm").read_bytes()


def policy(program: str) -> str:
    """The Content-Security-Policy: only this program runs, and nothing is fetched."""
    digest = base64.b64encode(hashlib.sha256(program.encode()).digest()).decode("ascii")
    scripts = f"script-src 'sha256-{digest}' 'wasm-unsafe-eval'"
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; {scripts}"


def embedded(data: Data) -> str:
    """Data as JSON that is safe inside a script element."""
    text = json.dumps(
        plain(data, _packed), allow_nan=False, separators=(",", ":"), ensure_ascii=True
    )
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def plain(value: object, of_array: Callable[[Array], object] = np.ndarray.tolist) -> object:
    """A value as JSON: NaN and infinity become None, arrays what `of_array` returns."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry, of_array) for key, entry in value.items()}
    if isinstance(value, bytes):
        value = np.frombuffer(value, dtype=np.uint8)
    if isinstance(value, np.ndarray):
        return plain(of_array(value), of_array)
    if isinstance(value, list | tuple):
        return [plain(entry, of_array) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        if np.isfinite(value):
            return value
        return None
    if value is None or isinstance(value, int | str):
        return value
    return str(value)


def _packed(values: Array) -> Data:
    """An array as base64 text with its type."""
    values_in_order = np.ascontiguousarray(values)
    values_in_order = values_in_order.astype(values_in_order.dtype.newbyteorder("<"))
    text = base64.b64encode(values_in_order.tobytes()).decode("ascii")
    return {"$": KINDS[values_in_order.dtype.str], "of": text}


#: Relative force error of the runs on the page.
TOL = 1e-6
#: Relative force error of the runs that colour a map.
COARSE = 1e-3
#: Number of points of the computed curve on the page.
CURVE = 2000
#: Translates digits to superscripts.
SUPERSCRIPTS = str.maketrans("0123456789.-", "⁰¹²³⁴⁵⁶⁷⁸⁹·⁻")


def blow_of_history(hit: History, bars: ErrorBudget | None) -> Data | None:
    """The impact as data for the page; None if the page cannot repeat it.

    It repeats impacts of `simulate` and `strike` with one contact by a built-in law, open at the
    start, constant loads, no dampers that couple modes, and a striker that does not stretch.
    `bars`: its error budget, or None.
    """
    if not isinstance(hit, History) or isinstance(hit, SceneHistory):
        return None
    system = hit.assembly.system
    law = hit.assembly.laws[0]
    if not is_compiled(law) or system.breaks.size > 1 or system.pressed.any():
        return None
    # the page has uncoupled modes and linear strikers only
    if system.first is not None or "impactor" in hit.assembly.stretched:
        return None
    body = hit.assembly.bodies["structure"]
    striker = hit.assembly.bodies["impactor"]
    if not isinstance(body.modes, ModalBody) or not isinstance(striker.modes, ModalBody):
        return None
    loads = np.split(system.loads[0], [body.omega.size])
    local = law.compliance
    speed = abs(float(system.beta[0] @ system.v))
    common_data = impact_data(
        law, modal_data(striker.modes, striker.start, loads[1]), hit.impactor, speed
    )
    law_data = common_data["law"]
    if law_data["yields"] is not None:
        law_data["yields"] |= {"side": weaker_side(hit), "unknown": unknown_dent(hit)}
    law_data["brittle"] = [_brittle(matter) for matter in brittle_sides(hit)]
    if plain := by_hertz(hit):
        law_data["hertz"] = plain._asdict()
    return {
        **common_data,
        "ratio": _ratio(hit.model),
        "gap": float(system.offsets[0, 0]),
        "duration": float(hit.run.time[-1]),
        "body": {**modal_data(body.modes, body.start, loads[0], local), "stretch": _stretch(hit)},
        "bars": _bars(hit, bars, local),
        "computed": _computed(hit, bars),
    }


def _brittle(matter: Matter) -> Data:
    """What the sentence on a material that cracks needs."""
    return {"name": name_of(matter), "nu": matter.nu, "bounds": matter.tensile, "small": SMALL}


def impact_data(law: ContactLaw, striker: Data, impactor: LinearBody, speed: float) -> Data:
    """Data that do not depend on the site: the law, the striker, and the slider positions.

    A slider that does not exist is None: the mass of a vibrating striker, the stiffness of a
    measured law.
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
    """Data of a contact that can yield; None for a law without a dent.

    strength : yield strength [Pa]; radius : radius of the sphere [m]; rim : rim of `Dent`.
    """
    if not isinstance(law, Hysteretic):
        return None
    if not isinstance(law, ElasticPlastic):
        return {}
    return {"strength": law.yield_strength, "radius": law.radius, "rim": RIM}


def finite_parameters(law: ContactLaw) -> list[float]:
    """Parameters of a law as JSON numbers: the infinite range of Hertz's law is left out."""
    assert isinstance(law, Compiled)
    return [value for value in law.parameters() if np.isfinite(value)]


def modal_data(
    body: ModalBody, start: Array | None = None, load: Array | None = None, local: float = 0.0
) -> Data:
    """A body in free modes as data for `pose` of engine.js; `local`: compliance of its patch
    [m/N].
    """
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
    """Rows of the part's stretching, its modes as rows, and the tensors; None if it is linear."""
    stretching = hit.assembly.stretched.get("structure")
    system = hit.assembly.system
    if stretching is None:
        return None
    assert system.quadratic is not None
    assert system.cubic is not None
    return {
        "rows": system.beta[-stretching.size :, hit.assembly.spans["structure"]].ravel(),
        "modes": stretching.modes.T.ravel(),
        "quadratic": system.quadratic.ravel(),
        "cubic": system.cubic.ravel(),
    }


def _ratio(model: LinearBody) -> float | None:
    """The damping ratio if all modes have the same and no other damping; else None."""
    damping = getattr(model, "damping", None)
    if damping is None:
        return 0.0
    plain = isinstance(damping, Damping) and isinstance(damping.ratio, float)
    if plain and damping.alpha == damping.beta == 0:
        return damping.ratio
    return None


def _bars(hit: History, budget: ErrorBudget | None, local: float) -> Data:
    """Relative errors by quantity and cause, and modified bodies for mesh and truncation errors.

    On the page such an error bar is scaled by the difference that its modified body makes there.
    `unknown` says why a quantity has none, `condition` ends the others, `rebounds` whether the
    impulse is m v (1 + e).
    """
    none: Data = {"shares": {}, "variants": {}, "unknown": {}, "rebounds": False}
    if not budget:
        return none
    causes = budget.causes
    barred = {name: bar for name, bar in budget.items() if name not in budget.unbarred}
    shares = {name: {c: getattr(bar, c) for c in causes} for name, bar in barred.items()}
    if not np.isfinite([v for by_cause in shares.values() for v in by_cause.values()]).all():
        return none
    model = hit.model
    variants = {}
    starts_moving = hit.assembly.bodies["structure"].start.any()
    linear = not hit.assembly.stretched
    if shares and linear and not starts_moving and getattr(model, "strain_error", None) is not None:
        bodies = {"mesh": model.corrected(), "truncation": softest_model(model)}
        variants = {
            cause: modal_data(variant.modal(), local=local) for cause, variant in bodies.items()
        }
    rebounds = budget.rebound is not None
    bodies_and_bars = {"shares": shares, "variants": variants, "rebounds": rebounds}
    told = {"condition": budget.condition, "footnote": budget.footnote, "unknown": budget.unbarred}
    return bodies_and_bars | told


def _computed(hit: History, budget: ErrorBudget | None) -> Data:
    """The curve and the numbers of the computed case, which stay on the page."""
    time = hit.time
    force = hit.force
    if time.size > CURVE:
        time = np.linspace(0.0, float(time[-1]), CURVE)
        force = hit.force_at(time)
    numbers = {name: float(getattr(hit, name)) for name in QUANTITIES}
    counts = {"restitution": hit.restitution, "contacts": len(hit.contacts)}
    counts["dent"] = 0.0 if hit.dent is None else hit.dent.depth
    last = hit.contacts[-1][1] if hit.contacts else 0.0
    ends = {"last": last, "touching": bool(last >= hit.run.time[-1])}
    told: Data = {"contact_time_note": contact_time_note(hit)}
    if moved := deflection(hit, budget):
        told |= {"site_deflection": moved["value"], "site": moved}
    return {"time": time, "force": force, **numbers, **counts, **ends, **told}


def deflection(hit: History, budget: ErrorBudget | None) -> Data | None:
    """The largest displacement of the site along the impact: `value` [m], how far it may lie below
    and above, over itself, and in words until when it is known; None of a part that moves on as a
    whole.
    """
    motion = None if isinstance(hit, SceneHistory) else hit.site_motion
    if motion is None:
        return None
    known = budget is not None and budget.deflection is not None and not budget.no_bar
    sides = budget.sides(DEFLECTION) if known and budget is not None else None
    return {"value": motion.largest, "bar": sides, "told": _until(hit, motion)}


def _until(hit: History, motion: SiteMotion) -> str:
    """Text: the time that a largest displacement is of, and how large it becomes later."""
    end = float(hit.run.time[-1])
    within = f"largest within the {engineering(end, 's')} that were computed"
    damping = "" if hit.assembly.system.damped else "without damping "
    away = out_of_reach(hit)
    if not np.isfinite(motion.later) or away is None or away > end:
        return f"{within}; {damping}it may become larger later"
    if motion.later <= motion.largest:
        return f"{within}, and later too"
    return f"{within}; {damping}at most {engineering(motion.later, 'm')} later"


def motion_rows(
    hit: History, budget: ErrorBudget | None, structure: Structure | None
) -> list[tuple[str, str]]:
    """Rows on the deflection at the site, but of a part that moves on as a whole, and on whether a
    thin part stretches where the summary has none.
    """
    found = deflection(hit, budget)
    stretch = "" if hit.stretch_texts else stretching(hit, structure)
    rows = [("stretch", stretch)] if stretch else []
    if found is None:
        return rows
    value = engineering(found["value"], "m")
    if budget is not None and found["bar"] is not None:
        value = budget.shown(DEFLECTION, 3)
    return [("deflection at the site", f"{value}, {found['told']}"), *rows]


def halved(size: str, dim: int) -> str:
    """What makes the cells of a finished mesh smaller: the field `size` halves them, of dimension
    `dim`; 0: the mesh keeps them.
    """
    if not dim:
        return "make them in the program that made the mesh"
    return f"{size}, which halves all cells: each time {2**dim} times as many"


#: Where the yield strength of a material of one's own is given.
OWN_STRENGTH = where_to_change(
    "yield_strength, yield_range", "own material in the list of materials"
)
#: The cause of the largest share of a bar -> what reduces it.
REMEDIES = {
    "mesh": f"use smaller elements around the site ({SMALLER_CELLS})",
    "truncation": "extract more anti-oscillators"
    f" ({where_to_change('n in [extract]', 'the field anti-oscillators')})",
    "time": "use a smaller tol (in a scene: in [simulate])",
    "patch": f"take a smaller patch on smaller elements ({SMALLER_CELLS})",
    "geometry": "use smaller or curved elements along the curved surface",
    "noise": "measure with less noise, or average more blows",
    "band": "measure up to a higher frequency",
    "model": "use solid elements in place of beams or shells",
    "stretch": "extract with a larger number of motions (in a scene: stretch in [extract])",
    "law": "give the yield strength of the part's own material, and its range as its tests have it"
    f" ({OWN_STRENGTH})",
}
#: What is asked for where no yield strength is known.
ASKED_STRENGTH = "give the yield strength or a material"
#: The end of a sentence on an elastic law with large strains.
OF_STRAIN = (
    "the contact is pressed in by {:.2g} of its radius, where Hertz's law, which holds for small"
    " strains, is off by what is behind a tip and by how it stiffens: a blunter tip narrows it"
)
#: The end of a sentence on a law whose yield strength has no range, one that is not the table's, or
#: is that of the striker.
NO_RANGE = (
    "the yield strength is taken as exact: its range, where it has one, may widen this bar"
    f" ({OWN_STRENGTH})"
)
GIVEN_RANGE = (
    "the range of the yield strength that is given, with its growth with the strain rate, and the"
    " law itself make it; tests of the part's own material alone narrow it"
)
OF_STRIKER = "the striker yields first, and its yield strength is known no better"
OF_LAMINATE = (
    "it is not known from which indentation this laminate is damaged; where tests have it, give the"
    ' law (in a scene: kind = "YangSun" with stiffness and critical in [contact])'
)
#: Number of a striker in a headline -> (its unit, the preposition).
STRIKER_WORDS = {"mass": ("kg", "of"), "velocity": ("m/s", "at")}


class Headline(NamedTuple):
    """Striker and part, the numbers (name, value with error bar), and sentences of the verdict.

    `caution`: what must be read before the numbers, "" if nothing must; `footnote`: what their bars
    leave out, directly below them. `kinds` of the sentences tell the page how to replace them when
    a slider is moved.
    """

    about: str
    numbers: list[tuple[str, str]]
    sentences: list[str]
    kinds: Sequence[str] = ()
    caution: str = ""
    footnote: str = ""

    def beside(self, numbers: Sequence[tuple[str, str]], note: str) -> Headline:
        """The headline with further numbers, and a note on them."""
        sentences = [*self.sentences, f"{capitalised(note)}."] if note else self.sentences
        kinds = (*self.kinds, "beside") if note and self.kinds else self.kinds
        return self._replace(numbers=[*self.numbers, *numbers], sentences=sentences, kinds=kinds)


def headline_of_history(
    hit: History,
    structure: Structure | None,
    budget: ErrorBudget | None,
    fields: Mapping[str, PeakField],
    file: str = "",
) -> Headline:
    """The headline of an impact of two bodies.

    `fields`: its `PeakField`s by quantity; `file`: name of the part's file, if known.
    """
    numbers = [
        (
            name.replace("_", " "),
            budget.shown(name, 3) if budget else engineering(getattr(hit, name), unit),
        )
        for name, unit in QUANTITIES.items()
    ]
    stresses = stress_sentences(fields, force_bar(budget))
    e = hit.restitution
    rebound = restitution_text(e) if e is not None else "not defined"
    numbers.append(("restitution", budget.shown_restitution(e) if budget else rebound))
    sentences_of_kind = [
        ("contact", hit.verdict),
        *(("doubt" if i else "stress", s) for i, s in enumerate(stresses)),
        ("energy", _absorbed(hit)),
        ("stretch", stretching(hit, structure)),
        ("contacts", _contacts(hit)),
        ("accuracy", remedy_of(hit, budget)),
    ]
    kinds, sentences = zip(*(pair for pair in sentences_of_kind if pair[1]), strict=True)
    caution = cautions_of(hit, structure, budget, fields)
    about = _struck(hit, structure, file)
    footnote = "" if budget is None else budget.footnote
    return Headline(about, numbers, list(sentences), kinds, caution, footnote)


def cautions_of(
    hit: History,
    structure: Structure | None,
    budget: ErrorBudget | None,
    fields: Mapping[str, PeakField],
) -> str:
    """What must be read before the numbers of an impact, on the page, in a report and of a run."""
    several = isinstance(hit, SceneHistory)
    cautions = [
        "" if several else capitalised(hit.assembly.hopeless.replace("'structure'", "the part")),
        "" if several else piercing(hit.model, hit.impactor),
        "" if several else rough(hit, budget),
        "" if several else hit.unfinished,
        of_elastic_part(fields, force_bar(budget)),
        caution_of(hit, budget, structure),
    ]
    return " ".join(filter(None, cautions))


def map_cautions(impact_map: ImpactMap) -> list[str]:
    """Sentences on a map that is no answer: most sites doubtful, or models of too low a band."""
    number, count = int(impact_map.doubtful.sum()), len(impact_map)
    cautions = []
    if 2 * number > count:
        rest = f": the numbers are those of the other {count - number} sites" * (number < count)
        told = f"This map is no answer for the part{rest}. {left_out_text(impact_map)}"
        cautions.append(told)
    if sentence := low_band(impact_map):
        cautions.append(capitalised(sentence))
    return cautions


def comparable(sentence: str) -> str:
    """A sentence for comparison, without its full stop and in lower case."""
    return sentence.rstrip(".").lower()


#: What the stresses of a map on the page that opens a part leave out.
NOT_AT_EDGES = "Sharp inner edges and rigidly held faces are left out too, as for a single blow."
#: How a map gets stresses: in a scene, and on the page that opens a part.
IN_SCENE = "give the [map] of a scene stress = true"
ON_PAGE = "the button Stress of each blow adds them"


def headline_of_map(
    impact_map: ImpactMap,
    structure: Structure | None = None,
    stresses: str = IN_SCENE,
    known: dict[int, History] | None = None,
    file: str = "",
) -> Headline:
    """The headline of a map; with its structure it has the error bar of the largest force.

    `stresses`: how a map without stresses gets them. `known`: impacts of the map's sites alone, by
    the numbers of the sites, to which others are added. `file`: name of the part's file, if known.
    """
    known = {} if known is None else known
    bar = None
    numbers = [("sites", f"{len(impact_map)}")]
    sentences = []
    cautions = map_cautions(impact_map)
    if impact_map.peak_force is not None and impact_map.contact_time is not None:
        worst_site = hardest(impact_map)
        mask = trusted(impact_map)
        high = float(impact_map.peak_force[worst_site])
        for name, unit in (("peak_force", "N"), ("contact_time", "s")):
            ends = (float(end(getattr(impact_map, name)[mask])) for end in (np.nanmin, np.nanmax))
            text = " to ".join(engineering(value, unit) for value in ends)
            numbers.append((name.replace("_", " "), text))
        place_text = point_text(impact_map.points[worst_site])
        bar = None if structure is None else map_bar(impact_map, structure, known)
        force_text = engineering(high, "N") + (f" ± {percent(bar)}" if bar else "")
        of_sites = _whose_numbers(impact_map)
        where = _doubt_of(impact_map, worst_site)
        sentences.append(
            f"The largest force{of_sites}, {force_text}, arises at {place_text}{where}."
        )
        sentences += _undecided(impact_map.peak_force[mask], bar)
        sentences += _harder_in_doubt(impact_map, high)
        if impact_map.doubtful.all() and bar:
            sentences.append("Its bar leaves out what makes it doubtful.")
        if worst_site in known:
            cautions.append(_rough_of_map(known[worst_site]))
        sentences.append(_softest(impact_map))
        left_out = left_out_text(impact_map)
        if left_out and left_out not in " ".join(cautions):
            sentences.append(left_out)
        if edges := impact_map.info.get("edges", 0):
            sentences.append(f"The {edges} corners of cells on sharp edges are no sites.")
    if impact_map.peak_stress is not None:
        sentences += _most_dangerous(impact_map, structure, known)
        if stresses == ON_PAGE:
            sentences.append(NOT_AT_EDGES)
    elif impact_map.impactor:
        sentences.append(f"Stresses are not part of it: {stresses}.")
    worst = float(impact_map.error.max())
    sentences.append(
        f"The free modes leave an error of Z of at most {percent(worst)} up to"
        f" {engineering(impact_map.band, 'Hz')}."
    )
    if bar is None:
        cautions.append(_no_bar_of_map(impact_map, known))
    about = (
        f"{_body(impact_map.impactor)} strikes "
        f"{file or _named(impact_map.info.get('structure', 'a part'))}."
    )
    about = about if impact_map.impactor else "Models over a surface"
    return Headline(about, numbers, sentences, caution=" ".join(filter(None, cautions)))


def _doubt_of(impact_map: ImpactMap, i: int) -> str:
    """The end of a sentence on a site: why it is doubtful; "" if it is not, or that is unknown."""
    reason = str(impact_map.reasons[i]) if impact_map.doubtful[i] else ""
    return f", where {reason}" if reason else ""


def _undecided(forces: Array, bar: float | None) -> list[str]:
    """A sentence (in a list) that the bar of the largest of the forces (n,) holds all of them."""
    low, high = float(np.nanmin(forces)), float(np.nanmax(forces))
    if not bar or low < (1 - bar) * high or low == high:
        return []
    ends = f"{engineering(low, 'N')} to {engineering(high, 'N')}"
    return [
        f"The forces of all these sites, {ends}, lie within that bar: which of them is struck"
        " hardest is not decided, and it holds for all."
    ]


def _harder_in_doubt(impact_map: ImpactMap, force: float) -> list[str]:
    """A sentence (in a list) on the largest force of doubtful sites, if it exceeds that of the
    others.
    """
    assert impact_map.peak_force is not None
    in_doubt = np.where(impact_map.doubtful, np.nan_to_num(impact_map.peak_force), 0.0)
    i = int(np.argmax(in_doubt))
    if in_doubt[i] <= force:
        return []
    place = point_text(impact_map.points[i])
    larger = engineering(float(in_doubt[i]), "N")
    return [f"A larger one, {larger}, is doubtful: at {place}{_doubt_of(impact_map, i)}."]


def _whose_numbers(impact_map: ImpactMap) -> str:
    """The end of a phrase: whether numbers of a map are those of sound or of doubtful sites; ""
    if no site is doubtful.
    """
    if impact_map.doubtful.all():
        return " of the sites, which are all doubtful"
    return " of the sites that are not doubtful" if impact_map.doubtful.any() else ""


def _rough_of_map(hit: History) -> str:
    """Sentence, before the numbers, on a wide bar of a map's largest force; "" if it is not."""
    sentence = rough(hit, error_budget(hit))
    return sentence.replace("The force", "The largest force", 1).replace("[extract]", "[map]")


def _no_bar_of_map(impact_map: ImpactMap, known: Mapping[int, History]) -> str:
    """Sentence why the largest force of a map has no bar."""
    hit = known.get(hardest(impact_map)) if impact_map.peak_force is not None else None
    if coarse := coarse_cells(hit):
        return f"{COARSE_CELLS} {capitalised(coarse).rstrip('.')}."
    budget = error_budget(hit)
    if budget is None or not budget.law:
        return "There is no error bar: the mesh's error is not estimated."
    numerical = percent(budget["peak_force"].without_law)
    return (
        f"The largest force has a numerical error of {numerical}, without that of the contact's"
        f" law. {budget.left_out}"
    )


def bars_of_sites(known: Mapping[int, History]) -> Data:
    """Number of a site of a map that was struck by itself -> the bars of its quantities."""
    budgets = ((site, error_budget(hit)) for site, hit in known.items())
    return {str(site): _bars_of(one) for site, one in budgets if one and "mesh" not in one.unknown}


def _bars_of(budget: ErrorBudget) -> Data:
    """The errors of an impact below and above its quantities; None where they are not known."""
    known = [name for name in budget if budget.shares(name)["total"] is not None]
    bars = {name: budget.sides(name) if name in known else None for name in budget}
    return {**bars, "restitution": budget.restitution_sides if "impulse" in known else None}


def _softest(impact_map: ImpactMap) -> str:
    """Sentence on the site with the largest static compliance."""
    k0 = impact_map.models.k0
    i = min(trusted(impact_map), key=lambda site: k0[site])
    stiffness = engineering(float(k0[i]), "N/m")
    place_text = point_text(impact_map.points[i])
    return f"The softest place, of a static stiffness k0 of {stiffness}, is at {place_text}."


def map_bar(impact_map: ImpactMap, structure: Structure, known: dict[int, History]) -> float | None:
    """Relative error of the largest force of a map by its own extraction; None if not known."""
    hit = struck_alone(impact_map, structure, hardest(impact_map), known)
    budget = error_budget(hit)
    bar = force_bar(budget)
    known_bar = bar is not None and np.isfinite(bar) and not isinstance(bar, Numerical)
    return bar if known_bar else None


#: Least number of anti-oscillators of an impact at a site of a map by itself.
ALONE = 40


def struck_alone(
    impact_map: ImpactMap, structure: Structure, i: int, known: dict[int, History]
) -> History | None:
    """The impact at site i by its own extraction, with error bars where the part has them; None if
    it is not known.

    Parts in pieces over several ranks have none: only the first rank asks.
    """
    if i in known:
        return known[i]
    from antiosc import Site, extract  # they need the finite-element packages

    if structure.comm.size > 1 or impact_map.impactor is None or impact_map.duration is None:
        return None
    radius = None if impact_map.radius is None else float(impact_map.radius[i])
    site = Site(impact_map.points[i].tolist(), impact_map.directions[i].tolist(), radius, snap=True)
    law = impact_map.contact if impact_map.laws is None else impact_map.laws[i]
    assert law is not None
    with contextlib.suppress(AntioscError), warnings_to(lambda _: None):
        count = max(ALONE, impact_map.models.m.shape[1])
        error: Literal["estimate"] | None = "estimate" if has_bars(structure) else None
        model = extract(structure, site, n=min(count, structure.dofs - 1), error=error)
        hit = simulate(model, impact_map.impactor, law, impact_map.duration)
        hit.error_budget  # noqa: B018 (parts without one end here)
        known[i] = hit
        return hit
    return None


def _most_dangerous(
    impact_map: ImpactMap, structure: Structure | None, known: dict[int, History]
) -> list[str]:
    """Sentences on the site whose impact causes the largest stress, and whether the part yields: by
    the stresses of the map, and by the impact there alone, as a click strikes it.
    """
    assert impact_map.peak_stress is not None
    assert impact_map.stress_points is not None
    exposure = impact_map.exposure
    i = most_stressed(impact_map)
    hit = None if structure is None else struck_alone(impact_map, structure, i, known)
    alone = [] if structure is None or hit is None else _stress_alone(structure, hit)
    budget = error_budget(hit)
    force_text = "" if hit is None else engineering(hit.peak_force, "N")
    force_text = force_text if budget is None else budget.shown("peak_force", 3)
    text = (
        f"A blow at {point_text(impact_map.points[i])} stresses the part most:"
        f" {engineering(impact_map.peak_stress[i], 'Pa')} at "
        f"{point_text(impact_map.stress_points[i])}"
    )
    by_itself = _by_itself(alone, force_text)
    if exposure is None:
        return [f"{text}; the material has no yield strength to compare it with.", *by_itself]
    sought = exposure[trusted(impact_map)]
    sought = sought[np.isfinite(sought)]
    low, high = _scatter(alone, float(exposure[i]))
    reached, possible = (int(np.sum(sought * factor >= 1)) for factor in (low, high))
    of_sites = f" of {len(sought)} sites"
    of_sites += _whose_numbers(impact_map).removeprefix(" of the sites")
    sites_text = f"reached at {reached}{of_sites}" if reached else "reached nowhere"
    if possible > reached:
        certain = " for certain" * (not reached)
        more = f"{possible - reached} more" if reached else f"{possible}{of_sites}"
        sites_text += f"{certain}, and may be at {more}"
    bars = (
        "with the error of the worst site, and the range of the strength"
        if alone
        else "their error by the mesh is not estimated"
    )
    hidden = impact_map.radius is not None
    patch_text = " and what the radius of its patch hides, as a single blow counts it," * hidden
    return [
        f"{text}, {exposure[i]:.3g} of the yield strength; by these stresses, {bars}, yield is"
        f" {sites_text}. The zone of the contact itself{patch_text} {'are' if hidden else 'is'}"
        " left out.",
        *by_itself,
        *_narrowed_alone(force_bar(budget)),
    ]


#: How a site of a map is struck by itself, with smaller cells.
ALONE_AND_FINER = where_to_change(
    "[sites] with its point, and refine there", "Strike this site, which makes the cells smaller"
)


def _narrowed_alone(bar: float | None) -> list[str]:
    """A sentence (in a list) on what narrows the wide bar of a site that is struck by itself on the
    cells of its map.
    """
    if bar is None or not exceeds(bar, WIDE, 2):
        return []
    wide = "Of this force the bar is wide, for the cells there are those of the map"
    return [f"{wide}: {NARROWING.lower()}strike this site alone ({ALONE_AND_FINER})."]


def most_stressed(impact_map: ImpactMap) -> int:
    """Number of the site whose blow stresses the part most; without stresses the hardest one."""
    if impact_map.peak_stress is None:
        return hardest(impact_map)
    exposure = impact_map.exposure
    return hardest(impact_map, values=impact_map.peak_stress if exposure is None else exposure)


def _by_itself(alone: Sequence[tuple[PeakField, float | None]], force_text: str) -> list[str]:
    """Sentences on the stresses of a site that is struck by itself, beside its force."""
    sentences = []
    for peak, force in alone:
        with_force = f"Struck by itself there, with a force of {force_text}"
        sentences.append(f"{with_force}: {judgement(peak, force)}.")
        if note := stress_note(peak, force):
            sentences.append(f"{capitalised(note)}.")
    return sentences


def _scatter(alone: Sequence[tuple[PeakField, float | None]], exposure: float) -> Sequence[float]:
    """Factors of the exposures of a map that bound them, from its worst site struck alone; 1 where
    that is not known.
    """
    for peak, force in alone:
        worst = peak.worst_point
        if worst is not None and worst.criterion == "yield" and exposure > 0:
            return [bound / exposure for bound in _with_force(worst, force).bounds]
    return 1.0, 1.0


def _stress_alone(structure: Structure, hit: History) -> list[tuple[PeakField, float | None]]:
    """The stress fields of an impact in which a largest one is sought, with the force's error."""
    from antiosc_app.scene_file.scene import by_strengths

    with contextlib.suppress(AntioscError), warnings_to(lambda _: None):
        force = force_bar(error_budget(hit))
        fields = dict(by_strengths(structure, hit)).values()
        return [(peak, force) for peak in fields if peak.worst_point is not None]
    return []


def _struck(hit: History, structure: Structure | None, file: str) -> str:
    """Sentence on the striker, the part, by its file where that is known, and the site."""
    part = file or ("a model" if structure is None else _named(structure.describe()))
    places = list(site_points(hit.model).values())
    place_text = f" at {point_text(places[0])}" if len(places) == 1 else ""
    return f"{_body(hit.impactor)} strikes {part}{place_text}."


def _body(body: LinearBody | None) -> str:
    """Text of a striker: "A sphere of 32.9 g at 2.00 m/s"."""
    text = striker_text(body)
    return f"{'An' if text[0] in 'aeiouIE' else 'A'} {text}"


def striker_text(body: LinearBody | None) -> str:
    """Kind, mass and speed of a striker: "sphere of 32.9 g at 2.00 m/s"."""
    kind = _name_of(body) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(body).__name__).lower()
    text = [kind]
    for name, (unit, word) in STRIKER_WORDS.items():
        value = getattr(body, name, None)
        if isinstance(value, float) and value:
            text.append(f"{word} {engineering(value, unit)}")
    return " ".join(text)


def _name_of(body: LinearBody | None) -> str:
    """The name of a striker of a standard, which it is in all its properties; "" of others."""
    for name, known in IMPACTORS.items():
        if known.speed is not None and body == named_impactor(name):
            return f"{name} hammer" if name.startswith("IK") else name
    return ""


def _named(described: str) -> str:
    """The name of the mesh in a description of `Structure.describe`."""
    return re.split(r"[:,]|(?<=of \d part) \(|(?<=parts) \(", described, maxsplit=1)[0]


def _contacts(hit: History) -> str:
    """Sentence on several contacts, and which of them the contact time is of; "" of one."""
    note = contact_time_note(hit)
    return (
        f"The bodies touch {len(hit.contacts)} times: the contact time is that {note}."
        if note
        else ""
    )


class Numerical(float):
    """A relative error of a force without that of the contact's law, which is not known."""


def force_bar(budget: ErrorBudget | None) -> float | None:
    """Relative error of the largest force with its law's, or without where that is not known
    (`Numerical`); None if that by the mesh is not known.
    """
    if budget is None or "mesh" in budget.unknown:
        return None
    bar = budget["peak_force"]
    return Numerical(bar.without_law) if bar.total is None else bar.total


def bar_of_fall(fall: Fall, worst: WorstField) -> float | None:
    """The relative error by its law of the force of the impact with the judged stress."""
    number = 0 if worst.exposure is None else worst.margin().impact
    return fall.impacts[number - 1 if number else int(worst.impact[worst.judged])].law_error


def stress_sentences(fields: Mapping[str, PeakField], force: float | None) -> list[str]:
    """Sentences on strengths, where they are reached; without any on the largest stress.

    `force`: relative error of the force, which the stresses follow; None: unknown.
    """
    sentences = []
    for peak in fields.values():
        if peak.worst_point is not None:
            sentences.append(f"{capitalised(judgement(peak, force))}.")
        if note := stress_note(peak, force):
            sentences.append(f"{capitalised(note)}.")
        if peak.yield_speeds is not None and (told := peak.yield_speeds.sentence):
            sentences.append(f"{capitalised(told)}.")
        if peak.doubt:
            sentences.append(f"{capitalised(peak.doubt).rstrip('.')}.")
    return sentences


def judgement(peak: PeakField, force: float | None) -> str:
    """Sentence on the margin, in whose verdict the error of the force counts, or on the largest
    stress where no strength is known.
    """
    worst = peak.worst_point
    assert worst is not None
    return f"{_with_force(worst, force).sentence}{without_mesh_error(peak)}"


def _with_force(worst: Margin, force: float | None) -> Margin:
    """The worst point of a stress with the relative error of the force."""
    return replace(worst, force_error=force or 0.0)


def of_elastic_part(fields: Mapping[str, PeakField], force: float | None) -> str:
    """Sentence before the numbers of a part that certainly yields outside the contact; "" else.

    `force`: relative error of the force, as in the verdict.
    """
    points = (peak.worst_point for peak in fields.values())
    margins = [_with_force(worst, force) for worst in points if worst is not None]
    judged = [margin for margin in margins if margin.criterion == "yield"]
    worst = max(judged, key=lambda margin: margin.bounds[0], default=None)
    if worst is None or worst.bounds[0] < 1:
        return ""
    return (
        f"The part yields, at {_times_strength(worst)} or more: the force and its"
        " error bar are those of an elastic part, and one that yields carries less. How much less"
        " is not computed: an explicit finite element program with plasticity has it."
    )


def _times_strength(worst: Margin) -> str:
    """The least exposure with the strength that it is over, the largest of a range."""
    share = f"{worst.bounds[0]:.3g} times"
    if worst.strength_range is None:
        return f"{share} its yield strength {engineering(worst.strength, 'Pa')}"
    largest = engineering(worst.strength_range[1], "Pa")
    return f"{share} the largest yield strength of its range, {largest},"


#: Beside a stress whose error by the mesh is not estimated.
NO_MESH_ERROR = f"mesh not estimated: {COMPARED}"
#: The same of a deck that keeps its elements.
COMPARED_DECKS = "compare with a deck of smaller cells"


def without_mesh_error(peak: PeakField) -> str:
    """The end of a sentence on a stress: that its error by the mesh is not estimated, or ""."""
    is_stress = peak.unit == "Pa" or peak.exposure is not None
    return f" ({NO_MESH_ERROR})" if is_stress and _lacks_mesh_error(peak) else ""


def _lacks_mesh_error(peak: PeakField) -> bool:
    """Whether the judged stress is that of a mesh, without an estimate of its error."""
    by_hertz = peak.worst_point is not None and peak.worst_point.at_edge
    return not by_hertz and _bar(peak, 0.0) is None


def stress_bar(peak: PeakField, force: float | None) -> tuple[float, float] | None:
    """How far the judged stress may lie below and above, over itself, by mesh, patch and force;
    None if not all are known.
    """
    return None if force is None else _bar(peak, force)


def _bar(peak: PeakField, force: float) -> tuple[float, float] | None:
    """`stress_bar` with the relative error of the force; None without an estimate of the mesh."""
    worst = peak.worst_point
    if worst is not None and worst.is_stress:
        return _bar_of(_with_force(worst, force), bool(peak.largest_mesh_error))
    value = _judged(peak)
    if not peak.largest_mesh_error or not value:
        return None
    share = peak.largest_mesh_error / value + force
    return min(share, 1.0), share


def _bar_of(margin: Margin, has_mesh_error: bool) -> tuple[float, float] | None:
    """`stress_bar` of a margin with its force error; None without an estimate of the mesh."""
    if not margin.stress or not (margin.at_edge or has_mesh_error):
        return None
    low, high = (end / margin.stress for end in margin.stresses)
    return 1 - max(low, 0.0), high - 1


class ImpactStress(NamedTuple):
    """The judged stress [Pa] of an impact of a fall, and its `stress_bar`."""

    stress: float
    bar: tuple[float, float] | None

    @property
    def bar_text(self) -> str:
        """The bar as text; a dash if it is not known."""
        return "–" if self.bar is None else plus_minus(self.bar)


def stresses_of_impacts(fall: Fall, worst: WorstField | None) -> list[ImpactStress]:
    """The largest judged stress of each impact; [] where none is judged by yield."""
    if worst is None or worst.exposure is None or worst.margin().criterion != "yield":
        return []
    spans = worst.margin().spans
    is_known = [fall.impacts[span.impact - 1].law_error is not None for span in spans]
    bars = (_bar_of(span, worst.mesh_error is not None and span.mesh_error > 0) for span in spans)
    return [
        ImpactStress(span.stress, bar if known else None)
        for span, bar, known in zip(spans, bars, is_known, strict=True)
    ]


def _judged(peak: PeakField) -> float:
    """The judged stress, as `Margin.stress` where there is a strength, in its unit."""
    value = float(peak.values[peak.judged])
    worst = peak.worst_point
    if worst is None or not worst.is_stress:
        return value
    return worst.exposure if peak.quantity == "yield" else worst.stress


def stress_note(peak: PeakField, force: float | None) -> str:
    """Text: the judged stress with its error, and beyond yield that it is not reached."""
    bar = _bar(peak, force or 0.0)
    if bar is None:
        return ""
    value = f"{engineering(_judged(peak), peak.unit)} {plus_minus(bar)}"
    if force is None:
        text = (
            f"with the errors of mesh and patch this stress is {value}; that of the force adds to"
            " it, and is not known"
        )
    else:
        law = ", without that of the contact's law," * isinstance(force, Numerical)
        text = f"with the errors of mesh, patch and force{law} this stress is {value}"
    worst = peak.worst_point
    if worst is not None and worst.is_stress and exceeds(bar[1], WIDE, 2):
        text += f", most of it by {_with_force(worst, force).widest}"
    if worst is not None and worst.reached and worst.criterion != "tension":
        return f"{text}; it is that of an elastic part: where it yields, the stress stays lower"
    return text


def largest_stress(fields: Mapping[str, PeakField], force: float | None) -> Data:
    """The von Mises stress [Pa] nearest to yield with its strength, null where that is not known;
    {} where no such stress was sought.

    `scope`: where it is judged, as text, "" anywhere; `stress_place` [m]: its place, null at the
    edge of a contact's surroundings; `stress_bar`: how far it may lie below and above, over
    itself, by mesh, patch and force, whose error is `force`; `of_cells`: whether most of it is by
    the cells there; `cells` [m]: their size at the site that it needs, null where they have it;
    `stress_note`: what this leaves out.
    """
    for peak in fields.values():
        margin = peak.worst_point
        if margin is not None and margin.is_mises:
            strength = None if peak.exposure is None else margin.strength
            judged: Data = {"stress": margin.stress, "strength": strength}
            judged["stress_bar"] = stress_bar(peak, force)
            judged["of_cells"] = _with_force(margin, force).is_of_cells
            needed = margin.needed_cells
            judged["cells"] = None if needed is None else rounded_down(needed)
            judged["stress_note"] = _stress_note(peak, force)
            judged["scope"] = margin.scope
            judged["stress_time"] = margin.time
            judged["stress_place"] = None if margin.at_edge else margin.point.tolist()
            return judged
    return {}


def _stress_note(peak: PeakField, force: float | None) -> str:
    """What the error bar of a judged stress leaves out, in a few words; "" if it has one."""
    if _lacks_mesh_error(peak):
        return NO_MESH_ERROR
    bar = _bar(peak, 0.0)
    if bar is None or force is not None:
        return ""
    return f"{plus_minus(bar)} by mesh and patch, force not estimated"


def stretching(hit: History, structure: Structure | None) -> str:
    """Sentence whether a thin part stretches, and what this changes; "" of a thick one."""
    is_sheet = has_sheets(structure)
    texts = [text.replace("'structure'", "the part") for text in hit.stretch_texts]
    texts = texts or [*filter(None, [unstretched_text(hit, is_sheet)])]
    if not texts and is_sheet and not hit.assembly.bodies["structure"].omega.all():
        texts = ["nothing holds the part, and it is taken as linear, without stretching"]
    return " ".join(f"{capitalised(text)}." for text in texts)


def _absorbed(hit: History) -> str:
    """Sentence on the share of the striker's energy that remains in the part."""
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


def has_bars(structure: Structure) -> bool:
    """Whether `extract(…, error="estimate")` accepts a structure."""
    return not without_bars(structure)


def without_bars(structure: Structure) -> str:
    """Sentence why `extract(…, error="estimate")` refuses a structure; "" if it accepts it."""
    matrices = structure.matrices
    if not (matrices.meshed or matrices.assembled):
        return "matrices have no mesh"
    from antiosc.extension import ModelErrors, refuse_dampers

    try:
        refuse_dampers(structure, "an error bar")
        return ModelErrors(structure).skipped
    except InputError as error:
        return str(error)


def caution_of(hit: History | None, budget: ErrorBudget | None, structure: Structure | None) -> str:
    """What must be read before the numbers of an impact: a part that may be cut, missing bars."""
    coarse = coarse_cells(hit)
    reason = f"{COARSE_CELLS} {coarse}" if coarse else no_bar(budget, structure)
    sentences = symmetry_note(structure), reason
    return " ".join(f"{sentence.rstrip('.')}." for sentence in sentences if sentence)


#: Before the sentence on these cells.
COARSE_CELLS = "There is no error bar, because the cells are too large for this contact."


def no_bar(budget: ErrorBudget | None, structure: Structure | None) -> str:
    """Sentence that a result has no error bar, the reason and the remedy; "" if it has one."""
    if budget is not None:
        return ""
    reason = "There is no error bar, for the mesh's error is not estimated"
    if structure is None:
        return f"{reason}."
    if refused := without_bars(structure):
        return f"{reason}: {refused}"
    return f'{reason}; in a scene error = "estimate" in the section [extract] estimates it.'


#: Share of the force from which its bar is told before the numbers.
WIDE = 0.5
#: Share of the force from which a cause of its bar is told beside the largest one.
LEAST_TOLD = 0.01


def rough_force(bar: float | None) -> str:
    """Start of the sentence, before the numbers, on a force with a wide bar; "" if it is not wide.
    The sentence goes on with what narrows it.
    """
    if bar is None or not exceeds(bar, WIDE, 2):
        return ""
    of_law = ", without the error of the contact's law" * isinstance(bar, Numerical)
    return f"The force is a rough one, ± {percent(bar)}{of_law}: "


def rough(hit: History, budget: ErrorBudget | None) -> str:
    """Sentence, before the numbers, on a force with a wide bar, and what narrows it; "" if not."""
    if budget is None:
        return ""
    bar = budget["peak_force"]
    start = rough_force(bar.known if bar.law is not None else Numerical(bar.known))
    return start + _narrows(hit, budget) if start else ""


def remedy_of(hit: History, budget: ErrorBudget | None) -> str:
    """Sentence on the cause that limits the accuracy, and the remedy; "" if it is told before."""
    if budget is None or rough(hit, budget):
        return ""
    if budget.no_bar and budget["peak_force"].known < LEAST_TOLD:
        return ""  # what is not known decides
    return capitalised(_narrows(hit, budget))


def _narrows(hit: History, budget: ErrorBudget) -> str:
    """The end of a sentence on the cause of most of the bar, and the remedy."""
    bar = budget["peak_force"]
    shares = {name: getattr(bar, name) for name in budget.causes}
    cause, *others = sorted(shares, key=lambda name: -shares[name])
    remedy = _remedy_of_stretch(hit) if cause == "stretch" else REMEDIES[cause]
    ending = _end_of_law(hit) if cause == "law" else f"{NARROWING.lower()}{remedy}"
    rest = [f"{name} {percent(shares[name])}" for name in others if shares[name] >= LEAST_TOLD]
    after = f", then {', '.join(rest)}" if rest else ""
    whole = "the bar of the peak force"
    if budget.no_bar:
        whole = "the known part of the peak force's error"
    told = f"the largest part of {whole} comes from the {cause}, {percent(shares[cause])}{after}"
    return f"{': '.join(filter(None, [told, ending]))}."


def _end_of_law(hit: History) -> str:
    """What is said of the share of a contact law: what narrows it, unless that is given."""
    choice = choice_of(hit.law, hit.model, hit.impactor)
    if isinstance(hit.law, YangSun):
        return OF_LAMINATE
    if choice is None:
        return ""
    strain = elastic_strain(choice, hit.peak_force, hit.deepest)
    if by_strain(choice, strain):
        return OF_STRAIN.format(strain)
    if choice.soft is None:
        return ""
    if weaker_side(hit).startswith("the striker"):
        return OF_STRIKER
    low, high = choice.soft.yield_range or (0.0, 0.0)
    if low == high:
        return NO_RANGE
    if not _of_table(choice.soft):
        return GIVEN_RANGE
    return f"{NARROWING.lower()}{REMEDIES['law']}"


def _of_table(matter: Matter) -> bool:
    """Whether a material has the range of strengths that the table has for its name."""
    return matter.name in materials.names() and (
        materials.record(matter.name).yield_range == matter.yield_range
    )


def _remedy_of_stretch(hit: History) -> str:
    """What narrows the bar by the choice of second-order modes."""
    stretch = getattr(hit.model, "stretch", None)
    taken = hit.assembly.stretched.get("structure")
    if stretch is not None and taken is not None and taken.size < stretch.size:
        if stretch.count != "auto" and stretch.count < MOST_ASKED:
            return REMEDIES["stretch"]
        if stretch.count == "auto" and hit.assembly.stretch_settled:
            return REMEDIES["time"]
    return NARROWED


#: A striker of unknown size is drawn as a ball of this density [kg/m^3].
STEEL = 7850.0


def caption(data: Data) -> str:
    """Text below the picture of the set-up."""
    if "fall" in data:
        return "Drag to turn; red: the impacts, click one."
    text = "Drag to turn; dark: held by supports; the arrow is the direction of impact."
    place = data.get("place")
    return f"{text} {place['told']}".rstrip() if place else text


def striker_place(hit: History, blow: Data) -> Data | None:
    """The striker's place in the picture and its drawing; None for a site without coordinates."""
    points = list(site_points(hit.model).values())
    direction = info_of(hit.model).direction
    if len(points) != 1 or len(points[0]) != 3 or direction is None or len(direction) != 3:
        return None
    radius, sentence = _drawn_striker(hit.impactor, blow)
    return {
        "point": list(points[0]),
        "direction": list(direction),
        "radius": radius,
        "tip": getattr(hit.impactor, "tip_radius", None),
        "told": sentence,
    }


def _drawn_striker(striker: LinearBody, blow: Data) -> tuple[float | None, str]:
    """(radius [m] of the ball that is drawn for the striker, sentence on it)."""
    if blow["radius"] is not None:
        return blow["radius"], ""
    tip = getattr(striker, "tip_radius", None)
    if tip is not None:
        return tip, "Of the striker only its round tip is drawn."
    if blow["mass"] is None:
        return None, ""
    radius = (blow["mass"] / (STEEL * 4 / 3 * pi)) ** (1 / 3)
    return radius, "The striker is drawn as a steel ball of its mass."
