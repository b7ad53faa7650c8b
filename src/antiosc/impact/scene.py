"""`Scene`, several bodies in contact, and `simulate`, an impact of two linear bodies.

Sign convention: d is the direction in which the contact force F >= 0 acts on the structure. The
impactor approaches along +d. The displacements u of the site and w of the impactor are both
measured along d, and

    delta = w - u - gap.

Velocities given by the user are > 0 if they close the gap: the impactor's velocity is w', and the
`initial_velocity` of the structure is -u'. A structure that moves toward an `Obstacle` has u' < 0
and is pushed back along +d. Gravity is the acceleration along +d: if it is > 0, it presses the
impactor on the structure; if < 0, a structure falls on an obstacle. The displacement of a supported
structure (k0 > 0) counts from its equilibrium under gravity; a structure with a rigid-body mode
falls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from antiosc.base import checks, plausible
from antiosc.base.errors import AccuracyWarning, InputError, RangeError, warn, without_warnings
from antiosc.base.process import within_memory
from antiosc.base.texts import COMPLETED, INEXACT, STOPPED, TOUCHING, percent
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.engine.equilibrium import set_initial_forces
from antiosc.engine.march import TOUCH_RESOLUTION, Converged, solve
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.bodies import Impactor, Obstacle
from antiosc.impact.histories import History, SceneHistory
from antiosc.impact.histories.linear_theory import large_deflection_message, warn_large_rotation
from antiosc.impact.histories.run_end import (
    RunEnd,
    open_contacts,
    status_of,
    warn_unless_completed,
)
from antiosc.impact.histories.site_motion import INITIAL_DURATION, LONGER, parted
from antiosc.impact.measured_band import low_band_message
from antiosc.impact.scene_parts import SceneParts
from antiosc.impact.settings import IVP_METHODS, MAX_CONTACTS, MAX_STEPS, Settings
from antiosc.impact.two_bodies import Impact, assemble_pair
from antiosc.models.anti_oscillators import AntiOscillators, is_reduced
from antiosc.models.body import AUTO, AnyLaw, LinearBody, coarse_cell_warning, is_auto, law_of
from antiosc.models.motion import Motion

if TYPE_CHECKING:
    from antiosc.impact.histories.bars import ErrorBudget
    from antiosc.impact.truncation import RunOnModel

H = TypeVar("H", bound=History)


@dataclass(frozen=True, eq=False, repr=False)
class Scene(SceneParts):
    """Bodies in contact; `run` integrates their motion.

    Parameters
    ----------
    bodies : mapping
        Name -> model, `RigidMass`, `Sphere`, `Obstacle`, `Impactor`, `RigidBody` or `SiteModes`.
    contacts : sequence of Contact
        At least one.
    gravity : float or sequence of 3 floats
        Acceleration [m/s^2] along the contacts' direction, or a vector.
    loads : sequence of Load
        Force histories.
    base : Base, optional
        Motion of the ground.
    motion : mapping, optional
        Name -> initial `Motion` of a free body, the velocity [m/s] along its one coordinate, or
        its `ModalState`.
    preload : bool
        Start from the static equilibrium under gravity, the loads at t = 0 and closed contacts; a
        `ModalState` then gives only velocities.

    Raises
    ------
    InputError
        Names that do not exist; values outside their range.
    """

    @within_memory
    def run(
        self,
        duration: float,
        *,
        tol: float = 1e-3,
        method: str = "exact",
        step: float | None = None,
        max_contacts: int = MAX_CONTACTS,
        max_steps: int = MAX_STEPS,
        proof: bool = False,
    ) -> SceneHistory:
        """Integrate over `duration` [s] to a relative error `tol` of the contact forces.

        Parameters
        ----------
        duration : float
            Time to simulate [s].
        tol : float
            Relative error of the forces of each contact in the L2 norm, of its impulse and of its
            peak. The error of a contact with a small force is relative to at least a thousandth of
            the force of the heaviest contact.
        method, step, max_contacts, max_steps, proof : as for `simulate`
            Methods other than "exact" do not support friction; proved bounds are in
            `hit[a, b].enclosure`. "exact" halves a given step where it does not resolve the forces,
            and stops with a message if the bodies gain energy.

        Returns
        -------
        SceneHistory

        Raises
        ------
        InputError
            A scene that is not well posed.
        AccuracyError
            A force leaves the range of its law.
        OutOfMemoryError
            A run that does not fit in the free memory.

        Warns
        -----
        AccuracyWarning
            As `simulate`.
        """
        duration = checks.positive("duration", duration, "s")
        settings = Settings(tol, method, step, max_contacts, max_steps)
        if proof:
            settings = settings.for_proof()
        bodies = list(self.bodies.values())
        motions = list(self.motion.values())
        doubts = plausible.warn_each(plausible.impact_doubts(bodies, bodies, *motions))
        history = _run_scene(self, settings, duration)
        warn_unless_completed(history.status, history.message)
        warn_large_rotation(*history.largest_rotation())
        history = with_warning(history, large_deflection_message(history))

        if any(map(is_reduced, bodies)):
            from antiosc.impact.truncation import warn_too_few  # loaded where it is used

            exact = replace(settings, method="exact", step=None)
            warn_too_few(
                history, lambda bodies: _run_scene(replace(self, bodies=bodies), exact, duration)
            )
        check_range(history, doubts)
        _warn_coarse_cells(self, history)

        return with_proof(history) if proof else history


def _run_scene(scene: Scene, settings: Settings, duration: float) -> SceneHistory:
    """The history of a scene, without warnings."""
    assembly = assemble_scene(scene, duration)
    set_initial_forces(assembly.system, scene.preload)
    kind = partial(SceneHistory, source=RepeatableSceneRun(scene, settings, duration))
    return integrate(kind, assembly, duration, settings)


@dataclass(frozen=True, eq=False)
class RepeatableSceneRun:
    """A scene with the options of its run."""

    scene: Scene
    settings: Settings
    duration: float  # [s]

    def again(self, changes: Mapping[str, Any]) -> History:
        scene = self.scene
        pairs = [(c.a, c.b) for c in scene.contacts]
        for key, known in (("model", scene.bodies), ("velocity", scene.bodies), ("law", pairs)):
            given = checks.instance(key, changes.get(key, {}), Mapping, "a dict by names")
            for name in given:
                if name not in known:
                    raise InputError(
                        f"{key} has {name!r}; the scene has {', '.join(map(str, known))}."
                    )

        bodies = {**scene.bodies, **changes.get("model", {})}
        motion = dict(scene.motion)

        for name, velocity in changes.get("velocity", {}).items():
            if hasattr(bodies.get(name), "velocity"):
                bodies[name] = replace(cast("Any", bodies[name]), velocity=velocity)
            else:
                motion[name] = velocity

        laws = changes.get("law", {})
        contacts = [replace(c, law=laws.get((c.a, c.b), c.law)) for c in scene.contacts]
        other = replace(scene, bodies=bodies, contacts=contacts, motion=motion)
        options = {**vars(self.settings), "step": changes.get("step", self.settings.step)}

        return other.run(changes.get("duration", self.duration), **options)


def with_proof(history: H, tol: float = 0.0) -> H:
    """The history with proved bounds on its forces; warns if they are wider than `tol` > 0."""
    from antiosc.impact.enclosure import enclosures, max_peak_width  # loaded where it is used

    found = enclosures(history.assembly, history.run, tol)
    history = replace(history, enclosures=found)
    width = max_peak_width(found)
    if not tol or width <= tol:
        return history
    return with_warning(
        history,
        f"{found[0].n} Krylov vectors prove the peak force to {percent(width)}, not to"
        f" {percent(tol)}: extract more anti-oscillators, with proof={history.contact_time:.2g},"
        " the contact time.",
    )


def with_warning(history: H, sentence: str) -> H:
    """The history with a sentence (unless "") added to its message; also warn with it."""
    if not sentence:
        return history
    warn(sentence, AccuracyWarning)
    return replace(history, message=f"{history.message} {sentence}")


def integrate(kind: Callable[..., H], assembly: Assembly, duration: float, settings: Settings) -> H:
    """The history (of class `kind`) of an assembly, without warnings."""
    if assembly.stretches and (
        settings.method != "exact" or settings.step is not None or assembly.scene.preload
    ):
        raise InputError(
            'a body that stretches takes the method "exact" without a step and without preload;'
            " extract it without stretch for others."
        )
    linear = _integrated_history(kind, assembly, duration, settings)
    if not assembly.stretches:
        return linear

    from antiosc.impact.stretching import with_stretch  # loaded where it is used

    integrated = partial(_integrated_history, kind, duration=duration, settings=settings)
    history, sentence = with_stretch(linear, integrated, settings.tol)
    return replace(history, message=f"{history.message} {sentence}".rstrip())


def _integrated_history(
    kind: Callable[..., H], assembly: Assembly, duration: float, settings: Settings
) -> H:
    """The history (of class `kind`) of one run."""
    step = settings.step
    tol = settings.tol
    limits = settings.max_contacts, settings.max_steps
    if step is not None:
        step = checks.positive("step", step, "s")
        if step > duration:
            raise InputError(f"step must be <= the duration {duration:g} s; got {step:g} s.")

    if settings.method == "exact":
        converged = integrate_exact(assembly, duration, tol, step, *limits)
    else:
        from antiosc.impact.reference import integrate_reference  # loaded where it is used

        converged = integrate_reference(assembly, duration, settings)

    run = converged.run
    still_open = open_contacts(run, assembly.system)
    errors = converged.force_error, converged.peak_error, converged.agreed_until
    end = RunEnd(run.answer, float(run.time[-1]), run.touches, still_open, *errors)
    status, message = status_of(assembly, end, tol, limits)

    often_refused = step is not None and run.refused > MAX_REFUSED_SHARE * run.steps
    if often_refused and status in (COMPLETED, TOUCHING):
        told = f"The contact excites the motion at the step of {step:g} s, which was halved"
        message = f"{told} {run.refused} times: use a smaller step, or none. {message}"
        status = INEXACT

    bounded = step is None and settings.method not in IVP_METHODS
    error = {"force": converged.force_error, "peak": converged.peak_error} if bounded else {}

    return kind(assembly, run, error, status, message, given=step)


#: Largest share of refused steps of a run at a given step that raises no doubt about this step.
MAX_REFUSED_SHARE = 0.1
#: Tolerance of a run at a given step, which is halved where its error is larger.
HALVED_TIME_SHARE = 0.05


def integrate_exact(
    assembly: Assembly,
    duration: float,
    tol: float,
    step: float | None,
    max_contacts: int,
    max_steps: int,
) -> Converged:
    """Run by the exact method, refined until two runs agree, or once with `step` [s] in contact."""
    fine = assembly.contact_time_estimate / TOUCH_RESOLUTION if step is None else step / 4
    steps = (tol, 0.0, 0.0, fine) if step is None else (HALVED_TIME_SHARE, 0.0, step, fine)
    limits = max_contacts, max_steps, 0 if step is None else 1
    run, found = solve(assembly.system, library.COptions(duration, *steps, *limits))

    if step is not None:
        return Converged(run, step, 0.0, 0.0, duration)
    return Converged(run, found.share, found.force, found.peak, found.certain)


def check_range(history: History, doubts: Sequence[str] = ()) -> None:
    """AccuracyError if a force leaves the range of its law; its text begins with `doubts`."""
    a = history.assembly
    for c, law in enumerate(a.laws):
        if law.valid_force == np.inf:
            continue
        contact = a.scene.contacts[c]
        prefix = f"contact {contact.a!r}, {contact.b!r}: " if len(a.laws) > 1 else ""
        peak = history.contact_histories[c].peak_force
        if peak > law.valid_force:
            radius = a.bodies[contact.a.partition(":")[0]].patch_radius
            stored = [one for body in a.bodies.values() for one in body.info.get("doubts", ())]
            raise range_error(law, peak, radius, [*stored, *doubts], prefix)


def range_error(
    law: ContactLaw, peak: float, radius: float | None, doubts: Sequence[str], where: str = ""
) -> RangeError:
    """The error for a peak force out of the law's range; `radius` [m]: radius of the patch."""
    error = RangeError(" ".join([*doubts, f"{where}{law.out_of_range(peak, radius)}."]))
    error.radius = law.enough_radius(peak, radius)
    return error


