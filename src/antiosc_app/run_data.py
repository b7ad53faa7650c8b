"""The numbers of an exported run for `csrc/export/antiosc_model.h`, with names."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from ctypes import byref
from dataclasses import dataclass, field, replace
from itertools import chain, count

import numpy as np
from numpy.typing import NDArray

from antiosc import Impactor, LinearBody, Obstacle, RigidMass, SceneHistory, Sphere
from antiosc.base._types import Array
from antiosc.base.errors import AccuracyWarning, InputError, warn
from antiosc.engine import library
from antiosc.engine.contact.base import is_compiled
from antiosc.engine.equilibrium import set_initial_forces
from antiosc.engine.march import TOUCH_RESOLUTION
from antiosc.engine.system import BodyModes, PackedSystem, System, system_of_bodies
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.bodies import SceneBody, scene_body
from antiosc.impact.histories.run_end import inexact_message, open_contacts
from antiosc.impact.scene import integrate, integrate_exact
from antiosc.impact.scene_parts import SceneParts
from antiosc.impact.settings import Settings

#: Outputs of a contact and of a site: `axm_kind` -> name, unit.
CONTACT_OUTPUTS = {
    0: ("force", "N"),
    1: ("indentation", "m"),
    2: ("peak_force", "N"),
    3: ("impulse", "N.s"),
}
SITE_OUTPUTS = {4: ("displacement", "m"), 5: ("velocity", "m/s")}
#: Duration for which the step is chosen, in expected contact times.
CONTACT_TIME_COUNT = 20
#: Number of doublings of that duration until the bodies part.
MAX_DOUBLINGS = 6
#: Longest run over that duration.
MAX_RUN_RATIO = 1024
#: Numbers of a contact, in the order of the model file.
CONTACT_NUMBERS = (
    *("friction", "tangential_stiffness", "mass", "expected_depth", "expected_speed"),
    *("slowest", "preload"),
)
_MOST_CONTACTS_AND_STEPS = 10_000, 1_000_000  # contacts and steps of the run that chooses the step


@dataclass(frozen=True)
class Variable:
    """A variable of an exported run: its name, unit and start value."""

    name: str
    unit: str
    description: str
    start: float = 0.0


@dataclass(frozen=True, eq=False)
class RunData:
    """A run for `csrc/export/antiosc_model.h`.

    `system` has the bodies and contacts. A run with `input_variables` (a single model) has no
    contacts, and one row of the system for each site.
    """

    system: System
    options: tuple[float, float, float, float, float]  # duration, rel_tol, scale, step, resolution
    duration: float  # [s]
    site_modes: Array  # (S, J)
    site_forces: Array  # (S, m)
    site_shifts: Array  # (K, S)
    outputs: NDArray[np.int32]  # (O, 2) kind, and index of the contact or site
    output_variables: list[Variable]
    input_variables: list[Variable] = field(default_factory=list)
    start_velocities: Array = field(
        default_factory=lambda: np.zeros((0, 0))
    )  # (N, J) by unit parameters
    parameter_variables: list[Variable] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the names of all variables distinct."""
        kinds = ("input_variables", "output_variables", "parameter_variables")
        variables = [variable for kind in kinds for variable in getattr(self, kind)]
        names = iter(distinct_names(["time", *(variable.name for variable in variables)])[1:])
        for kind in kinds:
            renamed = [replace(variable, name=next(names)) for variable in getattr(self, kind)]
            object.__setattr__(self, kind, renamed)

    @property
    def packed_system(self) -> PackedSystem:
        """The system in the form of the C library."""
        return self.system.packed

    def size_counts(self) -> list[int]:
        """Numbers of modes, rows, contacts, breaks, sites, parameters, outputs, …"""
        laws = [law.n_params for law, _ in self.packed_system.laws]
        m, size = self.system.beta.shape
        return [
            size,
            m,
            len(laws),
            self.system.breaks.size,
            len(self.site_modes),
            len(self.parameter_variables),
            len(self.outputs),
            sum(laws),
            0 if self.system.cubic is None else len(self.system.cubic),
        ]

    def integers(self) -> NDArray[np.int32]:
        """Law's kind, number of parameters, first and number of tangential rows of each contact;
        then (kind, index) of each output.
        """
        contacts = [
            (c.law.kind, c.law.n_params, c.first_tangential, c.n_tangential)
            for c in self.packed_system.contacts
        ]
        flat = [*np.ravel(contacts).tolist(), *self.outputs.ravel().tolist()]
        return np.array(flat, dtype=np.int32)

    def arrays(self) -> dict[str, Array]:
        """Name -> flat array of numbers, in the order of the model file."""
        s = self.system
        contacts = [
            [getattr(c, name) for name in CONTACT_NUMBERS] for c in self.packed_system.contacts
        ]
        laws = [values for _, values in self.packed_system.laws]
        values = np.concatenate([np.asarray(law, dtype=float) for law in laws]) if laws else []
        parts = {
            "options": [*self.options, s.contact_energy],
            "omega": s.omega,
            "decay": s.decay,
            "beta": s.beta,
            "residual": s.R,
            "breaks": s.breaks,
            "loads": s.loads,
            "offsets": s.offsets,
            "q": s.q,
            "v": s.v,
            "site_modes": self.site_modes,
            "site_forces": self.site_forces,
            "site_shifts": self.site_shifts,
            "parameters": [law.start for law in self.parameter_variables],
            "starts": self.start_velocities,
            "contacts": contacts,
            "law_parameters": values,
            "quadratic": () if s.quadratic is None else s.quadratic,
            "cubic": () if s.cubic is None else s.cubic,
        }
        return {name: np.ravel(np.asarray(part, dtype=float)) for name, part in parts.items()}

    @property
    def memory_bytes(self) -> int:
        """Bytes of memory that a run needs on a 64-bit machine, the most on any machine."""
        arrays = [
            np.ascontiguousarray(array, dtype=float)
            for array in (
                self.site_modes,
                self.site_forces,
                self.site_shifts,
                self.start_velocities,
            )
        ]
        addresses = [array.ctypes.data for array in arrays]
        start = np.array([array.start for array in self.parameter_variables])
        model = library.CModel(
            self.packed_system.system,
            library.COptions(),
            len(self.site_modes),
            *addresses[:3],
            start.size,
            start.ctypes.data,
            addresses[3],
            len(self.outputs),
            self.outputs.ctypes.data,
        )
        return int(library.library.axm_size(byref(model)))

    @property
    def content_hash(self) -> str:
        """A hash of all numbers and names."""
        text = hashlib.sha256(repr(self.size_counts()).encode())
        text.update(self.integers().tobytes())
        for part in self.arrays().values():
            text.update(part.tobytes())
        names = [*self.input_variables, *self.output_variables, *self.parameter_variables]
        text.update(repr([entry.name for entry in names]).encode())
        return text.hexdigest()[:32]


