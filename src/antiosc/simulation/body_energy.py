"""Energy of one body of a run: of its rigid motion, and of its vibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.brief import Brief
from antiosc.base.errors import InputError
from antiosc.simulation.history import History
from antiosc.simulation.scene_history import SceneHistory


@dataclass(frozen=True, eq=False, repr=False)
class BodyEnergy(Brief):
    """Energies [J] of one body, at the times (n,) of the history.

    Attributes
    ----------
    time : s.
    rigid : kinetic energy of the rigid-body motion.
    kinetic : of the vibration.
    strain : of the vibration and of the residual compliance.
    """

    time: Array
    rigid: Array
    kinetic: Array
    strain: Array

    @property
    def vibration(self) -> Array:
        """Energy of the vibration, (n,): what the modes keep when the contact is over."""
        return self.kinetic + self.strain

    @property
    def total(self) -> Array:
        """All energy of the body, (n,)."""
        return self.rigid + self.vibration


def body_energy(history: History | SceneHistory, body: str) -> BodyEnergy:
    """Energies of one body: "structure" or "impactor"; of a scene its name.

    Raises
    ------
    InputError
        For another name.
    """
    kinds = (History, SceneHistory)
    checks.instance("history", history, kinds, "a History, which simulate and Scene.run return")
    if isinstance(history, SceneHistory):
        checks.instance("body", body, str, "the name of a body")
        if body not in history.bodies:
            named = ", ".join(history.bodies)
            raise InputError(f"there is no body {body!r} in the scene: name one of {named}.")
        one = history.bodies[body]
        omega, v, strain = one.placed.omega, one.v, one.strain
    else:
        _, own = history.of(body)  # type: ignore[arg-type]
        q, v = history.states(history.time)
        size = history.bodies[0].omega.size
        part = slice(None, size) if body == "structure" else slice(size, None)
        omega, q, v = own.omega, q[:, part], v[:, part]
        strain = 0.5 * np.sum((omega * q) ** 2, axis=1) + 0.5 * own.r * history.force**2
    still = omega == 0
    return BodyEnergy(
        time=history.time,
        rigid=0.5 * np.sum(v[:, still] ** 2, axis=1),
        kinetic=0.5 * np.sum(v[:, ~still] ** 2, axis=1),
        strain=strain,
    )


def vibration_share(history: History | SceneHistory) -> float:
    """Share of the kinetic energy at the start that vibrates in all bodies at the end.

    After a contact without losses of its own it is Zener's loss, by which a sphere rebounds more
    slowly from a plate than it came (C. Zener, Phys. Rev. 59 (1941) 669-673).

    Raises
    ------
    InputError
        Bodies at rest at the start.
    """
    kinds = (History, SceneHistory)
    checks.instance("history", history, kinds, "a History, which simulate and Scene.run return")
    scene = isinstance(history, SceneHistory)
    names = list(history.bodies) if scene else ["structure", "impactor"]
    energies = [body_energy(history, str(name)) for name in names]
    start = sum(float(e.rigid[0] + e.kinetic[0]) for e in energies)
    if start == 0:
        raise InputError("all bodies are at rest at the start: there is no share of their energy.")
    return sum(float(e.vibration[-1]) for e in energies) / start