def _warn_coarse_cells(scene: Scene, history: SceneHistory) -> None:
    """Warn of a body whose cells are too long for the waves that a contact excites."""
    for contact, touched in zip(scene.contacts, history.contact_histories, strict=True):
        for end in (contact.a, contact.b) if touched.contacts else ():
            name, _, site = end.partition(":")
            estimate = history.assembly.contact_time_estimate
            if sentence := coarse_cell_warning(scene.bodies.get(name), site, estimate):
                of = f"{contact.a!r} and {contact.b!r}"
                warn(f"{name!r} in the contact of {of}: {sentence}", AccuracyWarning)


#: Relative force error of time integration: small compared with the errors of meshes and laws.
DEFAULT_TOL = 1e-3


@checks.within_range
def simulate(
    model: LinearBody,
    impactor: LinearBody,
    contact: AnyLaw = AUTO,
    duration: float | str = checks.REQUIRED,
    method: str = "exact",
    *,
    n: int | str | None = None,
    step: float | None = None,
    tol: float | None = None,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
    gap: float | None = None,
    max_contacts: int = MAX_CONTACTS,
    max_steps: int = MAX_STEPS,
    proof: bool = False,
) -> History:
    """Integrate the impact of `impactor` on the site of `model`.

    Parameters
    ----------
    model : AntiOscillators, or any `LinearBody`
        The structure.
    impactor : RigidMass, Sphere, Obstacle, Impactor, or any `LinearBody`
        The second body; a model without a velocity is at rest.
    contact : ContactLaw or "auto"
        "auto": the law that suits materials, curvatures and strengths of both surfaces
        (`antiosc.engine.contact.choice`). If the model contains the half-space compliance of a
        patch (`local_compliance`), it is subtracted from Hertz's law and laws based on it, which
        contain it too; `history.details` reports this. Other laws are not changed.
    duration : float or "auto"
        Time to simulate [s]; "auto": 1 ms, doubled up to 32 ms until the bodies have parted.
    method : str
        "exact". For comparison: "newmark" and "leapfrog" with equal steps, or a method of
        `scipy.integrate.solve_ivp` such as "DOP853", for laws without memory; it runs once, with
        the tolerance tol/100, and gives no error.
    n : int, "auto" or "proved", optional
        Number of anti-oscillators of the model to use; default all. "auto" takes the smallest
        number whose estimated truncation error of peak force, impulse and contact time meets
        `tol` (see `antiosc.impact.truncation`). "proved" gives bounds, as `proof` does, from the
        fewest Krylov vectors that prove the peak force to `tol`; a warning if none do.
    step : float, optional
        Time step during contact [s] (solve_ivp: largest step). By default the step is refined until
        the force history has converged.
    tol : float
        Relative error of the force history in the L2 norm, of its impulse and peak; default 1e-3.
    initial_velocity : float or Motion
        Initial motion of a structure with rigid-body modes. A number is the velocity [m/s] of a
        translation along the direction of impact, > 0 toward the impactor. If supports prevent a
        translation, or the model's inertia in space is unknown (made by hand or from matrices), it
        is the velocity of the site in the rigid-body motion of least kinetic energy, phi_CR of the
        article. A `Motion` gives velocity and spin in the axes of the mesh.
    gravity : float or sequence of 3 floats
        Acceleration [m/s^2] along the impact direction, or as a vector in the axes of the mesh. It
        acts on free bodies; the displacement of a body that is supported at its site counts from
        its equilibrium.
    gap : float, optional
        Distance at the start [m]; default 0, or the obstacle's gap.
    max_contacts, max_steps : int
        Limits of the computing effort; a run that reaches one stops, with a status and a message.
    proof : bool
        Add proved bounds on the force of the assembled structure, `history.enclosure`, to a run
        with models from `extract(…, proof=…)` (`antiosc.impact.enclosure`). The time steps are as
        for a `tol` of at most 1e-4, since the bounds include their error.

    Returns
    -------
    History

    Raises
    ------
    InputError
        Invalid input.
    AccuracyError
        The peak force is outside the range of validity of the contact law.

    Warns
    -----
    AccuracyWarning
        The run did not end as requested, or the model has too few anti-oscillators for the contact
        (`antiosc.impact.truncation`).
    """
    if isinstance(contact, float | int):
        raise InputError(f"the third argument is the contact: give duration={contact:g}.")
    accuracy = DEFAULT_TOL if tol is None else tol
    goal = accuracy if n == "proved" else 0.0
    if goal:
        n, accuracy, proof = None, min(accuracy, DEFAULT_TOL), True
    settings = Settings(accuracy, method, step, max_contacts, max_steps)
    if proof:
        settings = settings.for_proof()
    law = law_of(contact, model, impactor)
    doubts = plausible.warn_each(plausible.impact_doubts([model], [impactor], initial_velocity))
    first = INITIAL_DURATION if is_auto(duration) else checks.positive("duration", duration, "s")
    scene = Impact(model, impactor, law, first, initial_velocity, gravity, gap)
    if is_auto(duration):
        scene = _with_parting_duration(scene, settings)
    history = simulate_impact(scene, settings, n)
    warn_unless_completed(history.status, history.message)
    if history.run.touches and n != "auto" and is_reduced(history.model):
        from antiosc.impact.truncation import too_few_text_of_run  # loaded where it is used

        rerun = history.source.rerun
        history = with_warning(history, too_few_text_of_run(history, rerun, accuracy))
    if history.run.touches:
        estimate = history.assembly.contact_time_estimate
        history = with_warning(history, coarse_cell_warning(history.model, "", estimate))
    warn_large_rotation(*history.largest_rotation())
    history = with_warning(history, large_deflection_message(history))
    check_range(history, doubts)
    history = with_warning(history, low_band_message(history))

    return with_proof(history, goal) if proof else history