def run_of_model(model: LinearBody) -> RunData:
    """Data of a single model: forces on its sites are inputs, their motions outputs."""
    body = scene_body("model", model, None)
    _refuse_coupled({"model": body})
    if isinstance(model, Obstacle) or not body.modes.B.size:
        raise InputError("an obstacle, or a model without a site, has no motion to export.")
    if body.stretch is not None:
        raise InputError(
            "a model alone is linear in an exported file, and this one stretches: export its"
            " impact, or extract it with stretch=False."
        )
    names = _column_prefixes(body)
    modes = BodyModes(body.omega, body.modes.decay, body.modes.B.T, np.zeros(body.omega.size))
    inputs = [Variable(f"{name}force".lstrip("."), "N", "force on the site") for name in names]
    outputs, variables = _site_outputs(names)
    return RunData(
        system_of_bodies([modes], (), body.modes.R),
        (1.0, 1e-3, 0.0, 0.0, 0.0),
        1.0,
        body.modes.B.T.copy(),
        body.modes.R.copy(),
        np.zeros((1, len(names))),
        outputs,
        variables,
        inputs,
        np.zeros((0, body.omega.size)),
    )


def run_of_scene(
    scene: SceneParts, duration: float | None, tol: float, without_body: bool
) -> RunData:
    """Data of a scene's run; `duration` [s], None: until the bodies separate.

    `without_body`: results of a single impact are named without the body.
    """
    for contact in scene.contacts:
        if not is_compiled(contact.law):
            raise InputError(
                f"the contact law {type(contact.law).__name__} is a class of your own and has no"
                f" form in C: export a `Tabulated` law with its curve."
            )
    shortest = CONTACT_TIME_COUNT * assemble_scene(scene, 1.0).contact_time_estimate
    spans = [shortest * 2**k for k in range(MAX_DOUBLINGS + 1)] if duration is None else [duration]
    for span in spans:
        assembly = _assembled_scene(scene, span, tol)
        converged = integrate_exact(assembly, span, tol, None, *_MOST_CONTACTS_AND_STEPS)
        if not without_body or not open_contacts(
            converged.run, assembly.system
        ):  # scenes may come to rest
            break
    else:
        warn(
            f"the exported run is still in contact after {span:.4g} s, for which its step is"
            " chosen and its table printed; give a longer duration=.",
            AccuracyWarning,
        )
    if message := inexact_message(converged, tol, _MOST_CONTACTS_AND_STEPS[1]):
        warn(message, AccuracyWarning)
    names, modes, columns = _site_columns(assembly, without_body)
    shift = assembly.external_forces(assembly.system.breaks) @ assembly.stacked.r
    ends = [(c.a, c.b) for c in scene.contacts]
    contacts, contact_variables = _contact_outputs(ends, without_body)
    sites, site_variables = _site_outputs(names)
    parameters, starts = _initial_speeds(assembly, without_body)
    span = float(span)  # its repr is that of C
    options = (
        MAX_RUN_RATIO * span,
        converged.step_tol,
        0.0,
        0.0,
        assembly.contact_time_estimate / TOUCH_RESOLUTION,
    )
    return RunData(
        assembly.system,
        options,
        span,
        modes,
        -(assembly.G @ assembly.stacked.r)[:, columns].T.copy(),
        shift[:, columns].copy(),
        np.concatenate((contacts, sites)),
        contact_variables + site_variables,
        [],
        starts,
        parameters,
    )


