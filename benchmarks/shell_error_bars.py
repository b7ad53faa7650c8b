"""How good error bars of shells are: random shells and impacts, against nested finer meshes.

Plates, plates with a hole or a notch, folded sheets, sheets of two thicknesses, sheets with a rib,
curved panels and tubes, isotropic or laminated, thin or thick (thickness 0.3 to 10 % of the
length), held softly or firmly, along all edges or one, or free, are struck by masses of 2 to 100 %
of theirs in a time of 0.1 to 2 longest periods. The reference is the same impact on the corrected
model of a mesh whose cells are divided twice, or of one of a quarter of the size where the cells
are curved.

The factor of safety is calibrated with the even shells and tried on the odd ones. With `--out`
every shell is written to a file as soon as it is done; shells that stand there are not done again.

    .venv/bin/python benchmarks/shell_error_bars.py --help
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import options

import antiosc as ao
from antiosc.impact.error_budget import (
    COARSE_SHELL,
    SAFETY,
    SAFETY_COARSE,
    SHELL,
)
from antiosc.impact.histories.bars import FLOOR, QUANTITIES, differences
from antiosc.reduce.error.bisection import refined

ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
PLY = ao.Layer(130e9, 9e9, 0.3, 5e9, 5e9, 3.5e9, 1600.0, 1e-3)
ANGLES = (0, 45, -45, 90, 90, -45, 45, 0)
SHAPES = ("plate", "hole", "notch", "fold", "step", "rib", "panel", "tube")
CURVED = ("panel", "tube")
ANTI_OSCILLATORS, TIME_TOL = 30, 1e-5
#: Halvings of the cells of the reference; errors below this are those of the time integration.
HALVINGS, LEAST = 2, 1e-6
#: Factors of safety that are tried.
FACTORS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
#: Sizes of the elements of a plate and of a tube of which the cost is measured, and its runs.
COSTLY, ROUNDS = {"plate": 0.028, "tube": 0.036}, 3

PAGE = """# Error bars of shells

Written by `benchmarks/shell_error_bars.py --shells {shells} --seed {seed}`. {what}

How often the bars hold with other factors of safety, for shells with an energy error below
{coarse}. The factor {usual:g} was chosen with a margin over what the even numbers ask for:

{factors}

With this factor ({larger:g}, and at least the energy error, for larger ones), by class. "Bar over
error": of the worst of the three quantities.

{table}

Share of the estimate in an extraction of {anti_oscillators} anti-oscillators, least of {rounds}
runs:

{costs}
"""
PLATE = 'SetFactory("OpenCASCADE"); Rectangle(1) = {{0, 0, 0, 1, {b}}};\n'
CUT = "BooleanDifference{{ Surface{{1}}; Delete; }}{{ Surface{{2}}; Delete; }}\n"
TWO = """
Point(1) = {{0, 0, 0}}; Point(2) = {{{c}, 0, 0}}; Point(3) = {{{c}, {b}, 0}};
Point(4) = {{0, {b}, 0}}; Point(5) = {{{x}, 0, {z}}}; Point(6) = {{{x}, {b}, {z}}};
Line(1) = {{1, 2}}; Line(2) = {{2, 3}}; Line(3) = {{3, 4}}; Line(4) = {{4, 1}};
Line(5) = {{2, 5}}; Line(6) = {{5, 6}}; Line(7) = {{6, 3}};
Curve Loop(1) = {{1, 2, 3, 4}}; Plane Surface(1) = {{1}};
Curve Loop(2) = {{5, 6, 7, -2}}; Plane Surface(2) = {{2}};
Physical Surface("one") = {{1}}; Physical Surface("other") = {{2}}; Physical Curve("rib") = {{2}};
"""
BENT = (
    'SetFactory("OpenCASCADE"); Point(1) = {{0, 0, 0}}; Point(2) = {{0, {b}, 0}}; '
    "Line(1) = {{1, 2}}; Extrude{{ {{0, 1, 0}}, {{0, 0, -{R}}}, {turn} }}{{ Line{{1}}; }}\n"
)


@dataclass
class Case:
    """One random shell and impact, and what was found.

    Errors and estimates are relative, of peak force, impulse and contact time; `estimate` is the
    larger one of both corrections of the error budget. `speed` is the contact time over the longest
    period, `energy_error` the share of the errors of strains in the energy.
    """

    number: int
    shape: str
    ends: str
    layered: bool
    thickness: float
    size: float
    width: float
    cut: float
    angle: float
    place: list[float]
    mass: float
    speed: float
    dofs: int = 0
    energy_error: float = 0.0
    k0_error: float = 0.0
    k0_estimate: float = 0.0
    comparable: bool = True
    error: list[float] = field(default_factory=list)
    estimate: list[float] = field(default_factory=list)
    corrected: list[float] = field(default_factory=list)
    holds: bool = False
    refused: str = ""

    @property
    def kinds(self) -> list[str]:
        """Classes of the case."""
        return [
            "all",
            "energy error < 5 %" if self.energy_error < COARSE_SHELL else "energy error > 5 %",
            f"shape: {self.shape}",
            f"ends: {self.ends}",
            "layers" if self.layered else "isotropic",
            "thickness < 1 %" if self.thickness < 0.01 else "thickness > 1 %",
            "even numbers" if self.number % 2 == 0 else "odd numbers",
        ]

    @property
    def used(self) -> slice:
        """The quantities that are comparable."""
        return slice(None) if self.comparable else slice(0, 2)

    def ratio(self, error: Sequence[float]) -> float:
        """The largest error over its bar without the factor of safety."""
        bars = np.maximum(self.estimate, FLOOR * max(self.estimate[self.used]))
        return float(np.max(np.asarray(error)[self.used] / np.maximum(bars[self.used], LEAST)))


def drawn(number: int, rng: np.random.Generator) -> Case:
    """A random case."""

    def spread(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    shape = SHAPES[number // 2 % len(SHAPES)]
    layered = rng.random() < 0.25
    return Case(
        number=number,
        shape=shape,
        ends=str(rng.choice(["soft", "firm", "one", "free"])),
        layered=layered,
        thickness=spread(0.003, 0.1) if shape not in CURVED else spread(0.005, 0.05),
        size=spread(0.06, 0.2) if shape not in CURVED else spread(0.06, 0.15),
        width=float(rng.uniform(0.6, 1.0)),
        cut=float(rng.uniform(0.4, 0.6)),
        angle=float(rng.uniform(25, 110)),
        place=rng.uniform(0.05, 0.95, 2).tolist(),
        mass=spread(0.02, 1.0),
        speed=spread(0.1, 2.0),
    )


def geometry(case: Case) -> str:
    """The shell for gmsh, of length and width about 1."""
    b, c = case.width, case.cut
    if case.shape in CURVED:
        R = 1.0 if case.shape == "panel" else 0.3
        turn = 0.8 if case.shape == "panel" else 2 * np.pi
        return BENT.format(b=b, R=R, turn=turn)
    if case.shape in ("fold", "step", "rib"):
        angle = np.radians(case.angle if case.shape == "fold" else 0.0)
        return TWO.format(b=b, c=c, x=c + (1 - c) * np.cos(angle), z=(1 - c) * np.sin(angle))
    text = PLATE.format(b=b)
    if case.shape == "hole":
        text += f"Disk(2) = {{0.7, {b / 2}, 0, {0.2 * case.cut}}};\n" + CUT.format()
    if case.shape == "notch":
        text += f"Rectangle(2) = {{0, 0, 0, {case.cut}, {b / 2}}};\n" + CUT.format()
    return text


def site_of(case: Case) -> ao.Site:
    """A place on the shell, away from its cuts, and the normal there."""
    u, v = case.place
    b, c = case.width, case.cut
    if case.shape in CURVED:
        R, turn = (1.0, 0.8) if case.shape == "panel" else (0.3, 2 * np.pi)
        angle = u * turn
        normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
        return ao.Site(np.array([0, v * b, -R]) + R * normal, -normal, snap=True)
    x, y = {
        "hole": (0.5 * u, v * b),
        "notch": (c + u * (1 - c), v * b),
        "fold": (u * c, v * b),
    }.get(case.shape, (u, v * b))
    return ao.Site((x, y, 0.0), (0, 0, -1))


def top_of(case: Case):  # type: ignore[no-untyped-def]
    """A direction out of the shell on one side of it, for the order of its layers."""
    if case.shape in CURVED:
        R = 1.0 if case.shape == "panel" else 0.3
        return lambda x: np.stack([x[0], 0 * x[0], x[2] + R])
    half = np.radians(case.angle) / 2 if case.shape == "fold" else 0.0
    return (-np.sin(half), 0.0, np.cos(half))


def structure(case: Case, mesh: ao.Mesh) -> ao.Structure:
    """The shell of a case on a mesh."""

    def sheet(thickness: float) -> ao.Shell | ao.Laminate:
        if not case.layered:
            return ao.Shell(**ALUMINIUM, thickness=thickness)
        plies = [replace(PLY, angle=a, thickness=thickness / len(ANGLES)) for a in ANGLES]
        return ao.Laminate(plies, axis=(0, 1, 0), top=top_of(case))

    material = sheet(case.thickness)
    if case.shape == "step":
        material = {"one": material, "other": sheet(0.6 * case.thickness)}
    if case.shape == "rib":
        height = 3 * case.thickness
        section = ao.Section.rectangle(case.thickness, height)
        offset = (height + case.thickness) / 2
        beam = ao.Beam(**ALUMINIUM, section=section, orientation=(0, 0, 1), offset=offset)
        material = {"one": material, "other": material, "rib": beam}
    b = case.width

    def edges(x: np.ndarray) -> np.ndarray:
        ends = np.isclose(x[1], 0, atol=1e-6) | np.isclose(x[1], b, atol=1e-6)
        if case.shape in ("plate", "hole", "notch", "step", "rib"):
            ends |= np.isclose(x[0], 0, atol=1e-6) | np.isclose(x[0], 1, atol=1e-6)
        return np.asarray(ends)

    supports = {
        "soft": [ao.Support(edges, ("x", "y", "z"))],
        "firm": [ao.Support(edges)],
        "one": [ao.Support(lambda x: np.isclose(x[1], b, atol=1e-6))],
        "free": [],
    }[case.ends]
    return ao.Structure(mesh, material, supports)


def tried(case: Case, path: Path) -> None:
    """Fill in what is found."""
    path.write_text(geometry(case))
    curved = case.shape in CURVED
    mesh = ao.read_mesh(path, size=case.size, order=2 if curved else 1)
    fine = mesh
    if curved:
        fine = ao.read_mesh(path, size=case.size / 2**HALVINGS, order=2)
    else:
        for _ in range(HALVINGS):
            fine = refined(fine, np.full(fine.n_cells, 0.5))
    part, site = structure(case, mesh), site_of(case)
    model = ao.extract(part, site, n=ANTI_OSCILLATORS, error="estimate")
    true_model = ao.extract(structure(case, fine), site, n=ANTI_OSCILLATORS, error="estimate")
    true_model = true_model.corrected()
    omega = model.modal().omega
    contact = case.speed * 2 * np.pi / omega[omega > 1e-3 * omega[-1]][0]
    mass = case.mass * part.mass
    # of a rigid wall: contact time 2.94 δ/v, δ = (5 m v² / 4 k)^(2/5)
    impact = ao.RigidMass(mass, 1.0), ao.Hertz(1.25 * mass / (contact / 2.94) ** 2.5)
    duration = 2.5 * contact
    if model.k0:
        duration += 1.2 * np.pi * np.sqrt((mass + model.m_st) / model.k0)

    def struck(each: ao.AntiOscillators) -> ao.History:
        return ao.simulate(each, *impact, duration, tol=TIME_TOL)

    hit, true = struck(model), struck(true_model)
    soft, without = (
        struck(each.corrected()) for each in (model, replace(model, strain_misfit=None))
    )
    budget = hit.error_budget
    case.dofs, case.energy_error = part.dofs, budget.energy_error
    case.k0_error, case.k0_estimate = (
        stiffness(model) / stiffness(each) - 1 for each in (true_model, model.corrected())
    )
    # a bar of the contact time says so itself if the number of contacts differs
    case.comparable = len(hit.contacts) == len(soft.contacts)
    error, *both, corrected = (
        [differences(*pair)[name] for name in QUANTITIES]
        for pair in ((hit, true), (hit, soft), (hit, without), (soft, true))
    )
    case.error, case.corrected = error, corrected
    case.estimate = np.max(both, axis=0).tolist()
    bars = [budget[name].mesh + LEAST for name in QUANTITIES]
    case.holds = bool(np.all((np.array(error) <= bars)[case.used]))


def stiffness(model: ao.AntiOscillators) -> float:
    """k0, or the first ω² of a free shell."""
    return float(model.k0 or model.omega[0] ** 2)


def main(shells: int = 16, seed: int = 0, out: str = "", page: str = "") -> list[Case]:
    """Try `shells` random shells; print how often the bars hold, and the table by class.

    With `page` the tables are written to that file too, and the cost of the estimate is measured.
    """
    path = Path(out) if out else None
    known = {}
    if path and path.exists():
        rows = [Case(**json.loads(row)) for row in path.read_text().splitlines()]
        known = {case.number: case for case in rows}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        for number in range(shells):
            if number in known:
                continue
            case = drawn(number, np.random.default_rng([seed, number]))
            try:
                tried(case, Path(folder) / "shell.geo")
            except ao.AntioscError as error:
                case.refused = str(error)
            known[number] = case
            print(line(case), flush=True)
            if path:
                with path.open("a") as file:
                    file.write(json.dumps(asdict(case)) + "\n")
    cases = [known[number] for number in sorted(known) if number < shells]
    done = [case for case in cases if not case.refused]
    print(factors(done), table(done), sep="\n\n")
    if page:
        assert __doc__
        text = PAGE.format(
            shells=shells,
            seed=seed,
            what=" ".join(__doc__.split("\n\n")[1].split()),
            coarse=COARSE_SHELL,
            factors=factors(done),
            usual=SAFETY * SHELL,
            larger=SAFETY_COARSE * SHELL,
            table=table(done),
            anti_oscillators=ANTI_OSCILLATORS,
            rounds=ROUNDS,
            costs=costs(COSTLY),
        )
        Path(page).write_text(text)
    return cases


def costs(sizes: dict[str, float]) -> str:
    """Share of the estimate in the seconds of an extraction, as a table in Markdown."""
    rows = ["| shell | dofs | extraction (s) | estimate (s) | share |", "|---|---|---|---|---|"]
    for shape, size in sizes.items():
        case = replace(drawn(0, np.random.default_rng(0)), shape=shape, layered=False, ends="one")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "shell.geo"
            path.write_text(geometry(case))
            mesh = ao.read_mesh(path, size=size, order=2 if shape in CURVED else 1)
        least = [np.inf, 0.0]
        for _ in range(ROUNDS):
            part = structure(case, mesh)
            model = ao.extract(part, site_of(case), n=ANTI_OSCILLATORS, error="estimate")
            seconds = dict(model.info["seconds"])
            own = seconds.pop("error")
            whole = sum(seconds.values()) + own
            least = min(least, [whole, own], key=lambda pair: pair[0])
        share = least[1] / least[0]
        rows.append(f"| {shape} | {part.dofs} | {least[0]:.2f} | {least[1]:.2f} | {share:.1%} |")
    return "\n".join(rows)


def line(case: Case) -> str:
    """What was found, for the eye."""
    kind = f"{case.number:4d} {case.shape}, {case.ends}{', layers' * case.layered}"
    if case.refused:
        return f"{kind}: refused: {case.refused}"
    return (
        f"{kind}, t {case.thickness:.3g}, {case.dofs} dofs: energy error {case.energy_error:.1e}, "
        f"k0 {case.k0_error:+.1e} (estimate {case.k0_estimate:+.1e}), error over estimate "
        f"{case.ratio(case.error):.2f}, corrected {case.ratio(case.corrected):.2f}"
        f"{'' if case.holds else ', bar FAILS'}"
    )


def factors(cases: Sequence[Case]) -> str:
    """How often the bars hold with each factor of safety, for even and odd numbers."""
    rows = ["| factor | even: bars hold | odd: bars hold |", "|---|---|---|"]
    good = [case for case in cases if case.energy_error < COARSE_SHELL]
    halves = [[case for case in good if case.number % 2 == k] for k in (0, 1)]
    for factor in FACTORS:
        shares = [
            f"{np.mean([c.ratio(c.error) <= factor for c in half]):.0%}" if half else ""
            for half in halves
        ]
        rows.append(f"| {factor:g} | {shares[0]} | {shares[1]} |")
    return "\n".join(rows)


def table(cases: Sequence[Case]) -> str:
    """Figures by class, as a table in Markdown."""
    rows = [
        "| class | shells | bars hold | bar over error, median | corrected over raw error, median "
        "| bars of the corrected model hold |",
        "|---|---|---|---|---|---|",
    ]
    kinds = sorted({kind for case in cases for kind in case.kinds})
    for kind in kinds:
        own = [case for case in cases if kind in case.kinds]
        usual = SAFETY * SHELL
        width = [usual / max(case.ratio(case.error), LEAST) for case in own]
        nearer = [
            max(case.corrected[case.used]) / max(max(case.error[case.used]), LEAST) for case in own
        ]
        answers = [case.ratio(case.corrected) <= usual - 1 for case in own]
        rows.append(
            f"| {kind} | {len(own)} | {np.mean([case.holds for case in own]):.0%} | "
            f"{np.median(width):.1f} | {np.median(nearer):.2f} | {np.mean(answers):.0%} |"
        )
    return "\n".join(rows)


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shells", type=options.count, default=16, help="random shells")
    parser.add_argument("--seed", type=options.seed, default=0, help="of the random shells")
    parser.add_argument("--out", default="", help="file for the cases, one a line")
    parser.add_argument("--page", default="", help="file for the tables, Markdown")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
