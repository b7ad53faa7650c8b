"""`export`: write an impact or a model as a file of another program, chosen by the file's ending.

The models for MuJoCo and Modelica are written here: masses on slide joints with stiffness and a
contact (MJCF, https://mujoco.readthedocs.io: modeling, XML reference, "solver parameters"); masses
and springs of Modelica's standard library behind a flange.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from antiosc import (
    AntiOscillators,
    Contact,
    ContactLaw,
    Linear,
    LinearBody,
    Motion,
    RigidMass,
    Scene,
    Sphere,
    __version__,
    impact_band,
    simulate,
)
from antiosc.base import checks, files
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.extension import BAND_OVER_PULSE, SceneParts
from antiosc.models.auto_contact import AUTO, AnyLaw, is_auto, law_of
from antiosc.models.body import checked_body
from antiosc_app.fmu import identifier, write_c, write_fmu
from antiosc_app.run_data import CONTACT_TIMES, model_run, scene_run

_TEXT = """\
model {name} "Structure struck at one site, as anti-oscillators (antiosc {version})"
  parameter Modelica.Units.SI.Mass m0 = {m0!r} "Residual mass at the site";
  parameter Modelica.Units.SI.TranslationalSpringConstant k0 = {k0!r} "Static stiffness";
  parameter Modelica.Units.SI.Mass m[{n}] = {m} "Masses of the anti-oscillators";
  parameter Modelica.Units.SI.AngularFrequency omega[{n}] = {omega} "Antiresonances";
  Modelica.Mechanics.Translational.Interfaces.Flange_a flange "The site, along the impact"
    annotation (Placement(transformation(extent={{{{-110,-10}},{{-90,10}}}})));
  Modelica.Mechanics.Translational.Components.Mass site(m=m0)
    annotation (Placement(transformation(extent={{{{-60,-10}},{{-40,10}}}})));
  Modelica.Mechanics.Translational.Components.Mass mass[{n}](m=m)
    annotation (Placement(transformation(extent={{{{60,-10}},{{80,10}}}})));
  Modelica.Mechanics.Translational.Components.Spring spring[{n}](
    c={{m[i]*omega[i]^2 for i in 1:{n}}})
    annotation (Placement(transformation(extent={{{{10,-10}},{{30,10}}}})));
{ground}equation
  connect(flange, site.flange_a);
  for i in 1:{n} loop
    connect(site.flange_b, spring[i].flange_a);
    connect(spring[i].flange_b, mass[i].flange_a);
  end for;
{support}end {name};
"""
_GROUND = """\
  Modelica.Mechanics.Translational.Components.Spring support(c=k0)
    annotation (Placement(transformation(extent={{-60,-60},{-40,-40}})));
  Modelica.Mechanics.Translational.Components.Fixed ground
    annotation (Placement(transformation(extent={{-20,-60},{0,-40}})));
"""
_SUPPORT = """\
  connect(site.flange_b, support.flange_a);
  connect(support.flange_b, ground.flange);
