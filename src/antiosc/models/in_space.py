"""The checked data of a model on its body in space: shapes, momenta and hidden motions."""

from __future__ import annotations

from typing import Any

import numpy as np

from antiosc import checks
from antiosc._types import Index
from antiosc.errors import InputError
from antiosc.models.motion import Inertia
from antiosc.models.parameters import Parameters


def in_space(model: Parameters, rows: Index, slides: int | None = None) -> dict[str, Any]:
    """Shapes, inertia and hidden motions as they are stored; InputError where they do not fit.

    `rows` sorts the shapes; the momenta of the hidden motions follow theirs. `slides` is the number
    of hidden motions where the momenta do not tell it.
    """
    found: dict[str, Any] = {}
    in_order = np.array_equal(rows, np.arange(rows.size))
    if model.shapes is not None:
        shapes = checks.array("shapes", model.shapes, (None, rows.size))
        found["shapes"] = shapes if in_order else shapes[:, rows]
    if model.inertia is not None:
        momentum = checks.instance("inertia", model.inertia, Inertia, "an Inertia").momentum
        if len(momentum) < rows.size:
            raise InputError(
                f"inertia.momentum needs a row for each of psi_0 ... psi_{rows.size - 1}, "
                f"{rows.size} shapes, and one for each hidden motion; got {len(momentum)}."
            )
        all_rows = np.concatenate((rows, np.arange(rows.size, len(momentum))))
        found["inertia"] = model.inertia if in_order else model.inertia.along(momentum[all_rows])
    if model.hidden is not None:
        if model.inertia is not None:
            slides = len(model.inertia.momentum) - rows.size
        if slides is None:
            raise InputError("hidden motions need the inertia, which holds their momentum.")
        nodes = None if model.shapes is None else len(model.shapes)
        found["hidden"] = checks.array("hidden", model.hidden, (nodes, slides))
    return found
