"""The page of a report: its scripts, and the data of the impact that it repeats.

The data describe one impact of `simulate` or `strike`, or a map; `live_meshes` adds the struck part
and the sites of a map.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable, Mapping
from math import pi
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from antiosc import (
    ContactLaw,
    Damping,
    History,
    LinearBody,
    ModalBody,
    SceneHistory,
)
from antiosc.base._types import Array
from antiosc.engine import library
from antiosc.engine.contact.base import Compiled, is_compiled
from antiosc.impact.histories.bars import DEFLECTION, QUANTITIES, ErrorBudget
from antiosc.models.body import info_of, site_points

#: Data of the page: numbers, texts, arrays, and lists and tables of these.
Data: TypeAlias = dict[str, Any]

PAGE_FOLDER = Path(__file__).with_name("page")
#: Scripts of the page in the order of their dependence.
PAGE_SCRIPTS = ("units", "engine", "data", "view", "part", "map", "chart", "page", "fall")
#: Starting scripts: of a report, which contains its data, and of `antiosc open`.
REPORT_SCRIPT = "start"
OPEN_SCRIPT = "open"
#: The kinds of arrays on the page; JavaScript's names of them are in data.js.
ARRAY_TYPES = {"<f8": "f8", "<f4": "f4", "<i2": "i2", "<u4": "u4", "|u1": "u1"}


def page_script(starting_script: str = REPORT_SCRIPT) -> str:
    """The JavaScript of a page; `starting_script`: REPORT_SCRIPT or OPEN_SCRIPT."""
    text = "\n".join(
        (PAGE_FOLDER / f"{name}.js").read_text("utf-8") for name in (*PAGE_SCRIPTS, starting_script)
    )
    return f'(() => {{\n"use strict";\n{text}}})();\n'


def page_style() -> str:
    """The style sheet of the page."""
    return (PAGE_FOLDER / "page.css").read_text("utf-8")


def engine_wasm() -> bytes:
    """The C library compiled to WebAssembly (by packaging/library.py --page)."""
    return (PAGE_FOLDER / "engine.wasm").read_bytes()


def content_policy(program: str) -> str:
    """The Content-Security-Policy that lets only the JavaScript `program` run, without network."""
    digest = base64.b64encode(hashlib.sha256(program.encode()).digest()).decode("ascii")
    scripts = f"script-src 'sha256-{digest}' 'wasm-unsafe-eval'"
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; {scripts}"


def embedded_json(data: Data) -> str:
    """Data as JSON that is safe inside a script element."""
    text = json.dumps(
        plain_json(data, _packed_array), allow_nan=False, separators=(",", ":"), ensure_ascii=True
    )
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def plain_json(value: object, array_value: Callable[[Array], object] = np.ndarray.tolist) -> object:
    """A value as JSON: NaN and infinity become None, an array a becomes `array_value(a)`."""
    if isinstance(value, Mapping):
        return {str(key): plain_json(entry, array_value) for key, entry in value.items()}
    if isinstance(value, bytes):
        value = np.frombuffer(value, dtype=np.uint8)
    if isinstance(value, np.ndarray):
        return plain_json(array_value(value), array_value)
    if isinstance(value, list | tuple):
        return [plain_json(entry, array_value) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        if np.isfinite(value):
            return value
        return None
    if value is None or isinstance(value, int | str):
        return value
    return str(value)


def _packed_array(values: Array) -> Data:
    """An array as {"$": type, "of": base64}, which data.js decodes."""
    values_in_order = np.ascontiguousarray(values)
    values_in_order = values_in_order.astype(values_in_order.dtype.newbyteorder("<"))
    text = base64.b64encode(values_in_order.tobytes()).decode("ascii")
    return {"$": ARRAY_TYPES[values_in_order.dtype.str], "of": text}


#: Relative force error of the runs on the page.
PAGE_TOL = 1e-6
#: Relative force error of the runs that colour a map.
MAP_TOL = 1e-3
#: Number of points of the computed curve on the page.
CURVE_POINTS = 2000


def impact_of_history(hit: History, bars: ErrorBudget | None) -> Data | None:
    """The impact as data for the page; None if the page cannot repeat it.

    The page repeats impacts of `simulate` and `strike` with one contact by a built-in law, open at
    the start, constant loads, no dampers that couple modes, and a striker that does not stretch.
    `bars`: the error budget of the impact, or None.
    """
    if not isinstance(hit, History) or isinstance(hit, SceneHistory):
        return None
    system = hit.assembly.system
    law = hit.assembly.laws[0]
    if not is_compiled(law) or system.breaks.size > 1 or system.start_forces.any():
        return None
    # the page has uncoupled modes and linear strikers only
    if system.first is not None or "impactor" in hit.assembly.stretch_forces:
        return None
    body = hit.assembly.bodies["structure"]
    striker = hit.assembly.bodies["impactor"]
    if not isinstance(body.modes, ModalBody) or not isinstance(striker.modes, ModalBody):
        return None
    loads = np.split(system.loads[0], [body.omega.size])
    local = law.compliance
    speed = abs(float(system.beta[0] @ system.v))
    common_data = impact_data(
        law, modal_data(striker.modes, striker.start_velocities, loads[1]), hit.impactor, speed
    )
    return {
        **common_data,
        "ratio": _damping_ratio(hit.model),
        "gap": float(system.offsets[0, 0]),
        "duration": float(hit.run.time[-1]),
        "body": {
            **modal_data(body.modes, body.start_velocities, loads[0], local),
            "stretch": _second_order_forces(hit),
        },
        "computed": _computed_data(hit, bars),
    }


def impact_data(law: ContactLaw, striker_data: Data, impactor: LinearBody, speed: float) -> Data:
    """Data for the page that do not depend on the site: law, striker, positions of sliders.

    `striker_data`: `modal_data` of `impactor`; `speed`: approach speed [m/s].
    """
    assert isinstance(law, Compiled)
    values = law.parameters()
    rigid = striker_data["omega"].size == 1 and striker_data["omega"][0] == 0
    exponent = {library.LINEAR: 1.0}.get(law.kind, getattr(law, "exponent", 1.5))
    return {
        "tol": PAGE_TOL,
        "coarse": MAP_TOL,
        "law": {
            "kind": law.kind,
            "name": type(law).__name__,
            "params": finite_parameters(law),
            "unit": "N/m" if exponent == 1 else f"N/m^{exponent:g}",
        },
        "striker": striker_data,
        "mass": 1 / float(striker_data["b"][0] ** 2) if rigid else None,
        "radius": getattr(impactor, "radius", None) if rigid else None,
        "speed": speed or None,
        "stiffness": None if law.kind == library.TABLE else values[0],
    }


def finite_parameters(law: ContactLaw) -> list[float]:
    """The finite parameters of a law, as JSON has no infinity (Hertz's law may have one)."""
    assert isinstance(law, Compiled)
    return [value for value in law.parameters() if np.isfinite(value)]


def modal_data(
    body: ModalBody,
    start_velocities: Array | None = None,
    modal_loads: Array | None = None,
    local_compliance: float = 0.0,
) -> Data:
    """A body's free modes as data for `pose` of engine.js.

    `start_velocities`: modal velocities (J,) [m/s]; `modal_loads`: modal loads (J,) [N]; both 0 by
    default; `local_compliance`: local compliance [m/N] in addition to the modes'.
    """
    zeros = np.zeros(body.omega.size)
    return {
        "omega": body.omega,
        "decay": zeros if body.decay is None else body.decay,
        "b": body.b,
        "v": zeros if start_velocities is None else start_velocities,
        "load": zeros if modal_loads is None else modal_loads,
        "r": body.r,
        "mobility": body.inverse_mass,
        "local": local_compliance,
    }


def _second_order_forces(hit: History) -> Data | None:
    """Second-order forces of the structure as flat arrays for the page; None if it is linear."""
    stretching = hit.assembly.stretch_forces.get("structure")
    system = hit.assembly.system
    if stretching is None:
        return None
    assert system.quadratic is not None
    assert system.cubic is not None
    return {
        "rows": system.beta[-stretching.size :, hit.assembly.stacked.spans["structure"]].ravel(),
        "modes": stretching.modes.T.ravel(),
        "quadratic": system.quadratic.ravel(),
        "cubic": system.cubic.ravel(),
    }


def _damping_ratio(model: LinearBody) -> float | None:
    """The damping ratio if all modes have the same, 0 without damping; else None."""
    damping = getattr(model, "damping", None)
    if damping is None:
        return 0.0
    if not isinstance(damping, Damping) or damping.alpha or damping.beta:
        return None
    return damping.ratio if isinstance(damping.ratio, float) else None


def _computed_data(hit: History, budget: ErrorBudget | None) -> Data:
    """Force curve, numbers and texts of the computed impact, which the page keeps."""
    time = hit.time
    force = hit.force
    if time.size > CURVE_POINTS:
        time = np.linspace(0.0, float(time[-1]), CURVE_POINTS)
        force = hit.force_at(time)
    numbers: Data = {name: float(getattr(hit, name)) for name in QUANTITIES}
    numbers |= {"restitution": hit.restitution, "contacts": len(hit.contacts)}
    numbers["dent"] = 0.0 if hit.dent is None else hit.dent.depth
    if (motion := hit.site_motion) is not None:  # None of a part that moves on as a whole
        numbers["site_deflection"] = motion.largest_displacement
    last = hit.contacts[-1][1] if hit.contacts else 0.0
    ends = {"last": last, "touching": bool(last >= hit.run.time[-1])}
    return {"time": time, "force": force, **numbers, **ends, **_shown_data(hit, budget)}


def _shown_data(hit: History, budget: ErrorBudget | None) -> Data:
    """`shown`: quantity -> text with its error bar; `bar`: relative error of the force."""
    if budget is None:
        return {"shown": {}}
    shown = {name: budget.shown(name, 3) for name in QUANTITIES}
    shown["restitution"] = budget.shown_restitution(hit.restitution)
    if budget.deflection is not None:
        shown["site_deflection"] = budget.shown(DEFLECTION, 3)
    return {"shown": shown, "bar": budget["peak_force"].known}


#: A striker of unknown size is drawn as a ball of this density [kg/m^3].
STEEL_DENSITY = 7850.0


def set_up_caption(data: Data) -> str:
    """Text below the picture of the set-up."""
    if "fall" in data:
        return "Drag to turn; red: the impacts, click one."
    return "Drag to turn; dark: held by supports; the arrow is the direction of impact."


def striker_place(hit: History, impact: Data) -> Data | None:
    """Contact point [m], direction and radius [m] with which the page draws the striker.

    `impact`: `impact_of_history` of `hit`. None for a site without coordinates.
    """
    points = list(site_points(hit.model).values())
    direction = info_of(hit.model).direction
    if len(points) != 1 or len(points[0]) != 3 or direction is None or len(direction) != 3:
        return None

    radius = impact["radius"] or getattr(hit.impactor, "tip_radius", None)
    if radius is None and impact["mass"] is not None:  # a steel ball of its mass
        radius = (impact["mass"] / (STEEL_DENSITY * 4 / 3 * pi)) ** (1 / 3)
    return {"point": list(points[0]), "direction": list(direction), "radius": radius}
