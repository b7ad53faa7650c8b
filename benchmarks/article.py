"""Run everything the article claims and write benchmarks/ARTICLE.md with the figures beside it.

The file is long because it is that page: a function for each section, mostly text.

    make bench-article
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import article_case1
import article_case2
import article_parts
import numpy as np
import options
from article_beam import (
    AREA,
    INERTIA,
    LENGTH,
    MASS,
    PICTURES,
    RHO,
    E,
    analytic,
    euler_bernoulli,
    meshed,
    site,
)

import antiosc as ao
from antiosc.base import files
from antiosc.models.closed_form import UniformBeam, pinned_free, pinned_pinned

PAGE = Path(__file__).resolve().parent / "ARTICLE.md"
PRINTED = {"case 1": (15.15e-3, 15.25e-3), "case 2": (2.45e-3, 2.55e-3)}  # 15.2 and 2.5 ms


def main(page: Path = PAGE, pictures: Path = PICTURES) -> None:
    """Run the cases, draw the figures, write the page."""
    started = time.perf_counter()
    case1, case2, parts = article_case1.main(), article_case2.main(), article_parts.main()
    article_case1.figures(case1, pictures)
    article_case2.figures(case2, pictures)
    text = "\n".join(
        [
            INTRODUCTION.format(
                code=options.code_state(), area=AREA * 1e4, inertia=INERTIA * 1e8, mass=MASS
            ),
            claims(case1, case2),
            half_periods(half_period_variants()),
            first_case(case1),
            second_case(case2),
            as_parts(parts),
        ]
    )
    files.write_text(page, text)
    print(f"{page}: {time.perf_counter() - started:.0f} s")


INTRODUCTION = """# The article, claim by claim

Made by `make bench-article` (`benchmarks/article.py`): every number below comes from that run.
{code} The article is
"A modelling of an impacted structure based on constraint modes". Its beam: E = 67 GPa,
rho = 2400 kg/m³, S = {area:g} cm², I = {inertia:g} cm⁴, L = 1 m, hence {mass:g} kg. Not given,
and taken here: Poisson's ratio 0.3, shear coefficient 5/6; the Hertz stiffness of case 2 (below).

