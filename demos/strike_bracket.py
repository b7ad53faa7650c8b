"""`strike` on the bracket beside uniform meshes: error against seconds.

For each tolerance three marks: what was asked, what the error budget promises, and the true error
(of the worst of peak force, impulse and contact time). Uniform meshes of degree 2 are shown with
and without correction. The truth is the corrected model of an adapted mesh whose own share of the
budget is printed. All runs have one radius of the patch, whose share is therefore no part of the
errors shown.

    .venv/bin/python demos/strike_bracket.py --help
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import options

import antiosc as ao
from antiosc import plotting
from antiosc.simulation.error_budget import differences

PART = Path(__file__).parent.parent / "meshes" / "bracket.geo"
ALUMINIUM = ao.Solid(E=70e9, nu=0.33, rho=2700.0)
SITE = ao.Site((0.020, 0.040, 0.075), (-0.2, -0.6, -0.8), radius=2e-3, snap=True)
SPHERE = ao.Sphere(radius=0.010, E=210e9, nu=0.3, rho=7850.0, velocity=2.0)
CONTACT = SPHERE.hertz(E=70e9, nu=0.33, radii=(0.018, float("inf")))
DURATION = 1e-3


def main(
    tols: tuple[float, ...] = (0.1, 0.03, 0.01),
    sizes: tuple[float, ...] = (0.012, 0.008, 0.005),
    reference: float = 0.005,
    out: str = "",
) -> list[dict[str, Any]]:
    """Strike with these tolerances, and on uniform meshes of these sizes [m]."""
    clamp = [ao.Support("clamp")]
    rows: list[dict[str, Any]] = []
    hits: list[tuple[str, dict[str, Any], ao.History]] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        for tol in tols:
            started = time.process_time()
            hit = ao.strike(
                PART, SITE, SPHERE, CONTACT, DURATION, tol=tol, material=ALUMINIUM, supports=clamp
            )
            row = {"asked": tol, "promised": without_patch(hit), "met": hit.status == 0}
            hits.append((f"strike, tol = {tol:g}", {**row, **spent(hit, started)}, hit))
        for size in sizes:
            started = time.process_time()
            mesh = ao.read_mesh(PART, size=size, refine=[(SITE.point, SITE.radius)])
            part = ao.Structure(mesh, ALUMINIUM, clamp)
            model = ao.extract(part, SITE, n=20, error="estimate")
            hit = struck(model)
            row = {"promised": without_patch(hit), **spent(hit, started)}
            hits.append((f"uniform, {1e3 * size:g} mm", row, hit))
            soft = struck(model.corrected())
            hits.append((f"uniform, {1e3 * size:g} mm, corrected", {**row, "promised": None}, soft))
        best = ao.strike(
            PART, SITE, SPHERE, CONTACT, DURATION, tol=reference, material=ALUMINIUM, supports=clamp
        )
        true = struck(best.model.corrected())
    share = max(bar.mesh for bar in best.error_budget.values())
    dofs = best.model.info["dofs"]
    print(f"truth: {dofs} dofs, corrected; bar of the mesh for the raw model {share:.1e}")
    print(f"{'':28s}    dofs  CPU s   asked  promised     true")
    for name, row, hit in hits:
        row = {"run": name, **row, "true": max(differences(hit, true).values())}
        rows.append(row)
        marks = [row.get(mark) for mark in ("asked", "promised", "true")]
        shown = "  ".join("       -" if v is None else f"{v:8.1e}" for v in marks)
        print(f"{name:28s} {row['dofs']:7d} {row['seconds']:6.1f} {shown}")
    if out:
        Path(out).write_text(json.dumps(rows, indent=1) + "\n")
        chart(rows, Path(out).with_suffix(".png"))
    return rows


def struck(model: ao.AntiOscillators) -> ao.History:
    return ao.simulate(model, SPHERE, CONTACT, DURATION, tol=1e-4)


def without_patch(hit: ao.History) -> float:
    """Largest bar, the patch's share left out."""
    return max(bar.total - bar.patch for bar in hit.error_budget.values())


def spent(hit: ao.History, started: float) -> dict[str, Any]:
    return {"dofs": hit.model.info["dofs"], "seconds": time.process_time() - started}


def chart(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Error against CPU seconds."""
    figure, grid = plotting.panels(1, 1, (6, 4))
    axes = grid[0, 0]
    marks = {"asked": "_", "promised": "^", "true": "o"}
    for mark, sign in marks.items():
        own = [r for r in rows if "asked" in r]
        seconds, errors = ([r[key] for r in own] for key in ("seconds", mark))
        axes.loglog(seconds, errors, sign, label=f"strike, {mark}")
    for end, label in (("mm", "uniform, true"), ("corrected", "uniform, corrected")):
        own = [r for r in rows if r["run"].startswith("uniform") and r["run"].endswith(end)]
        axes.loglog([r["seconds"] for r in own], [r["true"] for r in own], ".-", label=label)
    axes.set_xlabel("CPU seconds, geometry to force (gmsh not included)")
    axes.set_ylabel("relative error")
    axes.legend()
    plotting.save_figure(figure, path, dpi=120)


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    numbers = options.listed(options.positive)
    parser.add_argument("--tols", type=numbers, default=(0.1, 0.03, 0.01), help="a,b,…")
    parser.add_argument("--sizes", type=numbers, default=(0.012, 0.008, 0.005), help="a,b,… m")
    parser.add_argument("--reference", type=options.positive, default=0.005, help="tolerance")
    parser.add_argument("--out", default="", help="file for the figures (JSON, and a chart)")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
