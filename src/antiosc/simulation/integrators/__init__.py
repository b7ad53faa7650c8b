"""Integrators to compare the march with, one in each file, and their common sequence of events."""

from antiosc.simulation.integrators.conserving import Conserving
from antiosc.simulation.integrators.ivp import METHODS as IVP_METHODS, SolveIVP
from antiosc.simulation.integrators.leapfrog import Leapfrog
from antiosc.simulation.integrators.newmark import Newmark
from antiosc.simulation.integrators.problem import MAX_STEPS, Integrator, Phase, Problem, Segment
from antiosc.simulation.integrators.run import Contact, Trajectory, flight, run

#: fixed-step integrators by the name `simulate` takes
FIXED_STEP: dict[str, type[Newmark] | type[Conserving] | type[Leapfrog]] = {
    method.name: method for method in (Newmark, Conserving, Leapfrog)
}

__all__ = [
    "FIXED_STEP",
    "IVP_METHODS",
    "MAX_STEPS",
    "Conserving",
    "Contact",
    "Integrator",
    "Leapfrog",
    "Newmark",
    "Phase",
    "Problem",
    "Segment",
    "SolveIVP",
    "Trajectory",
    "flight",
    "run",
]