*AO n*: n anti-oscillators. *modes n*: superposition of the n first natural modes, the rigid-body
mode included. Both count only what the site can see: a constraint mode with M(φ_st, φ_i) = 0 has
no mass, and a natural mode with a node at the site takes no part. *FE*: linear Timoshenko
elements with one-point shear, unreduced, as in the article. *exact*: the beam itself, that is its
closed-form natural modes (400 in case 1, 200 in case 2) with static correction. *L2*: norm of the
difference of two force histories over the norm of the second.
"""


def claims(case1: dict[str, Any], case2: dict[str, Any]) -> str:
    """The table article / ours / remark."""
    a, b = case1, case2
    fe, exact = a["against_fe"], a["against_exact"]
    rows = [
        (
            "α = (I/S)²/L² in the characteristic equation",
            "α = I/(S L²)",
            "Misprint. Only so is α a number, and only so do short waves travel at √(E/rho), and is"
            " the cut-off k'GS/(rho I) independent of L. Tested in"
            " `tests/closed_form/test_closed_form.py`.",
        ),
        (
            "m_i = 2 rho S L/(i²π²), m_st = rho S L/3, k_0 = 0 (24)-(27)",
            f"the same; with rotary inertia m_st is {analytic().alpha * 3:.1e} larger",
            "Exact for each wave number; with shear and rotary inertia the two spectra share this"
            " mass, and the shear mode at the cut-off holds rho I/L, which (3) leaves out.",
        ),
        (
            "first five AO hold 89 % of m_st",
            f"{a['share_five']:.1%}",
            "Reproduced: 6/π² (1 + 1/4 + 1/9 + 1/16 + 1/25) without shear.",
        ),
        (
            "first five AO hold 86 % of m_st",
            f"{b['share_five']:.1%} (FE {b['share_five_fe']:.1%})",
            "Reproduced with five AO that the site can see; the first five constraint modes hold"
            f" {b['share_first_five_modes']:.0%}.",
        ),
        (
            "the first AO's mass is more than half of the structure's",
            f"{a['first_of_effective']:.1%} of m_st, {b['first_of_effective']:.1%} of m_st;"
            f" {a['first_of_beam']:.1%} and {b['first_of_beam']:.1%} of the beam's mass",
            "True of the effective mass, not of the mass of the structure.",
        ),
        (
            "half period of the first AO: 15.2 and 2.5 ms (Table 3)",
            f"{a['half_period'] * 1e3:.2f} and {b['half_period'] * 1e3:.3f} ms",
            "Not reproduced; no cause found (next section).",
        ),
        (
            "impact duration, case 1: 14.4 ms (Table 3)",
            f"{a['lasted']['exact'] * 1e3:.2f} ms (FE {a['lasted']['FE'] * 1e3:.2f} ms)",
            f"First touch to last release of {a['contacts']['exact']} sub-impacts. The tip is 1 mm"
            f" off the stop only after {a['leaves_1mm'] * 1e3:.2f} ms, mid-span is back at zero at"
            f" {a['mid_span_returns'] * 1e3:.1f} ms: read from a displacement curve, as the article"
            " did, the duration comes out longer.",
        ),
        (
            "impact duration, case 2: 2.4 ms (Table 3)",
            f"{b['lasted']['exact'] * 1e3:.2f} ms (FE {b['lasted']['FE'] * 1e3:.2f} ms) with"
            " k_H = 1.55e10",
            "2.35 to 2.45 ms needs k_H from "
            f"{b['stiffness_for']['contact_time'][2.45]:.1e} to"
            f" {b['stiffness_for']['contact_time'][2.35]:.1e} (FE"
            f" {b['stiffness_for']['contact_time_fe'][2.45]:.1e} to"
            f" {b['stiffness_for']['contact_time_fe'][2.35]:.1e}); see case 2.",
        ),
        (
            "half a period of the first AO estimates the impact duration"
            " (theirs: 14.4/15.2 = 0.95, 2.4/2.5 = 0.96)",
            f"duration over half period: {a['lasted']['exact'] / a['half_period']:.2f} and"
            f" {b['lasted']['exact'] / b['half_period']:.2f}",
            "Confirmed to about 10 %.",
        ),
        (
            "Fig. 2: 9 AO and 10 modes give the mid-span displacement",
            f"largest error over largest value: AO 9 {a['mid_span']['AO 9']:.1%}, modes 10"
            f" {a['mid_span']['modes 10']:.1%}, FE {a['mid_span']['FE']:.1%}",
            "Confirmed: the displacement needs few degrees of freedom. The force of these two"
            " models rattles.",
        ),
        (
            "100 linear elements may be considered rather fine",
            f"force of the FE against the exact beam: L2 {exact['FE'].force:.0%}, peak"
            f" {three(a['peak']['FE'])} N for {three(a['peak']['exact'])} N",
            "Refuted for the force, whose sub-impacts are not those of the beam; right for the"
            " displacement. Meshes that do converge: case 1 below.",
        ),
        (
            "case 1: 50 AO as good as 90 modes",
            f"against the FE: L2 {fe['AO 50'].force:.2f} and {fe['modes 90'].force:.2f}, peak"
            f" {fe['AO 50'].peak:.1%} and {fe['modes 90'].peak:.1%}; against the exact beam: L2"
            f" {exact['AO 50'].force:.2f} and {exact['modes 90'].force:.2f}, running impulse"
            f" {exact['AO 50'].momentum:.1%} and {exact['modes 90'].momentum:.1%}, L2 of the first"
            f" 2 ms {a['early']['AO 50']:.2f} and {a['early']['modes 90']:.2f} (FE"
            f" {a['early']['FE']:.2f})",
            "Of comparable accuracy, as claimed: good in the first 2 ms, both without the timing of"
            " the late sub-impacts. The FE reference is farther from the beam than either.",
        ),
        (
            "case 2: 9 AO agree very well; 10 modes do not, 15 do",
            "L2 against the FE: AO 9 {:.1%}, modes 5 {:.0%}, modes 8 {:.1%}, modes 10 {:.1%}, modes"
            " 15 {:.1%}".format(
                *(
                    b["against_fe"][name].force
                    for name in ("AO 9", "modes 5", "modes 8", "modes 10", "modes 15")
                )
            ),
            "Reproduced if all modes are counted: of 10 modes the mid-span sees 5, of 15 it sees 8."
            " Counting only what it sees, 10 modes are about as good as 9 AO.",
        ),
        (
            "50 % more modes than AO at every velocity (0.01, 1, 10, 100 m/s)",
            "; ".join(
                f"{v:g} m/s: {row['modes'][1]} for {row['anti-oscillators'][1]}"
                for v, row in b["needed"].items()
            )
            + " (visible modes for AO, 5 % in L2 of the FE force)",
            "Refuted on the FE model, whose 50 visible modes both methods soon use up; as a mild"
            " statement about the beam itself it is true, where the modes fall far behind (table in"
            " case 2). Modes with a node at the site would double the count.",
        ),
        (
            "without truncation the results are those of the FE",
            f"L2 {a['untruncated'].force:.0e} (case 1),"
            f" {max(e.force for e in b['untruncated'].values()):.0e} (case 2, all velocities)",
            "Confirmed (same integrator and steps; two eigenproblems that share nothing).",
        ),
        (
            "no lack of mass: m_0 = m_st - Σ m_i",
            "Σ m_i + m_0 = m_st to"
            f" {max(a['mass_balance'], b['mass_balance'], 1e-16):.0e} for every N",
            "Confirmed by construction. Its price: m_0 → 0 as N grows.",
        ),
        (
            "AO series converge faster than mode superposition",
            "orders of the force error in L2: case 1 AO {:.1f}; case 2, 1 m/s, AO {:.1f}, modes"
            " {:.1f}".format(
                a["orders"]["anti-oscillators"],
                b["orders"][1.0]["anti-oscillators"],
                b["orders"][1.0]["modes"],
            ),
            "Confirmed, and for a reason: see convergence. But modes with static correction, which"
            " the article does not try, converge faster still ({:.1f} and {:.1f}).".format(
                a["orders"]["modes, static correction"],
                b["orders"][1.0]["modes, static correction"],
            ),
        ),
    ]
    return table(("the article", "ours", "remark"), rows)


def half_period_variants() -> dict[str, tuple[float, float]]:
    """Half periods (s) of the first anti-oscillators of both cases under other data."""

    def both(beam: UniformBeam) -> tuple[float, float]:
        models = (make(beam).anti_oscillators(1) for make in (pinned_free, pinned_pinned))
        first, second = (float(np.pi / model.omega[0]) for model in models)
        return first, second

    def linear(n: int) -> tuple[float, float]:
        half = []
        for pinned, x in (((), LENGTH), (("right",), LENGTH / 2)):
            model = ao.extract(meshed(n, pinned), site(x), n=1, method="modes")
            half.append(float(np.pi / model.omega[0]))
        return half[0], half[1]

    return {
        "as given": both(analytic()),
        "without shear and rotary inertia": both(euler_bernoulli()),
        "I = S²/12 = 0.3333 cm⁴, as the square has": both(analytic(inertia=AREA**2 / 12)),
        "I = S²/4π = 0.3183 cm⁴, a circle of 2 cm²": both(analytic(inertia=AREA**2 / (4 * np.pi))),
        "I = 0.325 cm⁴, the least that rounds to 0.33": both(analytic(inertia=0.325e-8)),
        "k' = 0.5, nu = 0.45": both(analytic(nu=0.45, shear=0.5)),
        "100 linear elements": linear(100),
        "10 linear elements": linear(10),
    }


def half_periods(variants: dict[str, tuple[float, float]]) -> str:
    """The search for the printed half periods."""
    rows = [
        (name, f"{first * 1e3:.2f}", f"{second * 1e3:.3f}", f"{first / second:.3f}")
        for name, (first, second) in variants.items()
    ]
    rows.append(("printed", "15.2", "2.5", "6.08"))
    (low1, high1), (low2, high2) = PRINTED.values()
    first, second = variants["as given"]
    return f"""
