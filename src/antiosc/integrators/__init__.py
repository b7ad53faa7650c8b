"""How an impact is integrated: one integrator a file, and the course of events they share."""

from antiosc.integrators.exact import Exact
from antiosc.integrators.ivp import METHODS as IVP_METHODS
from antiosc.integrators.ivp import SolveIVP
from antiosc.integrators.problem import Integrator, Phase, Problem, Segment
from antiosc.integrators.run import Contact, Trajectory, run

__all__ = [
    "IVP_METHODS",
    "Contact",
    "Exact",
    "Integrator",
    "Phase",
    "Problem",
    "Segment",
    "SolveIVP",
    "Trajectory",
    "run",
]
