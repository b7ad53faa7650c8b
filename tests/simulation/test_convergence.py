"""What the errors of a run rest on: differences of runs that do not agree by chance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import antiosc as ao
from antiosc.contact import State
from antiosc.simulation.assembly import assemble
from antiosc.simulation.march.convergence import converge


@dataclass
class Unlike(ao.ContactLaw):
    """A spring that is another one in every run."""

    runs: list[float] = field(default_factory=list)

    def touch(self, speed: float, state: State | None = None) -> State:
        if speed == 1.0 and state is None:
            self.runs.append(1e6 * (1.0 + 0.05 * np.sin(2.4 * len(self.runs))))
        return ()

    def force(self, delta: float, rate: float, state: State) -> float:
        return self.runs[-1] * max(delta, 0.0)

    def tangent(self, delta: float, rate: float, state: State) -> tuple[float, float]:
        return (self.runs[-1] if delta > 0 else 0.0, 0.0)

    def energy(self, delta: float, state: State) -> float:
        return 0.5 * self.runs[-1] * max(delta, 0.0) ** 2


def test_a_run_whose_forces_do_not_settle_is_not_taken_for_converged() -> None:
    law = Unlike()
    bodies = {"wall": ao.Obstacle(), "mass": ao.RigidMass(1.0, 1.0)}
    scene = ao.Scene(bodies, [ao.Contact("wall", "mass", law)])
    made = assemble(scene, 1e-2)
    law.runs.clear()
    found = converge(made.system, made.lasting, 1e-2, 1e-3, 100, 10**6)
    assert found.force > 1e-3
    assert len(law.runs) > 3
