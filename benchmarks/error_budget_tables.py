"""The page `speed/error_budget.md` and its pictures, from the files of `make bench-budget`.

    .venv/bin/python benchmarks/error_budget_tables.py --parts out/error_budget.jsonl \
        --runs out/strike_or_uniform.json --page benchmarks/speed/error_budget.md
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import error_budget
import numpy as np
import options
import strike_or_uniform
import structured_blocks
from random_parts import Case

PAGE = """# How good error budgets are

Written by `make bench-budget` ({parts} random parts, seed {seed}), all of it by one version of the
code. Two shared cores, Debian 12 (dolfinx 0.5.2); seconds are CPU seconds, without gmsh's.

## Random parts

Plates, and every sixth time a block, with holes and notches, held or free, struck fast or slowly,
with some hundred to some thousand dofs each. The truth is the same impact with twice the
anti-oscillators on the corrected model of a mesh of degree 2 that is adapted until the errors of
its strains are a fiftieth of the part's; its errors of strains are {reference} of the part's in
the median ({reference_space} of blocks).

"k0 within": effectivity (estimated over true error) in [0.5, 2], in space [0.4, 2.5], of the
first ω² where the part is free; "force within": of the worst of peak force, impulse and contact
time in [0.5, 3]; "bars hold": all three true errors are below their bars; "corrected": median of
the error of the corrected model over that of the raw one; "its bars hold": the same for the
corrected model; "strike": `strike` from the geometry with tol = 1 % has a true error of at most 1
%; "two meshes": the bars of `strike` hold with tol = 0.03 % (blocks 0.3 %), where it took several
meshes.

{classes}

![Effectivities, and true errors over their bars](error_budget_effectivity.png)

{misses}

**Where the estimate is weak** the budget says so: patches that the mesh does not resolve, energy
errors above 0.1 and flat faces of curved surfaces have the lowest effectivities of the table, and
wider bars (factors of 3 and more, the share of the geometry).

**A block on structured meshes** (`benchmarks/structured_blocks.py`), 120 × 60 × 20 mm, clamped at
one end, with a patch of 12 mm radius:

{blocks}

## `strike` beside fixed choices

`benchmarks/strike_or_uniform.py`. For each tolerance what was asked, what the budget promises
(without the patch, whose radius is the same in all runs), and the true error of the worst
quantity; then the cheapest of a grid of fixed choices with smaller elements around the site
(three sizes, degrees 1 and 2, n = 6, 12, 20, two time steps; without and with the correction)
with a true error of at most 1 % and 0.1 %. A fixed choice does not know its error. The truth is
the corrected model of an adapted mesh. "Not met": the answer has status 1 and says why (the
shares of patch and time steps take the tolerance alone, the memory, or {limit:g} s).

{scenes}

CPU seconds of `strike` with tol = 1 % over those of the cheapest fixed choice within 1 %:
{ratios}.

![Error against CPU seconds](strike_or_uniform.png)

**Uniform and adapted meshes**, truly uniform ones up to the site:

{meshes}

{uniform}