def _assembled_scene(scene: SceneParts, duration: float, tol: float) -> Assembly:
    """The scene for a run of `duration` [s], with the second-order forces that `simulate` uses."""
    assembly = assemble_scene(scene, duration)
    _refuse_coupled(assembly.bodies)
    set_initial_forces(assembly.system, assembly.scene.preload)
    if not assembly.stretches:
        return assembly
    return integrate(SceneHistory, assembly, duration, Settings(tol)).assembly


def _refuse_coupled(bodies: Mapping[str, SceneBody]) -> None:
    """Raise InputError for damping that couples modes."""
    for name, body in bodies.items():
        if body.modes.first_order is not None:
            raise InputError(
                f"an exported file does not take damping that couples the modes of {name!r} (a "
                "DampingMatrix, dampers): give the model damping ratios, Damping(ratio=...)."
            )


def _column_prefixes(body: SceneBody, prefix: str = "") -> list[str]:
    """Prefixes of the outputs of a body's columns, such as "tip.", "tip.1."; "" without a name."""
    names = [""] * body.modes.B.shape[1]
    for site, columns in body.sites.items():
        for k, column in enumerate(columns):
            words = [word for word in (prefix, site, str(k) if k else "") if word]
            names[column] = ".".join(words) + "." if words else ""
    return names


