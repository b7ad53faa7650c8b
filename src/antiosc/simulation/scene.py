"""A scene that runs: its parts are posed, integrated, and read as a history."""

from __future__ import annotations

from dataclasses import dataclass

from antiosc.base.memory import within_memory
from antiosc.simulation.histories.history import SceneHistory
from antiosc.simulation.problem.scene_parts import SceneParts
from antiosc.simulation.refinement import integrate


@dataclass(frozen=True, eq=False)
class Scene(SceneParts):
    """Bodies in contact; `run` integrates their motion.

    Parameters
    ----------
    bodies : mapping
        Name -> model, `RigidMass`, `Sphere`, `Obstacle`, `Impactor`, `RigidBody` or `SiteModes`.
    contacts : sequence of Contact
        At least one.
    gravity : float or sequence of 3 floats
        [m/s^2] along the contacts' direction, or a vector.
    loads : sequence of Load
        Forces in time.
    base : Base, optional
        Motion of the ground.
    motion : mapping, optional
        Name -> `Motion` with which a free body starts, the velocity [m/s] along its one
        coordinate, or its `ModalState`.
    preload : bool
        Start from the static equilibrium under gravity, the loads at t = 0 and closed contacts.

    Raises
    ------
    InputError
        For names that do not exist and values outside their range.
    """

    @within_memory
    def run(
        self,
        duration: float,
        *,
        tol: float = 1e-3,
        method: str = "exact",
        step: float | None = None,
        max_contacts: int = 10_000,
        max_steps: int = 1_000_000,
    ) -> SceneHistory:
        """Integrate over `duration` [s] to a relative error `tol` of the contact forces.

        Parameters
        ----------
        duration : float
            [s].
        tol : float
            Relative error of all contact forces together in the L2 norm, and of their peak.
        method : str
            "exact"; to compare with, "newmark", "conserving", "leapfrog", or a method of
            `scipy.integrate.solve_ivp` such as "DOP853", which runs once, to tol/100, and states
            no error. Flights are exact, unless loads or a base act: these are integrated too.
        step : float, optional
            Step [s] of one run, whose error is then not known; otherwise steps are refined until
            `tol` is met. Of `solve_ivp` it is the largest. "exact" halves it where it does not
            resolve the forces, and stops with a message where the contacts excite the modes at
            this step.
        max_contacts, max_steps : int
            Bounds on the work; a run that meets one stops and says so.

        Returns
        -------
        SceneHistory

        Raises
        ------
        InputError
            For a scene that cannot be posed.
        AccuracyError
            When a force leaves the range of its law.
        OutOfMemoryError
            For a run that does not fit in the free memory.
        """
        return integrate(self, duration, tol, max_contacts, max_steps, method, step)
