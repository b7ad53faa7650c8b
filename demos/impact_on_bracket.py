"""A first impact: a steel sphere strikes an aluminium bracket.

The bracket is bolted down (group "clamp"). The sphere strikes the outer surface of the eye, a
cylinder, obliquely. The script prints structure, model and impact, and writes to out/ the force and
the bracket (PNG), the model (NPZ) and the displacement field in time (PVD, for ParaView).

    make demo        or        .venv/bin/python demos/impact_on_bracket.py --help
"""

from __future__ import annotations

from pathlib import Path

import command_line
import compared

import antiosc as ao
from antiosc import plotting

# ## The part and the blow
#
# All numbers are in SI units. The eye of the bracket is a cylinder along x. The blow is that of the
# program in README: its point lies beside the cylinder, onto which it is moved, and it is not along
# the normal but pushes along the boss too.

ROOT = Path(__file__).resolve().parent.parent
POINT = (0.020, 0.040, 0.075)
STRIKE = (-0.2, -0.6, -0.8)

# ## From the mesh to the force
#
# Four steps: a *structure* is a mesh with a material and supports; a *site* says where and along
# which direction it is struck, with a patch wider than the real contact; a *model* is the
# structure as seen from the site, by 20 anti-oscillators; `simulate` integrates the model, the
# sphere and the contact law that both materials and the curvature of the eye need: this contact
# yields. Only the mesh and the model take time: another speed or another sphere costs milliseconds.


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
    seconds: dict[str, float] = {}
    with compared.timed(seconds, "mesh"):
        mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=size, refine=[(POINT, radius)])
    part = ao.Structure(mesh, ao.material("aluminium 6061-T6"), supports=[ao.Support("clamp")])
    site = ao.Site(point=POINT, direction=STRIKE, radius=radius, snap=True)
    striker = ao.Sphere(radius=sphere, material="bearing steel 100Cr6", velocity=velocity)
    model = ao.extract(part, site, n=n)
    seconds |= model.info["seconds"]
    with compared.timed(seconds, "simulation"):
        hit = ao.simulate(model, striker, duration=duration)
    with compared.timed(seconds, "output"):
        out.mkdir(parents=True, exist_ok=True)
        model.save(out / "bracket.npz")
        ao.write_series(part, hit, out / "bracket.pvd")
        hit.plot(out / "bracket_force.png")
        plotting.plot_deformed(part, hit, out / "bracket.png", point=POINT, direction=STRIKE)

    print(part.describe(), model, hit.summary(), sep="\n\n")
    print("\nseconds      ", *(f"{stage} {spent:.2f}" for stage, spent in seconds.items()))
    print(f"written to {out}: bracket_force.png, bracket.png, bracket.npz, bracket.pvd")
    return {
        **compared.numbers(part, model, hit, striker.mass, velocity),
        "m_st": model.m_st,
        "contact_time": hit.contact_time,
        "restitution": hit.restitution,
        "drift": hit.energy.drift,
    }


# ## How far to trust it
#
# The output tells the share of the static mass that the oscillators hold, the bound of the error of
# the dynamic stiffness in the band of the blow, and the change of the total energy.

if __name__ == "__main__":
    command_line.command(main)