## The half periods of Table 3

{table(("", "case 1 (ms)", "case 2 (ms)", "ratio"), rows)}

A single wrong factor in E, I, rho, S or L would stretch both periods alike and keep their ratio
{first / second:.3f}; the printed values, rounded, allow {low1 / high2:.2f} to {high1 / low2:.3f}. A
stretch of {low1 / first - 1:.1%} to {high1 / first - 1:.1%} fits the first, one of
{low2 / second - 1:.1%} to {high2 / second - 1:.1%} the second: they miss each other by a hair.
Coarse meshes shorten both. Shear alone does not lengthen the first. Only a shear coefficient of
0.5 together with an E I/(rho S L⁴) about 5 % below the given one would round to both; nothing in
the article speaks for that. No cause was found.
"""


def first_case(a: dict[str, Any]) -> str:
    """Case 1: integrators, meshes, convergence, figures."""
    integrators = table(
        ("model", "contacts", "peak (N)", "duration (ms)", "other integrator: L2", "peak"),
        [
            (
                name,
                f"{a['contacts'][name]}",
                three(a["peak"][name]),
                f"{a['lasted'][name] * 1e3:.3f}",
                f"{errors.force:.0e}",
                f"{errors.peak:.0e}",
            )
            for name, errors in a["integrators"].items()
        ],
    )
    meshes = table(
        ("elements", "peak (N)", "L2", "running impulse", "other integrator: L2", "peak"),
        [
            (
                f"{n} {'linear' if degree == 1 else 'quadratic'}",
                three(mesh.peak),
                f"{mesh.errors.force:.3f}",
                f"{mesh.errors.momentum:.4f}",
                f"{mesh.other_force:.0e}",
                f"{abs(mesh.other_peak):.0e}",
            )
            for (degree, n), mesh in sorted(a["meshes"].items())
        ],
    )
    return f"""
