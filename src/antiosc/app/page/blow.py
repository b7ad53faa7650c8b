"""An impact as the page strikes it: the free modes of both bodies, the law, and what has bars."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from antiosc.app.page.assets import Data
from antiosc.base import march
from antiosc.base._types import Array
from antiosc.contact import ContactLaw
from antiosc.contact.base import Compiled, is_compiled
from antiosc.models.body import LinearBody
from antiosc.models.modal import Damping, ModalBody
from antiosc.simulation.histories import History, SceneHistory
from antiosc.simulation.histories.parts import QUANTITIES, ErrorBar
from antiosc.simulation.truncation import softest

#: Relative error of the forces of the runs on the page, and of those that colour a map.
TOL, COARSE = 1e-6, 1e-3
#: Nodes of the curve of the computed case that the page keeps.
CURVE = 2000
#: Digits of an exponent.
RAISED = str.maketrans("0123456789.-", "⁰¹²³⁴⁵⁶⁷⁸⁹·⁻")


def of_history(hit: History, bars: Mapping[str, ErrorBar]) -> Data | None:
    """The impact for the page; None for one that the page cannot repeat.

    It repeats those of `simulate` and `strike`: one contact by a law of this package, apart at the
    start, under loads that do not change. `bars`: its error budget, or empty.
    """
    if not isinstance(hit, History) or isinstance(hit, SceneHistory):
        return None
    system, law = hit.assembly.system, hit.assembly.laws[0]
    if not is_compiled(law) or system.breaks.size > 1 or system.pressed.any():
        return None
    body, striker = hit.assembly.bodies["structure"], hit.assembly.bodies["impactor"]
    if not isinstance(body.modes, ModalBody) or not isinstance(striker.modes, ModalBody):
        return None
    loads = np.split(system.loads[0], [body.omega.size])
    local = getattr(law, "compliance", 0.0)
    speed = abs(float(system.beta[0] @ system.v))
    return {
        **given(law, modal(striker.modes, striker.start, loads[1]), hit.impactor, speed),
        "ratio": _ratio(hit.model),
        "gap": float(system.offsets[0, 0]),
        "duration": float(hit.run.time[-1]),
        "body": modal(body.modes, body.start, loads[0], local),
        "bars": _bars(hit, bars, local),
        "computed": _computed(hit),
    }


def given(law: ContactLaw, striker: Data, impactor: LinearBody, speed: float) -> Data:
    """What does not depend on the site: the law, the striker, and where the sliders stand.

    None for what has no slider: the mass of a striker that vibrates, a measured law's stiffness.
    """
    assert isinstance(law, Compiled)
    values = law.parameters()
    rigid = striker["omega"].size == 1 and striker["omega"][0] == 0
    exponent = {march.LINEAR: 1.0}.get(law.kind, getattr(law, "exponent", 1.5))
    return {
        "tol": TOL,
        "coarse": COARSE,
        "law": {
            "kind": law.kind,
            "name": type(law).__name__,
            "params": [value for value in values if np.isfinite(value)],
            "unit": "N/m" if exponent == 1 else f"N/m{format(exponent, 'g').translate(RAISED)}",
        },
        "striker": striker,
        "mass": 1 / float(striker["b"][0] ** 2) if rigid else None,
        "radius": getattr(impactor, "radius", None) if rigid else None,
        "speed": speed or None,
        "stiffness": None if law.kind == march.TABLE else values[0],
    }


def modal(
    body: ModalBody, start: Array | None = None, load: Array | None = None, local: float = 0.0
) -> Data:
    """A body in free modes, as `pose` of engine.js takes it; `local`: compliance of its patch."""
    zeros = np.zeros(body.omega.size)
    return {
        "omega": body.omega,
        "decay": zeros if body.decay is None else body.decay,
        "b": body.b,
        "v": zeros if start is None else start,
        "load": zeros if load is None else load,
        "r": body.r,
        "mobility": body.mobility,
        "local": local,
    }


def _ratio(model: LinearBody) -> float | None:
    """The damping ratio of all modes, where the damping is just that; None of another damping."""
    damping = getattr(model, "damping", None)
    if damping is None:
        return 0.0
    plain = isinstance(damping, Damping) and isinstance(damping.ratio, float)
    return damping.ratio if plain and damping.alpha == damping.beta == 0 else None


def _bars(hit: History, budget: Mapping[str, ErrorBar], local: float) -> Data:
    """Relative errors by quantity and cause, and the bodies whose impacts tell mesh and truncation.

    On the page the bar of such a cause grows as the difference that its body makes there.
    """
    causes = getattr(budget, "causes", ())
    shares = {name: {c: getattr(bar, c) for c in causes} for name, bar in budget.items()}
    if not np.isfinite([v for own in shares.values() for v in own.values()]).all():
        return {"shares": {}, "variants": {}}
    model, variants = hit.model, {}
    moving = hit.assembly.bodies["structure"].start.any()
    if shares and not moving and getattr(model, "strain_error", None) is not None:
        bodies = {"mesh": model.corrected(), "truncation": softest(model)}
        variants = {cause: modal(one.modal(), local=local) for cause, one in bodies.items()}
    return {"shares": shares, "variants": variants}


def _computed(hit: History) -> Data:
    """The curve and the numbers of the computed case, which stay on the page."""
    time, force = hit.time, hit.force
    if time.size > CURVE:
        time = np.linspace(0.0, float(time[-1]), CURVE)
        force = hit.force_at(time)
    numbers = {name: float(getattr(hit, name)) for name in QUANTITIES}
    told = {"restitution": hit.restitution, "contacts": len(hit.contacts)}
    return {"time": time, "force": force, **numbers, **told}
