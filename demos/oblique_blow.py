"""A steel sphere strikes the eye of an aluminium bracket obliquely, with friction.

The bracket is the one of `impact_on_bracket.py`; its site knows the displacements across the
direction of impact as well. The sphere flies in at several angles: it slides all along when it
comes in flat, sticks and turns when it comes in steep. The script prints forces, change of the
tangential speed, spin, and the share of energy that is left in the bracket's vibrations, beside the
same blow on a part that does not move. One model serves all angles.

    .venv/bin/python demos/oblique_blow.py --help
"""

from __future__ import annotations

import time
from math import cos, inf, radians, sin
from pathlib import Path

import command_line
import compared
import numpy as np
from numpy.typing import NDArray

import antiosc as ao
from antiosc import plotting

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parent.parent
ALUMINIUM = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
EYE_RADIUS = 18e-3  # the struck cylinder, along x through (0, 30, 60) mm
ANGLE = radians(35)  # of the struck point around that cylinder, from its top
NORMAL = np.array([0.0, -sin(ANGLE), -cos(ANGLE)])  # into the bracket
ALONG = np.array([1.0, 0.0, 0.0])  # the way that the sphere slides
COLUMNS: compared.Columns = {
    "peak N": ("peak force", 1.0, ".0f"),
    "friction N": ("friction", 1.0, ".0f"),
    "restitution": ("restitution", 1.0, ".3f"),
    "sideways m/s": ("sideways", 1.0, ".3f"),
    "spin rad/s": ("spin", 1.0, ".1f"),
    "in the part %": ("left in the part", 100.0, ".1f"),
}
POINT = np.array([19.3e-3, 30e-3, 60e-3]) - EYE_RADIUS * NORMAL


def main(
    angles: tuple[float, ...] = (10.0, 30.0, 50.0, 70.0),
    speed: float = 2.0,
    friction: float = 0.25,
    radius: float = 10e-3,
    size: float = 6e-3,
    n: int = 40,
    duration: float = 4e-4,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Strike the bracket at each angle; return the numbers of each.

    Parameters
    ----------
    angles : of incidence, from the normal, degrees
    speed : of the sphere along the normal, m/s
    friction : coefficient of Coulomb's law
    radius : of the steel sphere, m
    size : largest element, m
    n : anti-oscillators
    duration : simulated time, s
    out : folder of the results
    """
    patch = 2e-3
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=size, refine=[(POINT, patch)])
    part = ao.Structure(mesh, ao.Solid(**ALUMINIUM), supports=[ao.Support("clamp")])
    site = ao.Site(tuple(POINT), tuple(NORMAL), radius=patch, snap=True, tangential=True)
    started = time.perf_counter()
    model = ao.extract(part, {"eye": site}, n=n)
    print(f"{part.describe()}; model in {time.perf_counter() - started:.1f} s")
    law = ao.Sphere(radius, **STEEL).hertz(ALUMINIUM["E"], ALUMINIUM["nu"], radii=(EYE_RADIUS, inf))
    numbers, hits = {}, {}
    for angle in angles:
        for name, body in (("bracket", model), ("rigid", ao.Obstacle())):
            hit = blow(body, law, radius, speed, angle, friction).run(duration)
            numbers[f"{angle:g} {name}"] = figures(hit, radius)
            hits[f"{angle:g} {name}"] = hit
    compared.table("angle", numbers, COLUMNS)
    out.mkdir(parents=True, exist_ok=True)
    plot(hits, out / "oblique_blow.png")
    print(f"written to {out}: oblique_blow.png")
    return numbers


def ends(body: object) -> tuple[str, str]:
    """The ends of the contact; the first one's direction is the contact's."""
    return ("ball:foot", "part") if isinstance(body, ao.Obstacle) else ("part:eye", "ball:foot")


def blow(
    body: ao.AntiOscillators | ao.Obstacle,
    law: ao.ContactLaw,
    radius: float,
    speed: float,
    angle: float,
    friction: float,
) -> ao.Scene:
    """A sphere that arrives with `speed` along the normal, and sideways as the angle asks."""
    mass = STEEL["rho"] * 4 / 3 * np.pi * radius**3
    moments = np.full(3, 0.4 * mass * radius**2)
    centre = POINT - radius * NORMAL
    ball = ao.RigidBody(mass, moments, {"foot": (POINT, -NORMAL)}, centre=centre)
    velocity = speed * (NORMAL + np.tan(radians(angle)) * ALONG)
    return ao.Scene(
        {"part": body, "ball": ball},
        [ao.Contact(*ends(body), law, friction=friction)],
        motion={"ball": ao.Motion(velocity=velocity.tolist())},
    )


def figures(hit: ao.SceneHistory, radius: float) -> dict[str, float]:
    """The numbers of a blow."""
    contact, ball = hit[ends(hit.assembly.scene.bodies["part"])], hit.bodies["ball"]
    mass = STEEL["rho"] * 4 / 3 * np.pi * radius**3
    change = (ball.momentum[-1] - ball.momentum[0]) / mass
    start = ball.momentum[0] / mass
    spin = ball.angular_momentum(POINT - radius * NORMAL)[-1] / (0.4 * mass * radius**2)
    energy = hit.energy
    return {
        "peak force": contact.peak_force,
        "friction": float(np.linalg.norm(contact.friction, axis=1).max()),
        "impulse": contact.impulse,
        "restitution": float(-(start + change) @ NORMAL / (start @ NORMAL)),
        "sideways": float(change @ ALONG),
        "spin": float(np.linalg.norm(spin)),
        "mass": float(mass),
        "normal": float(-change @ NORMAL),
        "left in the part": float(
            (hit.bodies["part"].kinetic[-1] + hit.bodies["part"].strain[-1]) / energy.kinetic[0]
        ),
        "drift": energy.drift,
    }


def plot(hits: dict[str, ao.SceneHistory], path: Path) -> None:
    """Contact force and friction over time, on the bracket."""
    figure, axes = plotting.panels(2, 1, size=(9, 6))
    normal, side = axes.ravel()
    last = 0.0
    shown = {name: hit for name, hit in hits.items() if not name.endswith("rigid")}
    widths = np.linspace(4.0, 1.0, len(shown))  # equal curves are seen beneath each other
    for width, (name, hit) in zip(widths, shown.items(), strict=True):
        contact = hit["part:eye", "ball:foot"]
        friction = contact.friction
        way = friction[np.argmax(np.abs(friction).sum(axis=1))]
        way = way / max(float(np.linalg.norm(way)), 1e-300)
        normal.plot(hit.time * 1e6, contact.force, lw=width, label=f"{name.split()[0]} degrees")
        side.plot(hit.time * 1e6, friction @ way, lw=width)
        last = max([last, *(end for _, end in contact.contacts)])
    normal.set_ylabel("contact force (N)")
    normal.legend()
    side.set_ylabel("friction (N)")
    side.set_xlabel("time (µs)")
    for ax in (normal, side):
        ax.set_xlim(-0.02e6 * last, 1.05e6 * last)
    plotting.save_figure(figure, path, dpi=120)


if __name__ == "__main__":
    command_line.command(main)