## Case 1: the falling beam

Force of each model, by the exact method and again by `solve_ivp`'s DOP853 (relative
differences):

{integrators}

Elements against the exact beam: the force converges, but not with meshes that do for displacements.

{meshes}

### Convergence

{study(a["counts"], a["convergence"])}

![Errors against the number of degrees of freedom, case 1](pictures/article_convergence1.png)

![Fig. 2: mid-span displacement](pictures/article_fig2.png)
![Fig. 3: force, 50 AO](pictures/article_fig3.png)
![Fig. 4: force, 90 modes](pictures/article_fig4.png)
![Fig. 7: masses of the anti-oscillators, case 1](pictures/article_fig7.png)
![Fig. 9: impact duration, case 1](pictures/article_fig9.png)
"""


def second_case(b: dict[str, Any]) -> str:
    """Case 2: stiffness, velocities, convergence, figures."""
    integrators = table(
        ("model", "contacts", "peak (N)", "duration (ms)", "other integrator: L2", "peak"),
        [
            (
                name,
                f"{b['contacts'][name]}",
                f"{b['peak'][name]:.4g}",
                f"{b['lasted'][name] * 1e3:.3f}",
                f"{errors.force:.0e}",
                f"{errors.peak:.0e}",
            )
            for name, errors in b["integrators"].items()
        ],
    )
    sweep = table(
        (
            "k_H (N m^-3/2)",
            "duration (ms)",
            "FE",
            "peak (N)",
            "AO 9",
            "modes 5",
            "modes 8",
            "modes 15",
        ),
        [
            (
                f"{k:.3g}",
                f"{row['contact_time']:.3f}",
                f"{row['contact_time_fe']:.3f}",
                f"{row['peak']:.3g}",
                *(f"{row[name]:.1%}" for name in ("AO 9", "modes 5", "modes 8", "modes 15")),
            )
            for k, row in b["sweep"].items()
        ],
    )
    others = max(row["other_peak"] for row in b["sweep"].values())
    velocities = table(
        (
            "m/s",
            *(f"FE: {g:.0%}" for g in article_case2.GOOD),
            *(f"exact: {g:.0%}" for g in article_case2.GOOD),
        ),
        [
            (
                f"{v:g}",
                *(_needed(b["needed"][v], i) for i in range(3)),
                *(_needed(b["needed_exact"][v], i) for i in range(3)),
            )
            for v in b["needed"]
        ],
    )
    orders = table(
        ("m/s", "AO", "modes", "modes, static correction"),
        [(f"{v:g}", *(f"{p:.1f}" for p in row.values())) for v, row in b["orders"].items()],
    )
    return f"""
## Case 2: a mass on the simply supported beam

With case 1's k_H = 1.55e10 at {next(iter(b["needed"])):g} m/s, by two integrators:

{integrators}

50 linear elements give the force of the beam only to L2 {b["fe_against_exact"].force:.0%} and its
peak to {b["fe_against_exact"].peak:.1%}.

### Which k_H?

The article does not say. Force errors are L2 against the FE; "modes 5" and "modes 8" are the modes
that mid-span sees of the article's 10 and 15.

{sweep}

