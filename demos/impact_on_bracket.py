"""A steel sphere strikes the boss of a machined aluminium bracket: from the mesh to the force.

The bracket is bolted down (group "clamp"). The sphere strikes the outer surface of the eye, a
cylinder, obliquely and at a point that is not a node. The script prints the properties of the
structure, of the reduced model and of the impact. It writes to out/: the force and the bracket
(PNG), the model (NPZ), the displacement field in time (PVD, for ParaView).

    make demo        or        .venv/bin/python demos/impact_on_bracket.py --help
"""

from __future__ import annotations

import time
from pathlib import Path

import command_line

import antiosc as ao
from antiosc import plotting

# ## The part and the blow
#
# All numbers are in SI units. The eye of the bracket is a cylinder along x. The blow is that of the
# program in README: its point lies beside the cylinder, onto which it is moved, and it is not along
# the normal but pushes along the boss too.

ROOT = Path(__file__).resolve().parent.parent
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
EYE_RADIUS = 18e-3  # the struck cylinder, along x through (0, 30, 60) mm
POINT = (0.020, 0.040, 0.075)
STRIKE = (-0.2, -0.6, -0.8)

COVERS = '(time integration; mesh: not estimated, error="estimate" does)'

# ## From the mesh to the force
#
# Four steps: a *structure* is a mesh with a material and supports; a *site* says where and along
# which direction it is struck, with a patch wider than the real contact; a *model* is the
# structure as seen from the site, by 20 anti-oscillators; `simulate` integrates the model, the
# sphere and Hertz's law. Only the mesh and the model take time: another speed or another sphere
# costs milliseconds.


def main(
    size: float = 6e-3,
    radius: float = 2e-3,
    n: int = 20,
    sphere: float = 10e-3,
    velocity: float = 2.0,
    duration: float = 1e-3,
    out: Path = ROOT / "out",
) -> dict[str, float]:
    """Strike the bracket; return the numbers that are printed.

    Parameters
    ----------
    size : largest element, m
    radius : radius of the contact patch that the force spreads over, m
    n : anti-oscillators
    sphere : radius of the steel sphere, m
    velocity : of the sphere, m/s
    duration : simulated time, s
    out : folder of the results
    """
    seconds = {}
    started = time.perf_counter()
    ao.read_mesh, ao.Structure, ao.extract, ao.simulate  # noqa: B018  (their packages are loaded)
    seconds["import"] = time.perf_counter() - started

    started = time.perf_counter()
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=size, refine=[(POINT, radius)])
    seconds["mesh"] = time.perf_counter() - started
    part = ao.Structure(mesh, ao.Solid(**ALUMINIUM), supports=[ao.Support("clamp")])
    site = ao.Site(point=POINT, direction=STRIKE, radius=radius, snap=True)
    striker = ao.Sphere(radius=sphere, **STEEL, velocity=velocity)
    contact = striker.hertz(ALUMINIUM["E"], ALUMINIUM["nu"], radii=(EYE_RADIUS, float("inf")))
    model = ao.extract(part, site, n=n)
    seconds |= model.info.seconds

    started = time.perf_counter()
    hit = ao.simulate(model, striker, contact, duration=duration)
    seconds["simulation"] = time.perf_counter() - started

    started = time.perf_counter()
    out.mkdir(parents=True, exist_ok=True)
    model.save(out / "bracket.npz")
    ao.write_series(part, hit, out / "bracket.pvd")
    hit.plot(out / "bracket_force.png")
    plotting.plot_deformed(part, hit, out / "bracket.png", point=POINT, direction=STRIKE)
    seconds["output"] = time.perf_counter() - started

    print_table(part, model, hit, seconds)
    print(f"written to {out}: bracket_force.png, bracket.png, bracket.npz, bracket.pvd")
    return {
        "dofs": part.dofs,
        "k0": model.k0,
        "m_st": model.m_st,
        "peak_force": hit.peak_force,
        "contact_time": hit.contact_time,
        "restitution": hit.restitution,
        "impulse": hit.impulse,
        "momentum": striker.mass * (velocity - hit.impactor_velocity[-1]),
        "drift": hit.energy.drift,
    }


# ## How far to trust it
#
# The table tells the share of the static mass that the oscillators hold, the bound of the error of
# the dynamic stiffness in the band of the blow, and the change of the total energy.


def print_table(
    part: ao.Structure, model: ao.AntiOscillators, hit: ao.History, seconds: dict[str, float]
) -> None:
    """Print the model, the impact and the figures that tell their accuracy."""
    found = model.info
    captured = 1 - model.m0 / model.m_st
    band = ""
    if "band" in found:
        top, error = found["band"]["top"] / 6283.185307, found["band"]["error_bound"]
        band = f"; relative error of Z <= {error:.0e} up to {top:.0f} kHz"
    lowest = ", ".join(f"{w / 6.283185307:.0f}" for w in model.omega[:5])
    times = "  ".join(f"{stage} {spent:.2f}" for stage, spent in seconds.items())
    rows = [
        ("structure", f"{part.describe()}, {part.mass:.4g} kg"),
        ("static stiffness k0", f"{model.k0:.4g} N/m"),
        ("static mass m_st", f"{model.m_st:.4g} kg"),
        ("anti-oscillators", f"{model.n}{band}"),
        ("captured mass", f"{captured:.2%} of m_st"),
        ("first antiresonances", f"{lowest} Hz"),
        ("site", "({:.5f}, {:.5f}, {:.5f}) m".format(*found["point"])),
        ("peak force", f"{hit.peak_force:.5g} N"),
        ("contact time", f"{hit.contact_time * 1e6:.4g} µs in {len(hit.contacts)} contact(s)"),
        ("restitution", f"{hit.restitution:.3f}"),
        ("force error", f"{hit.error['force']:.1e} {COVERS}"),
        ("energy drift", f"{hit.energy.drift:.1e} of the energy at the start"),
        ("seconds", times),
        ("remark", hit.message),
    ]
    for name, value in rows:
        print(f"{name:20s}  {value}")


if __name__ == "__main__":
    command_line.command(main)