def _site_columns(assembly: Assembly, without_body: bool) -> tuple[list[str], Array, list[int]]:
    """(names, modes (S, J), indices) of the columns of all sites; obstacles have none."""
    names: list[str] = []
    columns: list[int] = []
    for name, body in assembly.bodies.items():
        if isinstance(body.body, Obstacle):
            continue
        prefix = {"structure": "", "impactor": "impactor_"}[name] if without_body else name
        span = range(assembly.stacked.columns[name].start, assembly.stacked.columns[name].stop)
        columns += span
        names += [prefix for _ in span] if without_body else _column_prefixes(body, prefix)
    return names, np.ascontiguousarray(assembly.stacked.B.T[columns]), columns


def _contact_outputs(
    contacts: Sequence[tuple[str, str]], without_body: bool
) -> tuple[NDArray[np.int32], list[Variable]]:
    """((kind, index) of each output, variables) of contacts between named `contacts` ends."""
    variables = []
    for a, b in contacts:
        for name, unit in CONTACT_OUTPUTS.values():
            full = name if without_body else f"{a},{b}.{name}"
            description = f"{name.replace('_', ' ')} of the contact of {a} and {b}"
            variables.append(Variable(full, unit, description))
    return _output_specs(CONTACT_OUTPUTS, len(contacts)), variables


def _site_outputs(names: Sequence[str]) -> tuple[NDArray[np.int32], list[Variable]]:
    """((kind, index) of each output, variables) of sites; `names`: prefixes of the variables."""
    variables = []
    for prefix in names:
        place = f"the {prefix.rstrip('._')}" if prefix else "the site"
        for name, unit in SITE_OUTPUTS.values():
            variables.append(Variable(prefix + name, unit, f"{name} of {place}"))
    return _output_specs(SITE_OUTPUTS, len(names)), variables


def _output_specs(output_kinds: Mapping[int, object], count: int) -> NDArray[np.int32]:
    """(kind, index) (count * len(kinds), 2) of the outputs of `count` contacts or sites."""
    specs = [(kind, i) for i in range(count) for kind in output_kinds]
    return np.array(specs, dtype=np.int32).reshape(-1, 2)


def _initial_speeds(assembly: Assembly, without_body: bool) -> tuple[list[Variable], Array]:
    """Initial speeds [m/s] of strikers as parameters, and modal velocities (N, J) at 1 m/s."""
    variables: list[Variable] = []
    rows = []
    for name, body in assembly.bodies.items():
        striker = body.body
        speed = getattr(striker, "velocity", None)
        if not isinstance(striker, RigidMass | Sphere | Impactor) or not isinstance(speed, float):
            continue
        if speed == 0.0 or name in assembly.scene.motion:
            continue
        row = np.zeros(assembly.system.omega.size)
        row[assembly.stacked.spans[name]] = body.start_velocities / speed
        rows.append(row)
        variable_name = "initial_velocity" if without_body else f"{name}.initial_velocity"
        variables.append(Variable(variable_name, "m/s", f"velocity of {name} at the start", speed))
    return variables, np.array(rows).reshape(len(rows), assembly.system.omega.size)


def distinct_names(names: Iterable[str]) -> list[str]:
    """The names, made distinct by "_2", "_3", …."""
    used: list[str] = []
    for name in names:
        tries = chain([name], (f"{name}_{copy}" for copy in count(2)))
        used.append(next(one for one in tries if one not in used))
    return used


def model_file(data: RunData) -> bytes:
    """Content of the file resources/model.aom that `csrc/export/fmu.c` reads."""
    mark = np.array([*data.size_counts(), 0x01020304, library.VERSION], dtype="<i4")
    token = data.content_hash.encode().ljust(64, b"\0")
    numbers = np.concatenate(list(data.arrays().values())).astype("<f8")
    ints = data.integers().astype("<i4")
    content = b"AOMMODEL" + mark.tobytes() + token + ints.tobytes() + numbers.tobytes()
    return content + library.library.axm_checksum(content, len(content)).to_bytes(8, "little")
