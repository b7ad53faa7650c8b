"""The section [output]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Output:
    """The files that `antiosc run` writes; their names are fixed.

    Parameters
    ----------
    csv : bool
        The histories as tables: history.csv, probes.csv, of a sweep or a map sweep.csv, map.csv, of
        a blow that is found force.csv.
    json : bool
        All numbers of the result: result.json.
    plot : "svg", "png" or "pdf", optional
        Pictures of the force, the motion and the model, in this format.
    fields : bool
        The motion of the whole structure as series.pvd, for ParaView.
    model : bool
        The reduced model as model.npz, which [model] reads.
    """

    csv: bool = True
    json: bool = True
    plot: Literal["svg", "png", "pdf"] | None = None
    fields: bool = False
    model: bool = False