"""


def write_modelica(
    path: Path,
    body: AntiOscillators,
    impactor: object = None,
    contact: ContactLaw | None = None,
    duration: float | None = None,
) -> None:
    """Write the Modelica model; contacts are added in Modelica, so that an impactor is refused."""
    if impactor is not None:
        raise InputError(
            "a file .mo holds a model with a flange: connect the striker and its contact there, or"
            " export an .fmu with the contact law inside."
        )
    supported = body.k0 > 0
    text = _TEXT.format(
        name=identifier(path.stem),
        version=__version__,
        n=body.n,
        m0=float(body.m0),
        k0=float(body.k0),
        m=_list(body.m.tolist()),
        omega=_list(body.omega.tolist()),
        ground=_GROUND if supported else "",
        support=_SUPPORT if supported else "",
    )
    files.write_text(path, text, "the Modelica model")


def _list(values: list[float]) -> str:
    """Numbers as a Modelica array."""
    if values:
        return "{" + ", ".join(map(repr, values)) + "}"
    return "fill(0.0, 0)"


_RADIUS = 5e-3  # m, of the sphere that stands for a site or a striker without a size
_IMPEDANCE = 1e-4  # of a contact, MuJoCo's least: the softer, the more it is a spring
_STEPS = 40  # of a step, in the shortest period


def write_mujoco(
    path: Path,
    body: AntiOscillators,
    impactor: object = None,
    contact: ContactLaw | None = None,
    duration: float | None = None,
) -> None:
    """Write the MJCF file of a model, with striker and contact if they are given."""
    axis = np.array([0.0, 0.0, -1.0]) if body.direction is None else np.asarray(body.direction)
    root = ET.Element("mujoco", model=path.stem)
    frequencies = [*body.omega[-1:].tolist(), ((body.k0 + body.k.sum()) / body.m0) ** 0.5]
    ET.SubElement(root, "compiler", autolimits="true", inertiafromgeom="false")
    ET.SubElement(
        root,
        "option",
        gravity="0 0 0",
        integrator="implicitfast",
        cone="elliptic",
        timestep=_number(2 * np.pi / max(frequencies) / _STEPS),
    )
    world = ET.SubElement(root, "worldbody")
    radius = body.patch_radius or _RADIUS
    site = _mass(world, "site", body.m0, axis, body.k0)
    ET.SubElement(
        site,
        "geom",
        name="site",
        type="sphere",
        size=_number(radius),
        contype="0",
        conaffinity="0",
        pos=_numbers(axis * radius),
    )
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
    """Add a mass that slides along the axis on a spring to its parent; returns its element."""
    body = ET.SubElement(parent, "body", name=name)
    ET.SubElement(
        body, "joint", name=name, type="slide", axis=_numbers(axis), stiffness=_number(stiffness)
    )
    inertia = 1e-6 * mass  # kg m^2: nothing turns
    ET.SubElement(
        body, "inertial", pos="0 0 0", mass=_number(mass), diaginertia=_numbers([inertia] * 3)
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
    """Add the striker, the contact of the two spheres, and the state at the start."""
    if not isinstance(impactor, RigidMass | Sphere):
        raise InputError(
            f"an .xml file holds a RigidMass or a Sphere as impactor; got"
            f" {type(impactor).__name__}."
        )
    radius = impactor.radius if isinstance(impactor, Sphere) else _RADIUS
    striker = _mass(world, "impactor", impactor.mass, axis, 0.0)
    striker.set("pos", _numbers(-axis * radius))
    ET.SubElement(
        striker,
        "geom",
        name="impactor",
        type="sphere",
        size=_number(radius),
        contype="0",
        conaffinity="0",
    )
    # MuJoCo regularises a contact by its own estimate of the inverse inertia: of a body with
    # children the mean over three axes, of which a slide joint frees one.
    inverse = 1 / model.m0 + 1 / impactor.mass
    estimate = 1 / model.m0 / (3 if model.n else 1) + 1 / impactor.mass
    regular = (1 - _IMPEDANCE) / _IMPEDANCE * estimate
    stiffness = equal_stiffness(model, impactor, contact, duration)
    stiffness *= _IMPEDANCE * (inverse + regular)
    pairs = ET.SubElement(root, "contact")
    ET.SubElement(
        pairs,
        "pair",
        geom1="site",
        geom2="impactor",
        condim="1",
        solref=f"{-stiffness!r} 0",
        solimp=f"{_IMPEDANCE} {_IMPEDANCE} 1 0.5 2",
    )
    speeds = [0.0] * (1 + model.n) + [impactor.velocity]
    frames = ET.SubElement(root, "keyframe")
    ET.SubElement(frames, "key", name="impact", qvel=_numbers(speeds))


def equal_stiffness(
    model: AntiOscillators,
    impactor: RigidMass | Sphere,
    law: ContactLaw,
    duration: float | None = None,
) -> float:
    """Stiffness [N/m] of the linear contact that gives the peak force of a law in this impact.

    For a Hertz law on a rigid wall it is 1.25 times the secant stiffness at the peak.
    """
    if isinstance(law, Linear):
        return float(law.stiffness)
    if duration is None:  # contact times on a rigid wall
        duration = CONTACT_TIMES * BAND_OVER_PULSE / 2 / impact_band(impactor, law)
    hit = simulate(model, impactor, law, duration=duration)
    deepest = float(hit.indentation.max())
    if not hit.peak_force > 0 or not deepest > 0:
        raise InputError("the impactor does not strike the model: give it a velocity > 0.")
    low = 0.0
    high = inf
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
    """A number as text with all digits."""
    return repr(float(x))


def _numbers(values: object) -> str:
    """Numbers as text, separated by blanks."""
    return " ".join(_number(x) for x in np.ravel(np.asarray(values)).tolist())


#: Ending -> function that writes an impact or a port.
_RUNS: dict[str, Callable[..., None]] = {".fmu": write_fmu, ".c": write_c}
#: Ending -> function that writes a model as masses on springs, with its impact if it is given.
_MODELS: dict[str, Callable[..., None]] = {".xml": write_mujoco, ".mo": write_modelica}
#: Residual mass over m_st below which the highest anti-oscillator is merged into it for such a
#: file.
_SMALLEST = 1e-6


def export(
    source: LinearBody | SceneParts | str | os.PathLike[str],
    path: str | os.PathLike[str] | LinearBody | SceneParts,
    impactor: LinearBody | None = None,
    contact: AnyLaw | None = None,
    *,
    duration: float | None = None,
    tol: float = 1e-5,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
    gap: float | None = None,
    fmi: int = 2,
) -> None:
    """Write an impact, a scene, or a model alone for another program.

    ==========  ==================================================================================
    ending      content
    ==========  ==================================================================================
    ``.fmu``    FMI 2.0 or 3.0 for co-simulation, with C sources and the available binaries. An
    impact
                or a scene runs by itself and gives forces and motions. A model alone is a port:
                forces on its sites are inputs, their motions outputs; its motion under them is
                exact.
    ``.c``      The same as one C99 file without dependencies, for controllers.
    ``.xml``    A model for MuJoCo (MJCF): masses on slide joints with stiffness; with `impactor`
                and `contact`, a contact whose stiffness is the law's secant stiffness at its peak.
    ``.mo``     A model for Modelica: masses and springs with a translational flange.
    ==========  ==================================================================================

    Parameters
    ----------
    source : AntiOscillators, any LinearBody, or Scene
    path : str or Path
        File to write; its ending chooses the format. `source` and `path` may change places.
    impactor, contact : as for `simulate`
        Neither for a model alone or a scene.
    duration : float, optional
        Time [s] for which the step of the exported run is chosen; by default twenty expected
        contact times, or longer, until the bodies have parted. The run may last a thousand times
        as long.
    tol : float
        Relative error of the contact forces of an exported run over `duration`, in the L2 norm.
    initial_velocity, gravity, gap
        As for `simulate`; a scene has its own.
    fmi : 2 or 3
        Version of the standard of an FMU.

    Raises
    ------
    InputError
        For an unknown ending, a law that has no form in C (a class of the user's: use `Tabulated`),
        or a source that the file cannot represent; nothing is written then.
    """
    exported, file = checks.what_and_path(source, path)
    ending = ending_of(file)
    target = Path(file)
    if duration is not None:
        duration = checks.positive("duration", duration, "s")
    law = _law(exported, impactor, contact)
    scene = _scene(exported, impactor, law, initial_velocity, gravity, gap)
    if ending in _MODELS:
        if scene is exported:
            raise InputError(
                f"a file {ending} holds one model; a Scene can be an .fmu or a .c file."
            )
        _MODELS[ending](target, _chain(exported, ending), impactor, law, duration)
        return
    tol = checks.tolerance(tol)
    if scene is not None:
        data = scene_run(scene, duration, tol, without_body=scene is not exported)
    else:
        data = model_run(exported)
    options = {"fmi": checks.choice("fmi", fmi, (2, 3))} if ending == ".fmu" else {}
    _RUNS[ending](target, data, **options)


def ending_of(path: str | os.PathLike[str]) -> str:
    """The ending of a file that can be written (".fmu", ".c", ".xml", ".mo"); InputError for
    others.
    """
    target = Path(checks.path("path", path))
    ending = target.suffix.lower()
    if ending not in {*_RUNS, *_MODELS}:
        endings = ", ".join([*_RUNS, *_MODELS])
        raise InputError(f"export writes files that end in {endings}; got {target.name!r}.")
    return ending


def _law(source: object, impactor: LinearBody | None, contact: AnyLaw | None) -> ContactLaw | None:
    """The law of an impact; None for a model alone or a scene."""
    if impactor is None:
        if contact is not None and not is_auto(contact):
            raise InputError("a contact needs an impactor: give both, or neither.")
        return None
    if isinstance(source, SceneParts):
        raise InputError("a Scene has its bodies and contacts; give no impactor with it.")
    return law_of(AUTO if contact is None else contact, source, impactor)


def _scene(
    source: LinearBody | SceneParts,
    impactor: LinearBody | None,
    contact: ContactLaw | None,
    initial_velocity: float | Motion,
    gravity: float | Sequence[float],
    gap: float | None,
) -> SceneParts | None:
    """The scene of an impact; None for a model alone."""
    if isinstance(source, SceneParts):
        return source
    if impactor is None or contact is None:
        return None
    motion = _motion(source, initial_velocity)
    return Scene(
        {"structure": source, "impactor": impactor},
        [Contact("structure", "impactor", contact, gap)],
        gravity=gravity,
        motion={} if motion == 0 else {"structure": motion},
    )


def _chain(model: object, ending: str) -> AntiOscillators:
    """The model with a residual mass > 0; InputError if a file cannot hold it."""
    if not isinstance(model, AntiOscillators) or model.sites:
        raise InputError(
            f"a file {ending} holds AntiOscillators of one site; got {type(model).__name__}"
            f"{' of several sites' if isinstance(model, AntiOscillators) else ''}."
        )
    if model.damping is not None:
        warn(f"the damping of the model is left out of the file {ending}.", AccuracyWarning)
    if model.stretch is not None:
        warn(f"second-order forces are left out of the file {ending}.", AccuracyWarning)
        model = replace(model, stretch=None)
    while model.n and model.m0 <= _SMALLEST * model.m_st:
        model = model.truncated(model.n - 1)  # its mass joins m0
    if model.m0 <= 0:
        raise InputError(f"a file {ending} needs a residual mass m0 > 0; got m0 = {model.m0:g} kg.")
    return model


def _motion(model: LinearBody, initial: float | Motion) -> float | Motion:
    """The initial motion of the structure in a scene; a number > 0 closes the gap."""
    if isinstance(initial, Motion):
        return initial
    speed = checks.number("initial_velocity", initial, "m/s")
    modes = checked_body("model", model).modal()
    if modes.direction is None or modes.inertia is None:
        return -speed
    return Motion(tuple(float(-speed * x) for x in modes.direction))