**Cost of the estimate**, the bracket with small elements at the site, {cost}
"""


def main(parts: str, runs: str, page: str, seed: int = 2026) -> str:
    """Write the page."""
    cases = [case for _, case in sorted(error_budget.read(Path(parts)).items())]
    done = [case for case in cases if not case.refused]
    found = json.loads(Path(runs).read_text())
    text = PAGE.format(
        parts=len(cases),
        seed=seed,
        reference=f"{np.median([case.reference for case in done]):.1g}",
        reference_space=f"{np.median([c.reference for c in done if c.dim == 3] or [0.0]):.1g}",
        classes=error_budget.table(done),
        misses=misses(cases),
        blocks=structured_blocks.table(),
        limit=strike_or_uniform.LIMIT,
        scenes="\n\n".join(scene(name, each) for name, each in found.items()),
        ratios=", ".join(f"{name} {ratio(each):.2f}" for name, each in found.items()),
        meshes=meshes(found),
        uniform=uniform(found),
        cost="".join(cost(each["cost"]) for each in found.values() if "cost" in each),
    )
    Path(page).write_text(text)
    error_budget.histogram(done, Path(page).with_name("error_budget_effectivity.png"))
    strike_or_uniform.chart(found, Path(page).with_name("strike_or_uniform.png"))
    return text


def misses(cases: Sequence[Case]) -> str:
    """How many parts miss, in sentences."""
    done = [case for case in cases if not case.refused]
    failed = [case for case in done if not case.holds]
    numbers = ", ".join(f"{case.number} ({case.worst_ratio:.2f})" for case in failed) or "none"
    well = [c.force for c in done if c.resolved and c.order == 2]
    share = np.mean([0.5 <= each <= 3 for each in well] or [0.0])
    most = max(case.strike_true / case.strike_promised for case in done)
    several = [case.strike_ratio for case in done if case.strike_meshes > 1]
    return (
        f"Refused: {len(cases) - len(done)}. Parts that miss a bar, with the true error over it: "
        f"{numbers}. At degree 2 with a resolved patch the worst quantity of the force is within "
        f"[0.5, 3] for {share:.0%} of {len(well)}. `strike` with tol = 1 % has true errors of at "
        f"most {max(case.strike_true for case in done):.1e}, and {most:.2f} of its promise; with "
        f"the finer tolerance {len(several)} parts took several meshes, with true errors of at "
        f"most {max(several, default=0.0):.2f} of their bars."
    )


def scene(name: str, found: dict[str, Any]) -> str:
    """The runs of one scene."""
    truth = found["truth"]
    head = f"**{name}** (truth: {truth['dofs']} dofs, bar of its mesh {truth['bar']:.1e})"
    return f"{head}\n\n{strike_or_uniform.table(found)}"


def ratio(found: dict[str, Any]) -> float:
    """CPU seconds of `strike` for 1 % over those of the cheapest fixed choice within it."""
    goal = strike_or_uniform.MET
    rows = found["runs"]
    own = [row["seconds"] for row in rows if row["run"] == "strike" and row["asked"] == goal]
    good = [r["seconds"] for r in rows if r["run"] == "fixed" and r["true"] <= goal]
    return own[0] / min(good) if own and good else float("nan")


def meshes(found: dict[str, Any]) -> str:
    """Dofs and errors of uniform and adapted meshes."""
    lines = ["| scene | degree | meshes | dofs: error (corrected) |", "|---|---|---|---|"]
    for name, each in found.items():
        for order, ways in each.get("meshes", {}).items():
            for way, rows in ways.items():
                shown = ", ".join(
                    f"{row['dofs']}: {row['raw']:.1e} ({row['corrected']:.1e})" for row in rows
                )
                lines.append(f"| {name} | {order} | {way} | {shown} |")
    return "\n".join(lines)


def uniform(found: dict[str, Any]) -> str:
    """What uniform meshes of degree 2 would need for 0.1 %, beside `strike` with 1 %."""
    goal, said = strike_or_uniform.FINE, []
    for name, each in found.items():
        rows = each.get("meshes", {}).get("2", {}).get("uniform", [])
        if not rows:
            continue
        own = [r for r in each["runs"] if r["run"] == "strike"]
        mine = ", ".join(f"{r['seconds']:.2g} s (asked {r['asked']:g})" for r in own)
        needs = []
        for kind in ("raw", "corrected"):
            met = [row["seconds"] for row in rows if row[kind] <= goal]
            if met:
                needs.append(f"{kind} {min(met):.2g} s (measured)")
                continue
            seconds, errors = (np.log([row[key] for row in rows]) for key in ("seconds", kind))
            slope, start = np.polyfit(seconds, errors, 1)
            if slope < 0:
                enough = np.exp((np.log(goal) - start) / slope)
                needs.append(f"{kind} {enough:.2g} s (extrapolated with seconds^{slope:.2g})")
            else:
                needs.append(f"{kind}: the errors of these meshes do not fall")
        said.append(
            f"{name}: for {goal:.1%} uniform meshes of degree 2 need {'; '.join(needs)}; `strike` "
            f"takes {mine}."
        )
    return " ".join(said)


def cost(found: dict[str, Any]) -> str:
    share = found["estimate"] / found["whole"]
    return (
        f"{found['dofs']} dofs, n = {found['n']}: {found['estimate']:.3f} of {found['whole']:.2f} "
        f"CPU seconds (assembly, factor, extraction; the least of {strike_or_uniform.ROUNDS} runs "
        f"each): {share:.1%}."
    )


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", required=True, help="cases of benchmarks/error_budget.py")
    parser.add_argument("--runs", required=True, help="runs of benchmarks/strike_or_uniform.py")
    parser.add_argument("--page", required=True, help="page to be written, pictures beside it")
    parser.add_argument("--seed", type=options.seed, default=2026, help="of the parts, to be told")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
