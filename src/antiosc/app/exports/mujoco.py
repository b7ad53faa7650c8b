"""A model for MuJoCo (MJCF): masses on slide joints with stiffness, and a contact.

https://mujoco.readthedocs.io: modeling, XML reference, computation ("solver parameters").
"""

from __future__ import annotations

from math import inf
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from antiosc.app.exports.run_data import LASTING
from antiosc.base import files
from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw, Linear
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.simulation.bodies import RigidMass, Sphere
from antiosc.simulation.scene import simulate
from antiosc.simulation.two_bodies import BAND_OVER_PULSE, impact_band

_RADIUS = 5e-3  # m, of the sphere that stands for a site or a striker without a size
_IMPEDANCE = 1e-4  # of a contact, MuJoCo's least: the softer, the more it is a spring
_STEPS = 40  # of a step, in the shortest period


def write(
    path: Path,
    body: AntiOscillators,
    impactor: object = None,
    contact: ContactLaw | None = None,
    duration: float | None = None,
) -> None:
    """Write the MJCF file of a model, with the striker and the contact if they are given."""
    axis = np.array([0.0, 0.0, -1.0]) if body.direction is None else np.asarray(body.direction)
    root = ET.Element("mujoco", model=path.stem)
    frequencies = [*body.omega[-1:].tolist(), ((body.k0 + body.k.sum()) / body.m0) ** 0.5]
    ET.SubElement(root, "compiler", autolimits="true", inertiafromgeom="false")
    ET.SubElement(
        root, "option", gravity="0 0 0", integrator="implicitfast", cone="elliptic",
        timestep=_number(2 * np.pi / max(frequencies) / _STEPS),
    )  # fmt: skip
    world = ET.SubElement(root, "worldbody")
    radius = body.patch_radius or _RADIUS
    site = _mass(world, "site", body.m0, axis, body.k0)
    ET.SubElement(site, "geom", name="site", type="sphere", size=_number(radius), contype="0",
                  conaffinity="0", pos=_numbers(axis * radius))  # fmt: skip
    ET.SubElement(site, "site", name="site")
    for i, (mass, stiffness) in enumerate(zip(body.m, body.k, strict=True)):
        _mass(site, f"anti_oscillator_{i + 1}", float(mass), axis, float(stiffness))
    if contact is not None:
        _strike(root, world, body, axis, impactor, contact, duration)
    ET.indent(root)
    files.write_text(path, ET.tostring(root, "unicode") + "\n", "the MJCF file")


def _mass(
    parent: ET.Element, name: str, mass: float, axis: np.ndarray, stiffness: float
) -> ET.Element:
    """A mass that slides along the axis on a spring to its parent."""
    body = ET.SubElement(parent, "body", name=name)
    ET.SubElement(
        body, "joint", name=name, type="slide", axis=_numbers(axis), stiffness=_number(stiffness)
    )
    small = 1e-6 * mass  # kg m^2: nothing turns
    ET.SubElement(
        body, "inertial", pos="0 0 0", mass=_number(mass), diaginertia=_numbers([small] * 3)
    )
    return body


def _strike(
    root: ET.Element,
    world: ET.Element,
    model: AntiOscillators,
    axis: np.ndarray,
    impactor: object,
    contact: ContactLaw,
    duration: float | None,
) -> None:
    """The striker, the contact of the two spheres, and the state in which it arrives."""
    if not isinstance(impactor, RigidMass | Sphere):
        raise InputError(
            f"an .xml file holds a RigidMass or a Sphere as impactor; got"
            f" {type(impactor).__name__}."
        )
    radius = impactor.radius if isinstance(impactor, Sphere) else _RADIUS
    striker = _mass(world, "impactor", impactor.mass, axis, 0.0)
    striker.set("pos", _numbers(-axis * radius))
    ET.SubElement(striker, "geom", name="impactor", type="sphere", size=_number(radius),
                  contype="0", conaffinity="0")  # fmt: skip
    # MuJoCo regularises a contact by its own estimate of the inverse inertia: of a body with
    # children the mean over three axes, of which a slide joint frees one.
    inverse = 1 / model.m0 + 1 / impactor.mass
    estimate = 1 / model.m0 / (3 if model.n else 1) + 1 / impactor.mass
    regular = (1 - _IMPEDANCE) / _IMPEDANCE * estimate
    stiffness = equal_stiffness(model, impactor, contact, duration)
    stiffness *= _IMPEDANCE * (inverse + regular)
    pairs = ET.SubElement(root, "contact")
    ET.SubElement(
        pairs, "pair", geom1="site", geom2="impactor", condim="1", solref=f"{-stiffness!r} 0",
        solimp=f"{_IMPEDANCE} {_IMPEDANCE} 1 0.5 2",
    )  # fmt: skip
    speeds = [0.0] * (1 + model.n) + [impactor.velocity]
    frames = ET.SubElement(root, "keyframe")
    ET.SubElement(frames, "key", name="impact", qvel=_numbers(speeds))


def equal_stiffness(
    model: AntiOscillators,
    impactor: RigidMass | Sphere,
    law: ContactLaw,
    duration: float | None = None,
) -> float:
    """Stiffness [N/m] of the linear contact with the peak force of a law in this impact.

    Of a Hertz law on a rigid wall it is 1.25 times the secant stiffness at the peak.
    """
    if isinstance(law, Linear):
        return float(law.stiffness)
    if duration is None:  # contact times on a rigid wall
        duration = LASTING * BAND_OVER_PULSE * np.pi / impact_band(impactor, law)
    hit = simulate(model, impactor, law, duration=duration)
    deepest = float(hit.indentation.max())
    if not hit.peak_force > 0 or not deepest > 0:
        raise InputError("the impactor does not strike the model: give it a velocity > 0.")
    low, high = 0.0, inf
    stiffness = 1.25 * hit.peak_force / deepest
    for _ in range(60):
        peak = simulate(model, impactor, Linear(stiffness), duration=duration).peak_force
        if abs(peak / hit.peak_force - 1) < 1e-4:
            break
        low, high = (stiffness, high) if peak < hit.peak_force else (low, stiffness)
        guess = stiffness * (hit.peak_force / peak) ** 2
        stiffness = guess if low < guess < high else (low + min(high, 4 * stiffness)) / 2
    return stiffness


def _number(x: float) -> str:
    return repr(float(x))


def _numbers(values: object) -> str:
    return " ".join(_number(x) for x in np.ravel(np.asarray(values)).tolist())
