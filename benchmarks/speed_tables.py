"""Tables and pictures of `speed_accuracy.py`."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import error_charts
import numpy as np

from antiosc import plotting

STYLE = {
    "Krylov": ("C3", "o-"),
    "modes": ("C0", "s-"),
    "superposition": ("C7", "^-"),
    "superposition, static correction": ("C2", "v-"),
    "unreduced, Newmark": ("k", "D"),
    "unreduced, explicit": ("C6", ">"),
    "unreduced, all modes": ("k", "*"),
    "SciPy: eigsh, solve_ivp": ("C1", "P"),
}


def plot(found: dict[str, Any], out: Path) -> None:
    """Errors of force and Z against total seconds and against N."""
    figure, axes = plotting.panels(2, 2, size=(9, 7.6), sharey="row")
    styles = {method: color + style for method, (color, style) in STYLE.items()}
    for row, error in enumerate(("error force", "error Z")):
        for column, key in enumerate(("total", "n")):
            series = {}
            for method in STYLE:
                rows = [r for r in found["rows"] if r["method"] == method and r[error] and r[key]]
                if rows:
                    series[method] = [r[key] for r in rows], [r[error] for r in rows]
            ax = error_charts.plot_errors(series, axes[row, column], styles=styles)
            ax.set_xlabel("seconds, all told" if key == "total" else "N")
        axes[row, 0].set_ylabel("error of the force (L2)" if row == 0 else "error of Z, band")
    named = {n: h for a in axes.flat for h, n in zip(*a.get_legend_handles_labels(), strict=True)}
    below = {"loc": "upper left", "bbox_to_anchor": (0, -0.2), "ncols": 3, "fontsize": 9}
    legend = axes[1, 0].legend(named.values(), named, **below)
    legend.set_in_layout(False)
    figure.suptitle(f"{found['case']}, {found['dofs']} dofs")
    name = found["case"].replace(", ", "_").replace(" ", "_")
    path = out / f"speed_accuracy_{name}_{found['dofs']}.png"
    plotting.save_figure(figure, path, dpi=110, bbox_inches="tight", bbox_extra_artists=[legend])


def ratios(found: dict[str, Any]) -> dict[str, float]:
    """Krylov against modes at equal error of Z, reduced against unreduced at equal force error."""
    rows = found["rows"]
    krylov, modes = ([r for r in rows if r["method"] == m] for m in ("Krylov", "modes"))
    answer = {}
    best = min(modes, key=lambda r: r["error Z"], default=None)
    equal = [r for r in krylov if best and r["error Z"] <= best["error Z"]]
    if best and equal:
        answer["modes over Krylov, seconds"] = best["seconds"] / min(r["seconds"] for r in equal)
        answer["at an error of Z of"] = best["error Z"]
    whole = [r for r in rows if r["method"] == "unreduced, Newmark"]
    if whole:
        fine = min(whole, key=lambda r: r["error force"])
        good = [r for r in krylov if r["error force"] <= fine["error force"]]
        if good:
            quick = min(good, key=lambda r: r["total"])
            answer["unreduced over Krylov, integration"] = fine["simulation"] / quick["simulation"]
            answer["unreduced over Krylov, whole job"] = fine["total"] / quick["total"]
            answer["at an error of the force of"] = fine["error force"]
    return answer


def tables(result: dict[str, Any]) -> str:
    """All results as Markdown."""
    lines = ["# Speed against accuracy", ""]
    for found in result["charts"]:
        lines += [
            f"## {found['case']}, {found['dofs']} dofs",
            "",
            found["made"],
            "",
            f"Peak force {found['peak force']:.4g} N, contact {found['contact time'] * 1e6:.4g} µs;"
            f" band {found['band'] / 2e3 / pi:.3g} kHz with"
            f" {found['antiresonances in the band']} antiresonances; assembly"
            f" {found['seconds']['assembly']:.2g} s, factorization"
            f" {found['seconds']['factorization']:.2g} s.",
            "",
            "| method | N | seconds after factorization | simulation | total |"
            " error of force | error of Z |",
            "|---|---|---|---|---|---|---|",
        ]
        for r in found["rows"]:
            Z = "" if r["error Z"] is None else f"{r['error Z']:.1e}"
            lines.append(
                f"| {r['method']} | {r['n']} | {r['seconds']:.3g} | {r['simulation']:.2g} |"
                f" {r['total']:.3g} | {r['error force']:.1e} | {Z} |"
            )
        lines += ["", *(f"- {k}: {v:.3g}" for k, v in ratios(found).items()), ""]
        if "GB" in found:
            held = ", ".join(f"{method} {one:.2f}" for method, one in found["GB"].items())
            lines[-1:] = [f"- peak memory, GB: {held}"]
            lines += [
                f"- error of the peak force by the mesh: {found['mesh error of the peak']:.1e}",
                "",
            ]
    lines += ["## Growth with the size: bracket, 20 anti-oscillators", ""]
    lines += [
        "The floor is one assembly and one factorization; the whole has no mesh.",
        "",
        "| dofs | ranks | mesh | assembly | factorization | 20 anti-oscillators | mesh / floor |"
        " whole / floor | peak GB | peak / factored |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for g in [*result["growth"], *result["ranks"]]:
        s = g["seconds"]
        lines.append(
            f"| {g['dofs']} | {g['ranks']} | {s['mesh']:.3g} | {s['assembly']:.3g} |"
            f" {s['factorization']:.3g} | {s['20 anti-oscillators']:.3g} |"
            f" {g['mesh over the floor']:.2f} | {g['over the floor']:.2f} | {g['memory']:.2f} |"
            f" {g['memory'] / g['memory factored']:.2f} |"
        )
    if len(result["growth"]) > 1:
        dofs = np.log([g["dofs"] for g in result["growth"]])
        for key in ("whole", "memory"):
            slope = np.polyfit(dofs, np.log([g[key] for g in result["growth"]]), 1)[0]
            lines.append(f"\n{key} grows as dofs^{slope:.2f}")
    for two in result["ranks"]:
        alone = next(g for g in result["growth"] if g["dofs"] == two["dofs"])
        faster = alone["whole"] / two["whole"]
        lines.append(f"\ntwo ranks against one: {faster:.2f} times as fast")
    for one in result["maps"]:
        lines += ["", f"## Map of the {one['part']}", ""]
        lines += [f"- {k}: {_short(v)}" for k, v in one.items()]
    return "\n".join(lines) + "\n"


def _short(value: Any) -> str:
    """Numbers to three digits, in lists and dicts too."""
    if isinstance(value, dict):
        return ", ".join(f"{k} {_short(v)}" for k, v in value.items())
    if isinstance(value, list):
        return ", ".join(map(_short, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)
