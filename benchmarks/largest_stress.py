"""Whether the bar of a largest stress holds: blows on CAD parts by others, each at two speeds.

`python benchmarks/largest_stress.py FILES` prints a row for each part and each speed: the largest
stress with its bar by the mesh, on the mesh of the force and at the end of the rounds; the truth,
that of half the cells at its places; and processor seconds of the force with its bars and of the
rounds. `--fillets` strikes stepped bars in place of it, whose factors by Peterson are known.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

import antiosc as ao
from antiosc.fields.peaks import PeakField
from antiosc.strikes import stress
from antiosc_app.scene_file.document import read
from antiosc_app.scene_file.settled import settled

#: The bar by the mesh that is asked for.
TOLERANCE = 0.25
#: Factor from the default to the hard speed.
HARD = 10.0


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
    low, high = stress.bar(field)
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


def blow(scene: Path, speed: float) -> str:
    """The row of one blow."""
    document = read(scene)
    velocity = speed * document.data["impactor"]["velocity"]
    striker = {**document.data["impactor"], "velocity": velocity}
    document = replace(document, data={**document.data, "impactor": striker})

    # the force with its bars
    started = seconds()
    compiled, evaluate = settled(document)
    part, hit = evaluate(compiled.structure), evaluate(compiled.history)
    budget = hit.error_budget
    of_force = seconds() - started

    # the stress to the tolerance
    asked: list[Sequence[tuple[Sequence[float], float]]] = [[]]
    reduced = compiled.stresses.arguments["reduced"]

    def counted(places):
        asked.append(list(places))
        return reduced(places)

    first = interval(worst(stress.fields_by_strength(part, hit)))
    started, clock = seconds(), time.perf_counter()
    closed = stress.closed(hit, part, counted, TOLERANCE)
    of_stress, clock = seconds() - started, time.perf_counter() - clock
    field = worst(closed.fields)
    value, least, most = interval(field)

    # the truth: half the cells at the places of the largest value and of the largest bound
    bounds = np.where(field.counts, field.values + field.mesh_error, 0.0)
    values = np.where(field.counts, field.values, 0.0)
    sizes = stress.sizes_at_nodes(field.points, field._cells)
    places = {int(values.argmax()), int(bounds.argmax())}
    finer = [(tuple(field.points[k]), 0.5 * float(sizes[k])) for k in sorted(places)]
    used = asked[closed.rounds] if closed.rounds < len(asked) else asked[-1]
    structure, model = reduced([*used, *finer])
    again = stress._again(hit, model)
    truth = interval(worst(stress.fields_by_strength(structure, again)))[0]

    bar = max(value - least, most - value) / value
    verdict = "holds" if least <= truth <= most else "missed"
    state = "closed" if bar <= TOLERANCE else "cannot say"
    force = budget["peak_force"].known
    return (
        f"{velocity:6.3g} m/s {hit.peak_force:9.4g} N ±{100 * force:3.0f} %"
        f" | {first[0]:8.4g} ({first[1]:.4g}..{first[2]:.4g})"
        f" | {value:8.4g} ({least:.4g}..{most:.4g}) MPa | truth {truth:8.4g} {verdict} {state}"
        f" | {part.dofs} -> {closed.structure.dofs} -> {structure.dofs} dofs,"
        f" {closed.rounds} rounds | {of_force:.1f} + {of_stress:.1f} s ({clock:.0f} s)"
    )


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
    """The row of a stepped bar, struck slowly at its end."""
    d, radius = 0.02, share * 0.02
    D, half = STEP * d, 0.5 * d
    path = Path(folder, "stepped.geo")
    step, end = 0.05, 0.05 + radius
    profile = [(0, D / 2), (0, -D / 2), (step, -D / 2), (step, -half - radius), (end, -half)]
    profile += [(0.13, -half), (0.13, half), (end, half), (step, half + radius), (step, D / 2)]
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
    site = ao.Site((0.12, half, 0.002), (0, -1, 0), radius=4e-3)
    if way == "along":
        site = ao.Site((0.13, 0, 0.002), (-1, 0, 0), radius=4e-3)
    hit = ao.strike(
        *(path, site, ao.RigidMass(5.0, 0.05), ao.Linear(1e6), 2e-2),
        **{"tol": 0.1, "stress_tol": TOLERANCE, "material": steel, "supports": held},
    )
    (field,) = hit.stresses.values()
    near = field.counts & (abs(field.points[:, 0] - 0.05) < 2 * radius)
    k = int(np.argmax(np.where(near, field.values, 0.0)))
    nominal = hit.peak_force / (0.004 * d)
    if way == "across":
        nominal *= 6 * (0.12 - field.points[k, 0]) / d
    low, high = stress.bar(field)
    expected = peterson(radius, d, way)
    found = field.values[k] / nominal
    return (
        f"{way:6} R/d {share:4.2f}: K_t {found:.3f} (-{100 * low:.0f} +{100 * high:.0f} %),"
        f" Peterson {expected:.3f}, {100 * (found / expected - 1):+.1f} %; {field.rounds}"
    )


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", type=Path, nargs="*", help="CAD files")
    parser.add_argument("--fillets", action="store_true", help="stepped bars")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")

    with tempfile.TemporaryDirectory() as folder:
        for share, way in product(FILLETS, CHARTS) if asked.fillets else ():
            print(fillet(share, folder, way), flush=True)
        for part in asked.parts:
            scene = scene_of(part, folder)
            for speed in (1.0, HARD) if scene else ():
                try:
                    print(f"{part.stem:24} {blow(scene, speed)}", flush=True)
                except ao.errors.AntioscError as error:
                    print(f"{part.stem:24} {error}", flush=True)
            if scene is None:
                print(f"{part.stem:24} no scene", flush=True)


if __name__ == "__main__":
    main()
