"""Spheres on plates and half-spaces: published theories and measured rebounds."""

from __future__ import annotations

from math import atan2, cos, degrees, radians, sin
from pathlib import Path

import numpy as np
from case import Case, Row, drawing
from frequencies import meshed, quadrilateral

import antiosc as ao
import zener
from antiosc import plotting
from plates import SupportedPlate

#: Chung and Ooi: radius m, E Pa, ν, ρ kg/m³, speed of approach m/s, other sphere or a rigid plane
ELASTIC = {
    "glass": (0.01, 48e9, 0.2, 2800.0, 20.0, True),
    "limestone": (0.01, 20e9, 0.25, 2500.0, 20.0, True),
    "aluminium": (0.1, 70e9, 0.3, 2699.0, 0.2, False),
}


def hertz(picture: Path) -> list[Row]:
    """Two equal spheres, and a sphere on a rigid plane: Hertz's own force and contact time."""
    rows, curves = [], {}
    for material, (radius, E, nu, rho, speed, pair) in ELASTIC.items():
        ball = ao.Sphere(radius, E=E, nu=nu, rho=rho, velocity=speed)
        share = 0.5 if pair else 1.0  # of the mass, of the radius and of the modulus
        modulus, curved = share * E / (1 - nu**2), np.sqrt(share * radius)
        deepest = (15 * share * ball.mass * speed**2 / (16 * curved * modulus)) ** 0.4
        peak, lasting = 4 / 3 * modulus * curved * deepest**1.5, 2.9432 * deepest / speed

        other = ao.Sphere(radius, E=E, nu=nu, rho=rho) if pair else ao.Obstacle()
        law = ao.Hertz(4 / 3 * modulus * curved)
        scene = ao.Scene({"other": other, "ball": ball}, [ao.Contact("other", "ball", law)])
        one = scene.run(1.3 * lasting, tol=1e-5)["other", "ball"]
        curves[material] = (one.time / lasting, one.force / peak)
        rows += [
            Row(f"{material}: {quantity}", float(value), float(ours), 1e-3, "equation")
            for quantity, value, ours in (
                ("peak force, N", peak, one.peak_force),
                ("contact time, s", lasting, one.contact_time),
                ("indentation, m", deepest, one.indentation.max()),
            )
        ]
    with drawing(picture, "time / Hertz's contact time", "force / Hertz's peak force") as axis:
        for name, curve in curves.items():
            axis.plot(*curve, label=name)
    return rows


def restituted(picture: Path) -> list[Row]:
    """A sphere of aluminium oxide on a rigid plane, with given coefficients of restitution."""
    ball = ao.Sphere(2.5e-3, E=380e9, nu=0.23, rho=4000.0, velocity=3.9)
    stiffness = ball.hertz(1e3 * ball.E, ball.nu).stiffness
    rows, curves = [], {}
    for asked in (0.2, 0.4, 0.6, 0.8, 1.0):
        law = ao.laws.Gonthier(stiffness, asked) if asked < 1 else ao.Hertz(stiffness)
        scene = ao.Scene({"plane": ao.Obstacle(), "ball": ball}, [ao.Contact("plane", "ball", law)])
        one = scene.run(4e-5, tol=1e-4)["plane", "ball"]
        rows.append(
            Row(f"rebound over approach, {asked:g} asked", asked, one.restitution, 1e-3, "equation")
        )
        curves[f"{asked:g}"] = (one.time * 1e6, one.force)
    with drawing(picture, "time (µs)", "force (N)") as axis:
        for name, curve in curves.items():
            axis.plot(*curve, label=name)
    return rows


