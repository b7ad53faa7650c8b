"""A blow with friction: a steel sphere strikes a bracket obliquely.

It slides when it comes in flat, sticks and turns when it comes in steep. The script prints
each angle beside the same blow on a part that does not move. One model serves all.
"""

from __future__ import annotations

from math import cos, radians, sin
from pathlib import Path

import command_line
import compared
import numpy as np

import antiosc as ao
from antiosc import plotting

ROOT = Path(__file__).resolve().parent.parent
EYE, ANGLE = 18e-3, radians(35)  # radius of the struck cylinder; place around it, from its top
NORMAL, ALONG = np.array([0.0, -sin(ANGLE), -cos(ANGLE)]), np.array([1.0, 0.0, 0.0])
POINT = np.array([19.3e-3, 30e-3, 60e-3]) - EYE * NORMAL
RADIUS = 10e-3
SPHERE = ao.Sphere(RADIUS, material="bearing steel 100Cr6")
INERTIA = 0.4 * SPHERE.mass * RADIUS**2
COLUMNS = ("peak force", "friction", "restitution", "sideways", "spin", "left in the part")


def main(
    angles: tuple[float, ...] = (10.0, 30.0, 50.0, 70.0),
    speed: float = 2.0,
    friction: float = 0.25,
    size: float = 6e-3,
    n: int = 40,
    out: Path = ROOT / "out",
) -> dict[str, dict[str, float]]:
    """Strike the bracket at angles of incidence (degrees); return the numbers of each.

    `speed` is along the normal (m/s), `size` that of the elements (m), n counts anti-oscillators.
    """
    mesh = ao.read_mesh(ROOT / "meshes/bracket.geo", size=size, refine=[(POINT, 2e-3)])
    part = ao.Structure(mesh, ao.material("aluminium 6061-T6"), supports=[ao.Support("clamp")])
    site = ao.Site(tuple(POINT), tuple(NORMAL), radius=2e-3, snap=True, tangential=True)
    model = ao.extract(part, {"eye": site}, n=n)
    law = ao.contact_between(part, SPHERE, at=site)
    foot = {"foot": (POINT, -NORMAL)}
    ball = ao.RigidBody(SPHERE.mass, np.full(3, INERTIA), foot, centre=POINT - RADIUS * NORMAL)
    numbers, shown = {}, {}
    for angle in angles:
        start = {"ball": ao.Motion(velocity=speed * (NORMAL + np.tan(radians(angle)) * ALONG))}
        for name, body in (("bracket", model), ("rigid", ao.Obstacle())):
            ends = ("part:eye", "ball:foot") if body is model else ("ball:foot", "part")
            contact = ao.Contact(*ends, law, friction=friction)
            hit = ao.Scene({"part": body, "ball": ball}, [contact], motion=start).run(4e-4)
            numbers[f"{angle:g} {name}"] = figures(hit, hit[ends])
            if body is model:
                sliding = hit[ends].friction
                way = sliding[np.linalg.norm(sliding, axis=1).argmax()]
                along = sliding @ way / np.linalg.norm(way)
                shown[angle], bracket = (hit.time, hit[ends].force, along), hit
    compared.table("angle", numbers, {name: (name, 1.0, ".3g") for name in COLUMNS})
    out.mkdir(parents=True, exist_ok=True)
    arrow = {"point": POINT, "direction": NORMAL + np.tan(radians(angle)) * ALONG}
    plotting.plot_deformed(part, bracket, out / "oblique_blow_part.png", body="part", **arrow)
    figure, ((normal,), (side,)) = plotting.panels(2, 1, size=(8, 6), sharex=True)
    widths = np.linspace(4.0, 1.0, len(angles))  # equal curves are seen beneath each other
    for (angle, (time, force, way)), width in zip(shown.items(), widths, strict=True):
        normal.plot(time * 1e6, force, lw=width, label=f"{angle:g}°")
        side.plot(time * 1e6, way, lw=width)
    normal.set(ylabel="contact force (N)", xlim=(0, 100))
    normal.legend(title="incidence")
    side.set(ylabel="friction (N)", xlabel="time (µs)")
    plotting.save_figure(figure, out / "oblique_blow.png", dpi=120)
    return numbers


def figures(hit: ao.SceneHistory, contact: ao.ContactHistory) -> dict[str, float]:
    """The numbers of a blow."""
    ball, part = hit.bodies["ball"], hit.bodies["part"]
    start, end = ball.momentum[0] / SPHERE.mass, ball.momentum[-1] / SPHERE.mass
    spin = ball.angular_momentum(POINT - RADIUS * NORMAL)[-1] / INERTIA
    return {
        "peak force": contact.peak_force,
        "friction": float(np.linalg.norm(contact.friction, axis=1).max()),
        "impulse": contact.impulse,
        "restitution": float(-(end @ NORMAL) / (start @ NORMAL)),
        "sideways": float((end - start) @ ALONG),
        "spin": float(np.linalg.norm(spin)),
        "mass": float(SPHERE.mass),
        "normal": float((start - end) @ NORMAL),
        "left in the part": float((part.kinetic[-1] + part.strain[-1]) / hit.energy.kinetic[0]),
        "drift": hit.energy.drift,
    }


if __name__ == "__main__":
    command_line.command(main)