def _with_parting_duration(scene: Impact, settings: Settings) -> Impact:
    """The impact with its duration doubled until the bodies have separated."""
    with without_warnings():
        while scene.duration < LONGER * INITIAL_DURATION:
            hit = simulate_impact(scene, settings)
            if hit.status == STOPPED or parted(hit):
                break
            scene = scene._replace(duration=2 * scene.duration)

    return scene


def simulate_impact(scene: Impact, settings: Settings, n: int | str | None = None) -> History:
    """The history of one impact, without warnings."""

    def integrated(model: LinearBody, settings: Settings) -> History:
        impact = scene if model is scene.model else scene._replace(model=model)
        assembly = assemble_pair(impact)
        kind = partial(History, source=RepeatableImpact(impact, settings))
        return integrate(kind, assembly, scene.duration, settings)

    def rerun(model: AntiOscillators, tol: float) -> History:
        # a model with all its mass in anti-oscillators leaves the others to the exact method
        exact = model.m0 == 0 and scene.contact.rate_dependent
        method = "exact" if exact else settings.method
        return integrated(model, replace(settings, tol=tol, method=method))

    if n is None:
        return integrated(scene.model, settings)

    model, truncation, shortage = _truncated_model(scene.model, n, rerun, settings.tol)
    history = integrated(model, settings)
    history.error.update(truncation)
    if not shortage:
        return history

    status = STOPPED if history.status == STOPPED else INEXACT
    return replace(history, status=status, message=f"{history.message} {shortage}")


