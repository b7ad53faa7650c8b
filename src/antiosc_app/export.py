"""`export`: write an impact or a model as a file of another program, by the file's ending."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from antiosc import Contact, LinearBody, Motion, Scene
from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.impact.scene_parts import SceneParts
from antiosc.models.body import AUTO, AnyLaw, checked_body, is_auto, law_of
from antiosc_app.fmu import write_c, write_fmu
from antiosc_app.run_data import run_of_model, run_of_scene

#: Ending -> function that writes an impact or a port.
_WRITERS: dict[str, Callable[..., None]] = {".fmu": write_fmu, ".c": write_c}


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
    """Write an impact, a scene, or a single model for another program.

    A file named ``.fmu`` is an FMU of FMI 2.0 or 3.0 for co-simulation, with C sources and the
    available binaries: an impact or a scene runs by itself and gives forces and motions; a single
    model has the forces on its sites as inputs and their motions as outputs. ``.c`` is the same as
    one C99 file without dependencies, for controllers.

    Parameters
    ----------
    source : AntiOscillators, any LinearBody, or Scene
    path : str or Path
        File to write; its ending chooses the format. `source` and `path` may change places.
    impactor, contact : as for `simulate`
        Not for a single model or a scene.
    duration : float, optional
        Time [s] for which the step of the exported run is chosen; default: twenty expected contact
        times, or longer until the bodies have separated. The run may last a thousand times as long.
    tol : float
        Relative error of the contact forces of an exported run over `duration`, in the L2 norm.
    initial_velocity, gravity, gap
        As for `simulate`; a scene has its own.
    fmi : 2 or 3
        Version of the standard of an FMU.

    Raises
    ------
    InputError
        An unknown ending, a law without a form in C (a user's class: use `Tabulated`), or a source
        that the file cannot represent; nothing is written then.
    """
    exported, file = checks.what_and_path(source, path)
    ending = ending_of(file)
    target = Path(file)
    if duration is not None:
        duration = checks.positive("duration", duration, "s")
    scene = _scene_parts(exported, impactor, contact, initial_velocity, gravity, gap)

    tol = checks.tolerance(tol)
    if scene is not None:
        data = run_of_scene(scene, duration, tol, without_body=scene is not exported)
    else:
        data = run_of_model(exported)

    options = {"fmi": checks.choice("fmi", fmi, (2, 3))} if ending == ".fmu" else {}
    _WRITERS[ending](target, data, **options)


def ending_of(path: str | os.PathLike[str]) -> str:
    """The ending of a file that can be written (".fmu", ".c"); InputError for others."""
    target = Path(checks.path("path", path))
    ending = target.suffix.lower()
    if ending not in _WRITERS:
        raise InputError(f"export writes files that end in .fmu or .c; got {target.name!r}.")
    return ending


def _scene_parts(
    source: LinearBody | SceneParts,
    impactor: LinearBody | None,
    contact: AnyLaw | None,
    initial_velocity: float | Motion,
    gravity: float | Sequence[float],
    gap: float | None,
) -> SceneParts | None:
    """The scene of an impact; None for a single model."""
    if impactor is None:
        if contact is not None and not is_auto(contact):
            raise InputError("a contact needs an impactor: give both, or neither.")
        return source if isinstance(source, SceneParts) else None
    if isinstance(source, SceneParts):
        raise InputError("a Scene has its bodies and contacts; give no impactor with it.")

    law = law_of(AUTO if contact is None else contact, source, impactor)
    if not isinstance(initial_velocity, Motion):  # a number > 0 closes the gap
        initial_velocity = -checks.number("initial_velocity", initial_velocity, "m/s")
        modes = checked_body("model", source).modal()
        if modes.direction is not None and modes.inertia is not None:
            initial_velocity = Motion(tuple(float(initial_velocity * x) for x in modes.direction))
    return Scene(
        {"structure": source, "impactor": impactor},
        [Contact("structure", "impactor", law, gap)],
        gravity=gravity,
        motion={} if initial_velocity == 0 else {"structure": initial_velocity},
    )