def large_plate(picture: Path) -> list[Row]:
    """Zener's plate without edges: a square of shells so large that no wave returns in time."""
    aluminium = {"E": 70e9, "nu": 0.33, "rho": 2700.0}
    thickness, rows, curves = 2e-3, [], {}
    for radius in (6e-3, 9e-3):
        ball = ao.Sphere(radius, E=3e9, nu=0.4, rho=1150.0, velocity=0.1)
        law = ball.hertz(aluminium["E"], aluminium["nu"])
        plate = SupportedPlate(**aluminium, thickness=thickness, a=1.0, b=1.0)
        lam = zener.inelasticity(
            ball.mass, ball.velocity, law.stiffness, plate.D, plate.surface_density
        )
        unit = zener.time_unit(ball.mass, ball.velocity, law.stiffness)
        time = zener.contact_time(lam) * unit
        side = 8 * (plate.D / plate.surface_density) ** 0.25 * np.sqrt(time)
        corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
        edges = [ao.Support(f"edge{i}", fix=("x", "y", "z")) for i in range(1, 5)]
        text = quadrilateral(corners, (24, 24))
        shell = ao.Shell(**aluminium, thickness=thickness)
        part = ao.Structure(meshed(text, gdim=3), shell, edges)
        model = ao.extract(part, ao.Site((side / 2, side / 2, 0.0), (0, 0, -1)), n=60)
        hit = ao.simulate(model, ball, law, duration=1.3 * time)
        curves[f"λ = {lam:.2f}"] = hit
        name = f"restitution at λ = {lam:.3f}"
        rows.append(Row(name, zener.restitution(lam), hit.restitution, 0.015, "equation"))
        name = f"contact time at λ = {lam:.3f}, s"
        rows.append(Row(name, float(time), hit.contact_time, 0.01, "equation"))
    with drawing(picture, "time (µs)", "force (N)") as axis:
        for name, hit in curves.items():
            axis.plot(hit.time * 1e6, hit.force, label=name)
    return rows


#: Kharaz, Gorham and Salman: angle of incidence from the normal (degrees), measured value
TANGENTIAL = [
    (1.84, 0.79344),
    (3.703, 0.74533),
    (9.496, 0.67257),
    (20.012, 0.59691),
    (30.127, 0.68756),
    (39.382, 0.77148),
    (49.694, 0.84761),
    (60.02, 0.90142),
]
SPIN = [
    (6.143, 136.18),
    (10.991, 265.69),
    (21.251, 577.65),
    (31.157, 612.88),
    (39.143, 595.49),
    (50.348, 453.21),
    (60.328, 382.09),
]
ANGLE = [
    (2.15, 1.733),
    (4.096, 2.962),
    (9.826, 6.518),
    (20.567, 12.208),
    (30.29, 21.67),
    (39.535, 32.613),
    (49.747, 45.125),
    (60.208, 57.474),
]


def oblique(angle: float) -> tuple[float, float, float]:
    """Tangential restitution, spin (rad/s) and rebound angle (degrees) of a blow at this angle."""
    radius, speed, a = 2.5e-3, 3.9, radians(angle)
    ball = ao.Sphere(radius, E=380e9, nu=0.23, rho=4000.0)
    law = ball.hertz(70e9, 0.25)
    body = ao.RigidBody(
        ball.mass, (0.4 * ball.mass * radius**2,) * 3, {"foot": ((0, 0, -radius), (0, 0, 1.0))}
    )
    scene = ao.Scene(
        {"ball": body, "anvil": ao.Obstacle()},
        [ao.Contact("ball:foot", "anvil", law, friction=0.092)],
        motion={"ball": ao.Motion(velocity=(speed * sin(a), 0.0, -speed * cos(a)))},
    )
    moved = scene.run(4e-5, tol=1e-3).bodies["ball"]
    velocity = moved.momentum[-1] / ball.mass
    spin = np.linalg.norm(moved.angular_momentum()[-1]) / (0.4 * ball.mass * radius**2)
    rebound = degrees(atan2(velocity[0], velocity[2]))
    return float(velocity[0] / (speed * sin(a))), float(spin), rebound


STICKING = (
    "Below about 20° the contact sticks in part. antiosc has one spring and slider for the whole "
    "contact, where the real one slips from its edge inward. Programs with the same law (MFIX, "
    "Lethe) lie on the same side of the measurement."
)

SCATTER = (
    "The ball slides all along, so that friction alone gives the spin, 5μ v cos(angle)/R. The "
    "tangential restitution measured at nearly the same angle gives 565 rad/s by the balance of "
    "momentum: the measured points scatter by that much."
)