@dataclass(frozen=True, eq=False)
class RepeatableImpact:
    """An impact of two bodies with the options of its run."""

    impact: Impact
    settings: Settings

    def again(self, changes: Mapping[str, Any]) -> History:
        named = {"contact": changes.get("law"), **changes}
        velocity = changes.get("velocity")
        impactor = self.impact.impactor
        if velocity is not None and isinstance(impactor, Obstacle):
            named["initial_velocity"] = velocity
        elif velocity is not None and isinstance(impactor, AntiOscillators):
            named["impactor"] = Impactor(impactor, velocity)
        elif velocity is not None:
            named["impactor"] = replace(cast("Any", impactor), velocity=velocity)

        arguments = self.impact._asdict() | vars(self.settings)
        arguments |= {name: named[name] for name in arguments if named.get(name) is not None}

        return simulate(**arguments)

    def rerun(self, model: LinearBody, tol: float, law: ContactLaw | None = None) -> History:
        """The impact on another model, or with another law, by "exact" and without warnings."""
        impact = self.impact._replace(model=model, contact=law or self.impact.contact)
        exact = replace(self.settings, tol=tol, method="exact", step=None)
        with without_warnings():
            return simulate_impact(impact, exact)

    def error_budget(self, hit: History) -> ErrorBudget:
        from antiosc.impact.error_budget import error_budget  # loaded where it is used

        return error_budget(hit, self.rerun)


def _truncated_model(
    model: LinearBody, n: int | str, run: RunOnModel, tol: float
) -> tuple[LinearBody, dict[str, float], str]:
    """(model of `n` anti-oscillators, for "auto" of the fewest that meet `tol`; its errors if
    "auto"; note if even all are too few)."""
    if not isinstance(model, AntiOscillators):
        raise InputError(f"only AntiOscillators can be truncated; got {type(model).__name__}.")
    if not isinstance(n, str):
        return model.truncated(n), {}, ""
    if n != "auto":
        raise InputError(f'n must be a number of anti-oscillators or "auto"; got {n!r}.')

    from antiosc.impact.truncation import choose_n  # loaded where it is used

    choice = choose_n(model, run, tol)
    errors = {
        f"truncation {name}": getattr(choice, name)
        for name in ("peak_force", "impulse", "contact_time")
    }
    shortage = ""
    if choice.worst > tol:
        shortage = (
            f"The model's {model.n} anti-oscillators leave an estimated truncation error of"
            f" {choice.worst:.2g}, more than tol = {tol:g}: extract more (n)."
        )

    return model.truncated(choice.n), errors, shortage
