"""Whether the bar of a largest stress holds: blows on CAD parts by others, and falls of them.

`python benchmarks/largest_stress.py FILES` adds rows to speed/largest_stress.md, which is read
first: blows that it has are not struck again. A part is struck at the speed that `antiosc new`
gives it and at ten times that; with `--dropped` it falls 1 m onto a rigid floor instead. The truth
is the largest stress on one more mesh for all blows of a part: uniform cells that bring at least
`--dofs`, and half of the cells at the places of the largest stress and of its largest bound.
`--fillets` strikes stepped bars, whose factors by Peterson are known.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import antiosc as ao
from antiosc.fields.margin import sizes_at_nodes
from antiosc.fields.peaks import PeakField
from antiosc.io.isolation import Refinement
from antiosc.strikes import stress
from antiosc_app.scene_file.build import Builder, Call, Evaluation, calls_in
from antiosc_app.scene_file.document import Document, read_document
from antiosc_app.scene_file.scene import exchanged_call, with_smaller_cells
from antiosc_app.scene_file.settled import begin_settling, settle

OUT = Path(__file__).parent / "speed" / "largest_stress.md"
#: Beginning of the page, up to the rows.
HEAD = """\
# Bars of largest stresses

CAD parts by others, struck as `antiosc new` proposes and at ten times that speed, or dropped 1 m
onto a rigid floor; the largest stress to 25 % by the mesh. The truth is the same run on a mesh of
uniform cells, with half of the cells at the places of the largest stress and of its largest bound.
The force has its known bar, and its share by the mesh. Processor seconds of a machine with other
work: ratios tell more. The parts are those of the robots [Thor](https://github.com/AngelLM/Thor)
and [SO-101](https://github.com/TheRobotStudio/SO-ARM100).

"""
#: Columns of the rows.
COLUMNS = (
    *("blow", "force", "first mesh, MPa", "at the end, MPa", "truth, MPa", "bar"),
    *("answer / of the truth", "rounds", "dofs: end / truth", "s: force + stress, truth"),
)

#: The bar by the mesh that is asked for.
TOLERANCE = 0.25
#: Factor from the default to the hard speed.
HARD = 10.0
#: The fall of parts that are dropped.
FALL = {"height": 1.0, "tilt": [20.0, 30.0, 0.0], "until": 1}


def seconds() -> float:
    """Processor time of this process and its children [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def worst(fields: dict[str, PeakField]) -> PeakField:
    """The field that decides."""
    return max(fields.values(), key=lambda field: field.values[field.counts].max())


def interval(field: PeakField) -> tuple[float, float, float]:
    """(value, least, largest) of the largest stress that counts, by the mesh [MPa]."""
    value = 1e-6 * float(field.values[field.counts].max())
    low, high = stress.stress_bar(field)
    return value, value * (1 - low), value * (1 + high)


def scene_of(part: Path, folder: str) -> Path | None:
    """The scene that `antiosc new` writes for a part; None if it has none."""
    scene = Path(folder, f"{part.stem}.toml")
    command = [sys.executable, "-m", "antiosc", "new", str(scene), str(part.resolve())]
    try:
        made = subprocess.run(command, capture_output=True, timeout=120, cwd=folder)
    except subprocess.TimeoutExpired:
        return None
    return scene if made.returncode == 0 else None


@dataclass
class Blow:
    """A blow, or a fall, whose largest stress has been brought to the tolerance."""

    name: str
    force: str
    first: tuple[float, float, float]  # on the mesh of the force, as `interval` gives it
    closed: stress.StressResult
    part: Call  # of the scene
    first_dofs: int
    finest: list[Refinement]  # half of the cells at the places of the largest stress
    stress_of: Callable[[ao.Structure], PeakField]  # on another mesh
    seconds: tuple[float, float]  # processor seconds of the force and of the stress


def struck(document: Document, name: str, speed: float) -> Blow:
    """The blow of a scene at a multiple of its speed."""
    velocity = speed * document.data["impactor"]["velocity"]
    striker = {**document.data["impactor"], "velocity": velocity}
    document = replace(document, data={**document.data, "impactor": striker})

    started = seconds()
    scene, evaluate = settle(document)
    part, hit = evaluate(scene.structure), evaluate(scene.history)
    bar = hit.error_budget["peak_force"]
    of_force = seconds() - started
    site, n = evaluate(scene.model.arguments["site"]), hit.model.n

    def again(structure: ao.Structure) -> ao.History:
        return stress.struck_again(hit, structure, ao.extract(structure, site, n=n))

    force = f"{hit.peak_force:.4g} N ± {100 * bar.known:.0f} %, mesh {100 * bar.mesh:.2g} %"
    run = part, hit, again, stress.fields_by_strength
    return closed(f"{name}, {velocity:.3g} m/s", force, scene, run, of_force)


def dropped(document: Document, name: str) -> Blow:
    """The first impact of a fall."""
    kept = {key: document.data[key] for key in ("title", "geometry", "material")}
    document = replace(document, data={**kept, "drop": FALL})

    started = seconds()
    scene, evaluate = begin_settling(document)
    part, fall = evaluate(scene.structure), evaluate(scene.fall)
    of_force = seconds() - started

    def again(structure: ao.Structure) -> ao.Fall:
        made = replace(scene.structure, result=structure)
        return Evaluation(document)(exchanged_call(scene.fall, {scene.structure: made}))

    def stresses(_: ao.Structure, fall: ao.Fall) -> dict[str, PeakField]:
        return {"von_mises": fall.worst()}

    force = f"{fall.peak_force:.4g} N ± {100 * (fall.law_error or np.nan):.0f} %"
    run = part, fall, again, stresses
    return closed(f"{name}, fall", force, scene, run, of_force)


def closed(name: str, force: str, scene: Any, run: tuple[Any, ...], of_force: float) -> Blow:
    """A blow with its stress to the tolerance; `run`: part, history, rerun and stress fields."""
    part, hit, again, fields = run
    first = interval(worst(fields(part, hit)))
    used: list[list[Refinement]] = [[]]

    def finer(places: Sequence[Refinement]) -> ao.Structure:
        used.append(list(places))
        return with_smaller_cells(Builder(scene.document), scene.structure, part, places)

    def stress_of(structure: ao.Structure) -> PeakField:
        return worst(fields(structure, again(structure)))

    started = seconds()
    found = stress.closed(hit, part, TOLERANCE, finer, again, fields)
    of_stress = seconds() - started

    # half the cells at the places of the largest value and of the largest bound
    field = worst(found.fields)
    values = np.where(field.counts, field.values, 0.0)
    bounds = np.where(field.counts, field.values + field.mesh_error, 0.0)
    sizes = sizes_at_nodes(field.points, field._cells)
    places = sorted({int(values.argmax()), int(bounds.argmax())})
    halves = [(tuple(field.points[k].tolist()), 0.5 * float(sizes[k])) for k in places]
    finest = [*used[found.rounds], *halves]
    used_seconds = of_force, of_stress
    return Blow(
        *(name, force, first, found, scene.structure, part.dofs, finest, stress_of, used_seconds)
    )


def finest(document: Document, blows: Sequence[Blow], least: int) -> ao.Structure:
    """The part in uniform cells that bring `least` dofs, and in half of the cells at the places."""
    call = blows[0].part
    geometry = next(one for one in calls_in(call) if one.place == ("geometry",))
    places = [place for blow in blows for place in blow.finest]
    refine = [*geometry.arguments.get("refine", ()), *places]
    evaluate = Evaluation(document)

    guess = (blows[0].first_dofs / least) ** 0.4
    size, nodes = min(guess, 0.8) * geometry.arguments["size"], 0
    while 3 * nodes < 0.9 * least:
        finer = replace(geometry, arguments={**geometry.arguments, "size": size, "refine": refine})
        nodes = len(evaluate(finer).dolfinx.geometry.x)
        size *= min((3 * nodes / least) ** 0.4, 0.9)

    return evaluate(exchanged_call(call, {geometry: finer}))


def row(blow: Blow, structure: ao.Structure) -> str:
    """The row of a blow, with the truth of another mesh."""
    started = seconds()
    truth = blow.stress_of(structure)
    field = worst(blow.closed.fields)
    value, least, most = interval(field)
    true = interval(truth)[0]

    bar = max(value - least, most - value) / value
    ends = "closed" if bar <= TOLERANCE else "cannot say"
    holds = "holds" if least <= true <= most else "missed"
    force, of_stress = blow.seconds
    cells = [
        *(blow.name, blow.force, "{:.4g} ({:.4g} to {:.4g})".format(*blow.first)),
        *(f"{value:.4g} ({least:.4g} to {most:.4g})", f"{true:.4g}", f"{ends}, {holds}"),
        *(f"{field.margin().answer} / {truth.margin().answer}", f"{blow.closed.rounds}"),
        f"{blow.closed.structure.dofs} / {structure.dofs}",
        f"{force:.1f} + {of_stress:.1f}, {seconds() - started:.0f}",
    ]
    return f"| {' | '.join(cells)} |"


def rows_of(path: Path, folder: str, least: int, falls: bool) -> list[str]:
    """The rows of a part."""
    scene = scene_of(path, folder)
    if scene is None:
        return [f"| {path.stem} | no scene |"]
    document = read_document(scene)
    blows = (
        [dropped(document, path.stem)]
        if falls
        else [struck(document, path.stem, speed) for speed in (1.0, HARD)]
    )
    structure = finest(document, blows, least)
    return [row(blow, structure) for blow in blows]


#: The bar by the mesh that is asked for at fillets.
OF_FILLETS = 0.05
#: R/d of the fillets, and D/d of the stepped bars.
FILLETS, STEP = (0.03, 0.05, 0.1, 0.2, 0.3), 2.0
#: Stepped flat bar, h/r < 2 and 2 < h/r < 20, under a blow across (bending: Peterson, chart 3.8)
#: and along (chart 3.1).
CHARTS = {
    "across": (
        ((1.007, 1.0, -0.031), (-0.27, -2.404, 0.749),
         (0.677, 1.133, -0.904), (-0.414, 0.271, 0.186)),
        ((1.042, 0.982, -0.036), (-3.599, 1.619, -0.431),
         (6.084, -5.607, 1.158), (-2.527, 3.006, -0.691)),
    ),
    "along": (
        ((1.006, 1.008, -0.044), (-0.115, -0.584, 0.315),
         (0.245, -1.006, -0.257), (-0.135, 0.582, -0.017)),
        ((1.02, 1.009, -0.048), (-0.065, -0.165, -0.007),
         (-3.459, 1.266, -0.016), (3.505, -2.109, 0.069)),
    ),
}  # fmt: skip


def peterson(radius: float, d: float, way: str) -> float:
    """Factor of a stepped flat bar of D = `STEP` d with a fillet of `radius`."""
    h = (STEP - 1) * d / 2
    rows = CHARTS[way][h / radius > 2]
    share = 2 * h / (STEP * d)
    factors = [a + b * np.sqrt(h / radius) + c * h / radius for a, b, c in rows]
    return float(np.polyval(factors[::-1], share))


def fillet(share: float, folder: str, way: str) -> str:
    """The row of a stepped bar, struck at its end: slowly and far, for bending without shear."""
    d, radius = 0.02, share * 0.02
    D, half = STEP * d, 0.5 * d
    path = Path(folder, "stepped.geo")
    step, end, length = 0.05, 0.05 + radius, 0.25
    profile = [(0, D / 2), (0, -D / 2), (step, -D / 2), (step, -half - radius), (end, -half)]
    profile += [(length, -half), (length, half), (end, half), (step, half + radius), (step, D / 2)]
    centres = [(end, -half - radius), (end, half + radius)]
    lines = ['SetFactory("OpenCASCADE");']
    lines += [f"Point({i + 1}) = {{{x}, {y}, 0}};" for i, (x, y) in enumerate(profile + centres)]
    arcs = {3: 11, 7: 12}  # start of the arc -> its centre
    for i in range(10):
        ends = [i + 1, *([arcs[i]] if i in arcs else []), (i + 1) % 10 + 1]
        kind = "Circle" if i in arcs else "Line"
        lines += [f"{kind}({i + 1}) = {{{', '.join(map(str, ends))}}};"]
    lines += ["Curve Loop(1) = {1:10}; Plane Surface(1) = {1};"]
    lines += ["Extrude {0, 0, 0.004} { Surface{1}; }"]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")

    steel = ao.Solid(210e9, 0.3, 7850.0, yield_strength=250e6)
    held = [ao.Support(plane=((0, 0, 0), (1, 0, 0)))]
    site = ao.Site((length - half, half, 0.002), (0, -1, 0), radius=4e-3)
    if way == "along":
        site = ao.Site((length, 0, 0.002), (-1, 0, 0), radius=0.55 * d)  # the whole end
    hit = ao.strike(
        *(path, site, ao.RigidMass(200.0, 0.01), ao.Linear(1e6), 0.15),
        **{"tol": 0.1, "stress_tol": OF_FILLETS, "material": steel, "supports": held},
    )
    (field,) = hit.stresses.values()
    near = field.counts & (abs(field.points[:, 0] - 0.05) < 2 * radius)
    k = int(np.argmax(np.where(near, field.values, 0.0)))
    nominal = hit.peak_force / (0.004 * d)
    if way == "across":
        nominal *= 6 * (length - half - field.points[k, 0]) / d
    low, high = stress.stress_bar(field)
    expected = peterson(radius, d, way)
    found = field.values[k] / nominal
    return (
        f"{way:6} R/d {share:4.2f}: K_t {found:.3f} (-{100 * low:.0f} +{100 * high:.0f} %),"
        f" Peterson {expected:.3f}, {100 * (found / expected - 1):+.1f} %; {field.rounds}"
    )


def main() -> None:
    """Print the rows of stepped bars, and add those of parts to the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", type=Path, nargs="*", help="CAD files")
    parser.add_argument("--fillets", action="store_true", help="stepped bars")
    parser.add_argument("--dropped", action="store_true", help="the parts fall")
    parser.add_argument("--dofs", type=int, default=400_000, help="least of a truth")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")

    with tempfile.TemporaryDirectory() as folder:
        for share, way in product(FILLETS, CHARTS) if asked.fillets else ():
            print(fillet(share, folder, way), flush=True)

        for path in asked.parts:
            rule = "|---" * len(COLUMNS)
            page = f"{HEAD}| {' | '.join(COLUMNS)} |\n{rule}|\n"
            page = OUT.read_text(encoding="utf-8") if OUT.exists() else page
            if f"| {path.stem}, {'fall' if asked.dropped else ''}" in page:
                continue
            for line in rows_of(path, folder, asked.dofs, asked.dropped):
                print(line, flush=True)
                page += line + "\n"
            OUT.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