(The other integrator's peaks differ by at most {others:.0e}.)

![Duration and errors against the Hertz stiffness](pictures/article_stiffness.png)

The printed 2.4 ms points to a few 1e9 rather than to case 1's 1.55e10. What the text says of
the force (9 AO very good, 10 modes not, 15 modes good) holds over the whole range, so that it does
not decide. The peak grows about as k_H^0.3, the duration hardly depends on it.

### Degrees of freedom for a force error in L2

AO / modes / modes with static correction; against the FE every count was tried, against the exact
beam those of the convergence study (-: not with {b["counts"][-1]}).

{velocities}

### Convergence

{study(b["counts"], next(iter(b["convergence"].values())))}

Observed orders:

{orders}

Why: short waves of Timoshenko's beam are shear waves, ω_j ~ j. What n modes leave out is then a
compliance Σ b_j²/ω_j² ~ 1/n (order 1; 3 while bending governs), what n anti-oscillators leave out
of Z is ω⁴ Σ m_i/ω_i² ~ 1/n³ (5), and the static correction leaves out ω² Σ b_j²/ω_j⁴ ~ 1/n³ (7).

![Errors against the number of degrees of freedom, case 2](pictures/article_convergence2.png)
![Force error at the four velocities](pictures/article_velocities.png)

![Fig. 5: force, modes](pictures/article_fig5.png)
![Fig. 6: force, 9 AO](pictures/article_fig6.png)
![Fig. 8: masses of the anti-oscillators, case 2](pictures/article_fig8.png)
![Fig. 10: impact duration, case 2](pictures/article_fig10.png)
"""


def _needed(row: dict[str, tuple[int, ...]], i: int) -> str:
    return " / ".join(str(counts[i]) if counts[i] else "-" for counts in row.values())


def as_parts(parts: dict[str, dict[str, Any]]) -> str:
    """The same beam as a meshed part."""
    rows = [
        (
            f"{case}, {name}",
            f"{row.dofs or '-'}",
            f"{row.half_period * 1e3:.3f}",
            f"{row.k0:.0f}",
            f"{row.m_st:.4f}",
            f"{row.share_five:.1%}",
            f"{float(format(row.peak_force, '.3g')):g}",
            f"{abs(row.other_peak):.0e}",
            f"{row.duration * 1e3:.2f}",
            f"{row.seconds:.1f}",
        )
        for case, models in parts.items()
        for name, row in models.items()
    ]
    heads = (
        "",
        "dofs",
        "T/2 (ms)",
        "k0 (N/m)",
        "m_st (kg)",
        "first five",
        "peak (N)",
        "other integrator",
        "duration (ms)",
        "seconds",
    )
    first, two = parts["case 1"], parts["case 2"]
    axial = np.pi / LENGTH * (E / RHO) ** 0.5

    def ratio(rows: dict[str, Any], name: str) -> str:
        return f"{rows[name].peak_force / rows['beam'].peak_force - 1:+.1%}"

    same = max(
        abs(getattr(row, what) / getattr(models["beam"], what) - 1)
        for models in parts.values()
        for row in models.values()
        for what in ("half_period", "m_st", "k0")
        if getattr(row, what)
    )
    return f"""
## The same beam as a plane part and as a solid

The square section (I = S²/12), struck over a patch of 4 mm radius; case 1 at 0.99 L, where there is
a surface around the patch, with 50 anti-oscillators, case 2 at mid-span with 20. (The beam's force:
150 natural modes with static correction.)

{table(heads, rows)}

Static stiffness, effective masses and the first antiresonance are the beam's within {same:.2%}.
The peak of case 2 differs by {ratio(two, "plane stress")} in plane stress and {ratio(two, "solid")}
in the solid; that of case 1, a rattle that small changes rearrange, by
{ratio(first, "plane stress")} and {ratio(first, "solid")}. (Its duration ends with the last of
dozens of sub-impacts, and which one is last hangs on the steps: the solid gave 11.2 and 13.1 ms in
two runs whose peaks agree to the digits above.) The patch spreads the force, and only
the solid has its compliance taken out of Hertz's law. Besides bending the eccentric patch excites
axial modes, as anti-oscillators of hardly any mass (the first at π √(E/rho)/L = {axial:.0f} rad/s).
In case 2 the solid costs {two["solid"].seconds / two["beam"].seconds:.0f} times the seconds of the
closed form and tells nothing new: model no more than a scene needs.
"""


def study(counts: Any, convergence: dict[str, Any]) -> str:
    """Force error in L2 and of the peak against the count."""
    rows = [
        (f"{n}", *(f"{row[i].force:.1e} / {row[i].peak:.1e}" for row in convergence.values()))
        for i, n in enumerate(counts)
    ]
    return table(("n (L2 / peak)", *convergence), rows)


def three(value: float) -> str:
    """Three significant digits, without an exponent."""
    return f"{float(format(value, '.3g')):.0f}"


def table(heads: Any, rows: Any) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


if __name__ == "__main__":
    main()