def rebound_of_spheres(picture: Path) -> list[Row]:
    """Oblique rebound of spheres of aluminium oxide on glass, as measured."""
    rows = []
    for name, points, place, bound, absolute in (
        ("tangential restitution", TANGENTIAL, 0, 0.03, True),
        ("spin, rad/s", SPIN, 1, 30.0, True),
        ("rebound angle, degrees", ANGLE, 2, 1.0, True),
    ):
        for angle, value in points:
            found = oblique(angle)[place]
            why = STICKING if angle < 25 else SCATTER
            quantity = f"{name} at {angle:g}°"
            rows.append(Row(quantity, value, found, bound, absolute=absolute, why=why))
    figure, axes = plotting.panels(1, 3, size=(9, 3.2))
    angles = np.linspace(2.0, 62.0, 25)
    curves = np.array([oblique(a) for a in angles])
    labels = ("tangential restitution", "spin (rad/s)", "rebound angle (°)")
    for i, (axis, points) in enumerate(zip(axes.ravel(), (TANGENTIAL, SPIN, ANGLE), strict=True)):
        axis.plot(angles, curves[:, i], label="antiosc")
        axis.plot(*zip(*points, strict=True), "ko", label="measured")
        axis.set_xlabel("angle of incidence (°)")
        axis.set_ylabel(labels[i])
    axes.ravel()[0].legend()
    plotting.save_figure(figure, picture, dpi=100)
    return rows


CASES = [
    Case(
        "hertz",
        "Two equal spheres, and a sphere on a rigid plane",
        "spheres of 10 mm radius that meet at 10 m/s each, of glass (E = 48 GPa, ν = 0.2, "
        "ρ = 2800 kg/m³) and limestone (20 GPa, 0.25, 2500 kg/m³). An aluminium sphere of 0.1 m "
        "radius, 70 GPa, 0.3, 2699 kg/m³, at 0.2 m/s on a rigid plane",
        "Y. C. Chung, J. Y. Ooi, Granular Matter 13 (2011) 643, tests 1 and 2, data read in Yade's "
        "benchmarks; the values are Hertz's closed form (K. L. Johnson, Contact Mechanics, 11.4); "
        "bound 0.1 %",
        hertz,
    ),
    Case(
        "restituted",
        "A sphere on a rigid plane, with given restitution",
        "aluminium oxide, 2.5 mm radius, E = 380 GPa, ν = 0.23, ρ = 4000 kg/m³, 3.9 m/s; "
        "Gonthier's law, Hertz's for 1",
        "Y. C. Chung, J. Y. Ooi, Granular Matter 13 (2011) 643, test 3, data read in Yade's "
        "benchmarks: the rebound is what was asked for; bound 0.1 %",
        restituted,
    ),
    Case(
        "zener",
        "A sphere on a plate without edges",
        "nylon spheres at 0.1 m/s on 2 mm of aluminium; simply supported square of shells, 8 times "
        "as wide as bending waves spread in the contact time",
        "C. Zener, Phys. Rev. 59 (1941) 669: his equation, integrated to 1e-11; bounds 1.5 % and "
        "1 %: the finite plate, its shear, the disc of the site",
        large_plate,
    ),
    Case(
        "kharaz",
        "Oblique rebound of spheres of aluminium oxide on glass",
        "5 mm spheres, E = 380 GPa, ν = 0.23, ρ = 4000 kg/m³, on thick soda-lime glass, E = 70 GPa,"
        " ν = 0.25; 3.9 m/s; friction 0.092, no loss along the normal (0.98 was measured)",
        "A. H. Kharaz, D. A. Gorham, A. D. Salman, Powder Technology 120 (2001) 281: points of "
        "their diagrams as printed in the example 3d-oblique-wall-impact of the program Lethe. "
        "Bounds 0.03, 30 rad/s, 1°: reading points off diagrams, and the measured normal "
        "restitution of 0.98",
        rebound_of_spheres,
        measured=True,
    ),
]
