"""A steel sphere strikes the boss of a machined aluminium bracket: from the mesh to the force.

The bracket is bolted down (group "clamp"). The sphere meets the outside of its eye, a cylinder,
off any node and obliquely. Printed: what was modelled, what was kept, and the impact. Written to
out/: the force (PNG), the model (NPZ) and the moving bracket (PVD, for ParaView).

    make demo        or        .venv/bin/python demos/impact_on_bracket.py --help
"""

from __future__ import annotations

import argparse
import inspect
import time
from math import cos, radians, sin
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
EYE_RADIUS = 18e-3  # the struck cylinder, along x through (0, 30, 60) mm
ANGLE = radians(35)  # of the struck point around that cylinder, from its top
STRIKE = (-0.25, -sin(ANGLE), -cos(ANGLE))  # oblique: a quarter along the boss


def main(
    size: float = 6e-3,
    radius: float = 2e-3,
    n: int = 20,
    sphere: float = 10e-3,
    velocity: float = 2.0,
    duration: float = 1.5e-3,
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
    point = (19.3e-3, 30e-3 + EYE_RADIUS * sin(ANGLE), 60e-3 + EYE_RADIUS * cos(ANGLE))

    started = time.perf_counter()
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=size, refine=[(point, radius)])
    seconds["mesh"] = time.perf_counter() - started
    part = ao.Structure(mesh, ao.Solid(**ALUMINIUM), supports=[ao.Support("clamp")])
    site = ao.Site(point=point, direction=STRIKE, radius=radius, snap=True)
    model = ao.extract(part, site, n=n)
    seconds |= {stage: spent for stage, spent in model.info["seconds"].items()}

    striker = ao.Sphere(radius=sphere, **STEEL, velocity=velocity)
    contact = striker.hertz(ALUMINIUM["E"], ALUMINIUM["nu"], radii=(EYE_RADIUS, float("inf")))
    started = time.perf_counter()
    hit = ao.simulate(model, striker, contact, duration=duration)
    seconds["simulation"] = time.perf_counter() - started

    started = time.perf_counter()
    out.mkdir(parents=True, exist_ok=True)
    model.save(out / "bracket.npz")
    ao.write_series(part, hit, out / "bracket.pvd")
    plot(hit, out / "bracket_force.png")
    seconds["output"] = time.perf_counter() - started

    print_table(part, model, hit, seconds)
    print(f"written: {out}/bracket_force.png, bracket.npz, bracket.pvd (open it in ParaView)")
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


def print_table(
    part: ao.Structure, model: ao.AntiOscillators, hit: ao.History, seconds: dict[str, float]
) -> None:
    """What a reader of the result needs to judge it."""
    found = model.info
    held = 1 - model.m0 / model.m_st
    lowest = ", ".join(f"{w / 6.283185307:.0f}" for w in model.omega[:5])
    times = "  ".join(f"{stage} {spent:.2f}" for stage, spent in seconds.items())
    rows = [
        ("structure", f"{part.describe()}, {part.mass:.4g} kg"),
        ("static stiffness k0", f"{model.k0:.4g} N/m"),
        ("static mass m_st", f"{model.m_st:.4g} kg"),
        ("anti-oscillators", f"{model.n} of {found['modes_computed']} modes computed"),
        ("mass that they hold", f"{held:.2%} of m_st"),
        ("first frequencies", f"{lowest} Hz"),
        ("peak force", f"{hit.peak_force:.5g} N"),
        ("contact time", f"{hit.contact_time * 1e6:.4g} us in {len(hit.contacts)} contact(s)"),
        ("restitution", f"{hit.restitution:.3f}"),
        ("energy drift", f"{hit.energy.drift:.1e} of the energy at the start"),
        ("seconds", times),
        ("remark", hit.message),
    ]
    for name, value in rows:
        print(f"{name:20s}  {value}")


def plot(hit: ao.History, path: Path) -> None:
    """Force, and the motions of site and sphere."""
    figure, (upper, lower) = plt.subplots(2, 1, sharex=True, figsize=(7, 5), layout="constrained")
    ms = 1e3 * hit.time
    upper.plot(ms, hit.force, color="C3")
    upper.set_ylabel("contact force (N)")
    lower.plot(ms, 1e6 * hit.displacement, label="bracket, at the site")
    lower.plot(ms, 1e6 * hit.impactor_displacement, label="sphere", linestyle="--")
    lower.set_ylim(1.3e6 * hit.displacement.min(), 1.6e6 * hit.displacement.max())
    lower.set_ylabel("displacement (µm)")
    lower.set_xlabel("time (ms)")
    lower.legend()
    upper.set_title("A 10 mm steel sphere strikes the bracket")
    figure.savefig(path, dpi=120)
    plt.close(figure)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, parameter in inspect.signature(main).parameters.items():
        kind = type(parameter.default)
        parser.add_argument(
            f"--{name}",
            type=Path if issubclass(kind, Path) else kind,
            default=parameter.default,
            help="(default: %(default)s)",
        )
    main(**vars(parser.parse_args()))
