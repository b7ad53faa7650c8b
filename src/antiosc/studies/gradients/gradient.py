"""`gradient`: the derivatives of a result by everything that an impact is made of."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from antiosc.base import checks, march
from antiosc.base._types import Array
from antiosc.base.brief import Brief, short
from antiosc.base.errors import InputError, NotDifferentiableError
from antiosc.contact import ContactLaw
from antiosc.contact.compiled import is_compiled
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import ModalBody
from antiosc.simulation import engine
from antiosc.studies.gradients.goals import Seeds, seeds
from antiosc.studies.gradients.parameters import ByModes, Values, by_body, by_material
from antiosc.studies.gradients.recorded import Recorded, recorded

#: Speed of a touch or release, over the fastest, below which it grazes.
GRAZING = 1e-6
#: Relative change of a law's parameter by which the damping factor of its restitution is derived.
CHANGE = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Gradient(Brief):
    """Derivatives of a result; those of one body or contact alone are attributes too.

    Attributes
    ----------
    goal : str
        The result, and its `value`.
    bodies : dict
        Name of a body -> {parameter: derivative}, arrays (N,) for `m` and `omega`.
    contacts : dict
        Ends (a, b) of a contact -> {parameter of its law, or gap: derivative}.

    A derivative has the unit of the goal over that of the parameter. None: there is none, as by m0
    where the site has no mass.
    """

    goal: str
    value: float
    bodies: dict[str, Values]
    contacts: dict[tuple[str, str], Values]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        holders = [
            each for each in (*self.bodies.values(), *self.contacts.values()) if name in each
        ]
        if len(holders) == 1:
            return holders[0][name]
        known = sorted(
            {n for each in (*self.bodies.values(), *self.contacts.values()) for n in each}
        )
        why = "several bodies or contacts have it" if holders else "there is no such parameter"
        raise GradientNameError(
            f"the gradient has no {name}: {why}; take it from bodies[name] or contacts[a, b], which"
            f" have {', '.join(known)}."
        )

    def _facts(self) -> list[tuple[str, str]]:
        told = [(self.goal, f"{self.value:.6g}")]
        for each in (*self.contacts.values(), *self.bodies.values()):
            told.append(("d/d", ", ".join(f"{n} {short(v)}" for n, v in each.items() if short(v))))
        return told


class GradientNameError(InputError, AttributeError):
    """A parameter that a gradient does not have, or more than once."""


def gradient(
    hit: Any,
    goal: str,
    *,
    contact: tuple[str, str] | None = None,
    time: float | None = None,
    part: Any = None,
) -> Gradient:
    """Derivatives of a result by masses, speeds, stiffnesses, gaps and the model's parameters.

    They are those of the steps that the run took (a discrete adjoint: one pass back over the run
    gives all of them), through touches, releases and the turning points of laws with memory. They
    converge with `tol` as the result does.

    Parameters
    ----------
    hit : History or SceneHistory
        Of `simulate` or `Scene.run` with method="exact".
    goal : str
        "peak_force" [N], "impulse" [N s], "contact_time" [s], "restitution", "peak_displacement"
        [m] of the first end of the contact (the structure of `simulate`); "force" [N] and
        "displacement" [m] of that end at a `time`.
    contact : (str, str), optional
        Ends of the contact, where a scene has several.
    time : float, optional
        [s], of the goals "force" and "displacement".
    part : Structure, optional
        Of one isotropic material, from which the model was extracted: `g.E` and `g.rho` too. The
        stiffness of the contact law stays.

    Returns
    -------
    Gradient
        `g.mass`, `g.velocity` of the impactor, `g.m0`, `g.k0`, `g.m`, `g.omega` of the model,
        `g.stiffness` and the other parameters of the contact law by their names, `g.gap`.

    Raises
    ------
    InputError
        For a history without its run, an unknown goal, contacts that are closed at the start, laws
        made elsewhere, and a part of several materials or with attachments.
    NotDifferentiableError
        Where the result has no derivative: two equal peaks, a contact that grazes, or none.
    """
    material = None if part is None else _material(part)
    found, wanted, slopes = derived(hit, goal, contact, time)
    bodies = _bodies(found, wanted, slopes, material)
    return Gradient(goal, wanted.value, bodies, _contacts(found, slopes))


def derived(
    hit: Any, goal: str, contact: tuple[str, str] | None = None, time: float | None = None
) -> tuple[Recorded, Seeds, engine.Slopes]:
    """The run, the goal and its derivatives by all numbers of the march; see `gradient`."""
    found = recorded(hit)
    _refuse(found)
    wanted = seeds(found, goal, _contact(found, contact), time)
    s = found.system
    places, weights = wanted.arrays(2 * s.omega.size + len(s.beta))
    slopes, grazing, answer = engine.gradient(
        s, found.run, found.states(), places, weights, wanted.force, wanted.time
    )
    if answer != march.DONE or not grazing > GRAZING:
        raise NotDifferentiableError(
            f"a contact grazes: it touches or parts at {max(grazing, 0.0):.1g} of the"
            f" fastest speed, and {goal} has no derivative there; change an input slightly."
        )
    return found, wanted, slopes


def _refuse(found: Recorded) -> None:
    s = found.system
    if s.first is not None:
        raise InputError(
            "a gradient does not take damping that couples the modes (a DampingMatrix, dampers): "
            "take it of a model with damping ratios."
        )
    if np.any(s.pressed > 0):
        raise InputError(
            "a scene whose contacts are closed at the start has no gradients yet: begin it with"
            " a gap >= 0 and without preload."
        )
    for law in s.laws:
        if not is_compiled(law):
            raise InputError(
                f"{type(law).__name__} is a law made elsewhere, whose derivatives are not known:"
                f" use a law of antiosc, or Tabulated."
            )


def _contact(found: Recorded, contact: tuple[str, str] | None) -> int:
    if contact is None and len(found.ends) == 1:
        return 0
    for i, ends in enumerate(found.ends):
        if isinstance(contact, tuple | list) and [*ends] == [str(end) for end in contact]:
            return i
    listed = ", ".join(map(str, found.ends))
    raise InputError(f"contact must be one of {listed}; got {checks.shown(contact)}.")


def _material(part: Any) -> Any:
    """The one material of a structure whose stiffness and mass all come from it."""
    made = getattr(part, "made_of", None)
    material = made[1] if made else None
    values = getattr(material, "E", None), getattr(material, "rho", None)
    if not made or made[2]["attached"] or not all(isinstance(each, float) for each in values):
        raise InputError(
            "part must be a Structure of one isotropic material without attachments: derivatives by"
            " E and rho are known of those alone."
        )
    return material


def _bodies(
    found: Recorded, wanted: Seeds, slopes: engine.Slopes, material: Any
) -> dict[str, Values]:
    """Derivatives by the parameters of bodies of one site; of driven scenes none."""
    models = [each.body for each in found.parts.values() if isinstance(each.body, AntiOscillators)]
    if material is not None and (len(models) != 1 or found.driven or models[0].sites):
        raise InputError(
            f"part needs a run with one extracted model of one site, without loads or a moving"
            f" ground; this one has {len(models)} models."
        )
    s = found.system
    by_B = slopes.beta.T @ found.G + wanted.B
    by_r = found.G.T @ slopes.residual @ found.G + wanted.r
    result: dict[str, Values] = {}
    for name, part in found.parts.items():
        own, k = part.span, part.columns.start
        one = isinstance(part.modes, ModalBody) and part.columns.stop - k == 1
        if found.driven or not one:
            continue
        by = ByModes(
            square=slopes.square[own],
            decay=slopes.decay[own],
            site=by_B[own, k],
            r=float(by_r[k, k]),
            load=slopes.loads[:, own].sum(axis=0),
            start=slopes.v[own],
            v=s.v[own],
            g=s.loads[0, own],
        )
        touching = found.G[:, k] != 0
        rows = s.beta[touching][:, own]
        closing = float(rows[0] @ s.v[own]) if len(rows) else 0.0
        result[name] = by_body(part.body, part.modes, by, closing)
        if material is not None and isinstance(part.body, AntiOscillators):
            result[name] |= by_material(part.body, part.modes, by, material)
            local = part.body.local_compliance
            for c in np.flatnonzero(touching):  # of Hertz's law, freed from that of the patch
                freed = local > 0 and s.laws[c] is not found.laws[c]
                result[name]["E"] -= slopes.laws[c, 1] * local / material.E if freed else 0.0
    return result


def _contacts(found: Recorded, slopes: engine.Slopes) -> dict[tuple[str, str], Values]:
    result: dict[tuple[str, str], Values] = {}
    for c, (ends, law) in enumerate(zip(found.ends, found.system.laws, strict=True)):
        values = _by_law(law, slopes.laws[c])
        values["gap"] = float(slopes.offsets[:, c].sum())
        if found.system.tangents[c, 1] > 0:
            values["friction"] = float(slopes.friction[c, 0])
        result[ends] = values
    return result


def _by_law(law: ContactLaw, by: Array) -> Values:
    """Derivatives by the parameters of a law, by name; a table's are not parameters."""
    if law.kernel[0].kind == march.TABLE:  # type: ignore[attr-defined]
        return {}
    names = [each.name for each in fields(law) if each.init]  # type: ignore[arg-type]
    if "restitution" not in names:
        return {name: float(value) for name, value in zip(names, by.tolist(), strict=False)}
    stiffness, exponent, factor = by.tolist()
    e = law.restitution  # type: ignore[attr-defined]
    change = CHANGE * min(e, 1 - e) if e < 1 else -CHANGE
    step = law._factor(e + change) - law._factor(e - change if e < 1 else e)  # type: ignore[attr-defined]
    slope = step / (2 * change if e < 1 else change)
    return {"stiffness": stiffness, "restitution": factor * slope, "exponent": exponent}
