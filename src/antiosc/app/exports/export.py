"""`export`: an impact or a model as a file of another program, by the ending of its name."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from antiosc.app.exports import c_file, fmu, modelica, mujoco
from antiosc.app.exports.run_data import RunData, of_model, of_scene
from antiosc.base import checks
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.contact import ContactLaw
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import LinearBody, checked_body
from antiosc.models.motion import Motion
from antiosc.simulation.scene import Scene
from antiosc.simulation.scene_parts import Contact, SceneParts

#: By the ending: what writes an impact or a port.
_RUNS: dict[str, Callable[..., None]] = {".fmu": fmu.write, ".c": c_file.write}
#: By the ending: what writes a model as masses on springs, and its impact where that is given.
_MODELS: dict[str, Callable[..., None]] = {".xml": mujoco.write, ".mo": modelica.write}
#: Residual mass over m_st below which the highest anti-oscillator enlarges it, of such a model.
_SMALLEST = 1e-6


def export(
    path: str | os.PathLike[str],
    source: LinearBody | SceneParts,
    impactor: LinearBody | None = None,
    contact: ContactLaw | None = None,
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
    ending      what is written
    ==========  ==================================================================================
    ``.fmu``    FMI 2.0 or 3.0 for co-simulation, with C sources and the binaries at hand. An impact
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
    path : str or Path
        File to write; its ending decides what.
    source : AntiOscillators, any LinearBody, or Scene
    impactor, contact : as for `simulate`
        Both, or neither for a model alone or a scene.
    duration : float, optional
        Time [s] for which the step of the exported run is chosen; by default twenty expected
        contact times, or longer, until the bodies have parted. The run may go on for a thousand
        times as long.
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
        or a source that the file cannot hold; nothing is written then.
    """
    ending = checked(path)
    target = Path(path)
    if duration is not None:
        duration = checks.positive("duration", duration, "s")
    scene = _scene(source, impactor, contact, initial_velocity, gravity, gap)
    if ending in _MODELS:
        if scene is source:
            raise InputError(
                f"a file {ending} holds one model; a Scene can be an .fmu or a .c file."
            )
        _MODELS[ending](target, _chain(source, ending), impactor, contact, duration)
        return
    data = _run_data(source, scene, duration, checks.tolerance(tol))
    options = {"fmi": checks.choice("fmi", fmi, (2, 3))} if ending == ".fmu" else {}
    _RUNS[ending](target, data, **options)


def checked(path: str | os.PathLike[str]) -> str:
    """The ending of a file that can be written: ".fmu", ".c", ".xml" or ".mo"; InputError else."""
    target = Path(checks.path("path", path))
    ending = target.suffix.lower()
    if ending not in {*_RUNS, *_MODELS}:
        known = ", ".join([*_RUNS, *_MODELS])
        raise InputError(f"export writes files that end in {known}; got {target.name!r}.")
    return ending


def _scene(
    source: LinearBody | SceneParts,
    impactor: LinearBody | None,
    contact: ContactLaw | None,
    initial_velocity: float | Motion,
    gravity: float | Sequence[float],
    gap: float | None,
) -> SceneParts | None:
    """The scene of an impact; None for a model alone."""
    if (impactor is None) != (contact is None):
        raise InputError("give both impactor and contact, or neither.")
    if isinstance(source, SceneParts):
        if impactor is not None:
            raise InputError("a Scene has its bodies and contacts; give no impactor with it.")
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
    """The model with a residual mass > 0; InputError for one that is no chain of springs."""
    if not isinstance(model, AntiOscillators) or model.sites:
        raise InputError(
            f"a file {ending} holds AntiOscillators of one site; got {type(model).__name__}"
            f"{' of several sites' if isinstance(model, AntiOscillators) else ''}."
        )
    if model.damping is not None:
        warn(f"the damping of the model is left out of the file {ending}.", AccuracyWarning)
    while model.n and model.m0 <= _SMALLEST * model.m_st:
        model = model.truncated(model.n - 1)  # its mass joins m0
    if model.m0 <= 0:
        raise InputError(f"a file {ending} needs a residual mass m0 > 0; got m0 = {model.m0:g} kg.")
    return model


def _motion(model: LinearBody, initial: float | Motion) -> float | Motion:
    """The motion of the structure for a scene; a number is > 0 when it closes the gap."""
    if isinstance(initial, Motion):
        return initial
    speed = checks.number("initial_velocity", initial, "m/s")
    modes = checked_body("model", model).modal()
    if modes.direction is None or modes.inertia is None:
        return -speed
    return Motion(tuple(float(-speed * x) for x in modes.direction))


def _run_data(
    source: LinearBody | SceneParts, scene: SceneParts | None, duration: float | None, tol: float
) -> RunData:
    if scene is None:
        return of_model(source)  # type: ignore[arg-type]
    return of_scene(scene, duration, tol, plain=scene is not source)
