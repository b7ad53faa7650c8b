"""Pictures of a part in space: saved displacements, quantities of a map, the deformed part."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.archives import Arrays
from antiosc.base.errors import InputError
from antiosc.base.process import one_thread
from antiosc.base.texts import ReprMixin
from antiosc.fem.platform import collective, on_root
from antiosc.fem.structure.structure import Structure
from antiosc.fields.fields import nodal_motion, shapes_of, skin
from antiosc.fields.peaks import peak_field
from antiosc.impact.histories import History, SceneHistory
from antiosc.impact.histories.factors import amplitudes
from antiosc.models import model_file
from antiosc.plot import surfaces
from antiosc.plot.charts import figure_or_path
from antiosc.plot.surfaces import Deformed
from antiosc.recovery import source
from antiosc.recovery.skin import outer_faces

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]


#: The format of the file, and the largest array that is loaded, bytes.
FORMAT = "antiosc-fields"
LARGEST = 2**32


@dataclass(frozen=True, eq=False, repr=False)
class SavedFields(ReprMixin):
    """Displacements at the nodes of a part: at every time the sum of shapes with factors.

    Attributes
    ----------
    points : (P, 3) nodes, m.
    cells : (kind by meshio's name, (m, nodes) in VTK's order) of each part.
    shapes : (P, 3, k) displacements.
    time : (n,) s, increasing.
    factors : (n, k) factors of the shapes.
    """

    points: Array
    cells: Sequence[tuple[str, IntArray]]
    shapes: Array
    time: Array
    factors: Array

    def __post_init__(self) -> None:
        for name, dim in (("points", 2), ("shapes", 3), ("time", 1), ("factors", 2)):
            value = checks.floats(name, getattr(self, name), None)
            if value.ndim != dim:
                raise InputError(f"{name} must have {dim} axes; got an array of {value.shape}.")
            checks.store(self, **{name: value})
        checks.store(self, cells=_cells(self.cells))
        count = len(self.points)
        k = self.shapes.shape[-1]
        fits = (
            self.points.shape == (count, 3)
            and self.shapes.shape == (count, 3, k)
            and self.factors.shape == (len(self.time), k)
            and all(c.ndim == 2 and np.all((c >= 0) & (c < count)) for _, c in self.cells)
        )
        if not fits or not count or not len(self.time) or np.any(np.diff(self.time) <= 0):
            raise InputError(
                "fields need points (P, 3), shapes (P, 3, k), increasing times (n,), factors "
                f"(n, k) and cells of these points; got {self.points.shape}, {self.shapes.shape}, "
                f"{self.time.shape}, {self.factors.shape}."
            )

    def at(self, time: float) -> Array:
        """Displacements (P, 3) [m] at a time [s], linear between stored times."""
        t = checks.number("time", time, "s")
        if not self.time[0] <= t <= self.time[-1]:
            raise InputError(
                f"the fields are known from {self.time[0]:g} s to {self.time[-1]:g} s; got {t:g} s."
            )
        k = int(np.clip(np.searchsorted(self.time, t) - 1, 0, max(len(self.time) - 2, 0)))
        first = self.factors[k]
        last = self.factors[min(k + 1, len(self.time) - 1)]
        step = self.time[min(k + 1, len(self.time) - 1)] - self.time[k]
        fraction = (t - self.time[k]) / step if step else 0.0
        return np.asarray(self.shapes @ (first + fraction * (last - first)))

    @cached_property
    def faces(self) -> IntArray:
        """(F, 3 or 4) corners of the outer faces; (F, 2) of lines, (F, 1) of nodes alone."""
        return outer_faces(self.cells)

    @cached_property
    def largest(self) -> float:
        """Largest displacement of all nodes and times, m."""
        return max(float(np.linalg.norm(self.shapes @ f, axis=1).max()) for f in self.factors)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write one NumPy `.npz` file, which `load` reads.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        target = checks.path("path", path)
        kinds = [kind for kind, _ in self.cells]
        header = {"format": FORMAT, "version": model_file.VERSION, "kinds": kinds}
        base = {"points": self.points, "shapes": self.shapes, "time": self.time}
        arrays: Arrays = {**base}
        arrays |= {f"cells{i}": cells for i, (_, cells) in enumerate(self.cells)}
        model_file.write(target, header, {**arrays, "factors": self.factors})
        return target

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> SavedFields:
        """Read a file that `save` or `save_fields` wrote.

        Raises
        ------
        InputError
            Another file, or a damaged one.
        """
        names = {"points", "shapes", "time", "factors"}
        header, arrays = model_file.read(path, names, FORMAT, LARGEST)
        try:
            kinds = [str(kind) for kind in header["kinds"]]
            cells: list[tuple[str, IntArray]] = [
                (kind, np.asarray(arrays[f"cells{i}"], dtype=int)) for i, kind in enumerate(kinds)
            ]
            base: dict[str, Array] = {
                name: checks.floats(name, arrays[name], None) for name in sorted(names)
            }
            fields = cls(cells=cells, **base)
            len(fields.faces)  # of corners that the cells have
        except (InputError, KeyError, TypeError, ValueError, IndexError) as error:
            raise InputError(f"{os.fspath(path)} is damaged ({error}); write it again.") from None
        return fields

    def plot(
        self,
        time: float,
        path: str | os.PathLike[str] | None = None,
        *,
        view: ArrayLike | None = None,
    ) -> Figure | Path:
        """The part at a time, magnified, with the same colour scale at all times.

        `path` and `view` as for `plotting.plot_deformed`.
        """
        seen_from = None if view is None else checks.floats("view", view, (2,))
        surface = Deformed.of(self.points, self.faces, self.at(time), self.largest)
        is_shown = path is None
        figure = surfaces.deformed_figure(surface, view=seen_from, whole_scale=True, shown=is_shown)
        return figure_or_path(figure, path)

    def _facts(self) -> list[tuple[str, str]]:
        kinds = ", ".join(f"{len(cells)} {kind}" for kind, cells in self.cells)
        return [
            ("of", f"{len(self.points)} nodes, {kinds}"),
            ("shapes", f"{self.shapes.shape[-1]}"),
            ("time", f"{len(self.time)} times, {self.time[0]:.4g} to {self.time[-1]:.4g} s"),
            ("largest", f"{self.largest:.4g} m"),
        ]


def _cells(blocks_of_cells: Iterable[tuple[str, IntArray]]) -> list[tuple[str, IntArray]]:
    """Checked pairs (kind, cells); InputError for anything else."""
    try:
        blocks = [(str(kind), np.asarray(cells)) for kind, cells in blocks_of_cells]
    except (TypeError, ValueError):
        blocks = []
    if not blocks or any(cells.dtype.kind not in "iu" for _, cells in blocks):
        raise InputError(
            "cells must be pairs (kind, whole numbers (m, nodes)), as [('tetra10', cells)]; got "
            f"{checks.shown(blocks_of_cells)}."
        )
    return blocks


@collective()
@one_thread()
def save_fields(
    structure: Structure,
    history: History,
    path: str | Path,
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Path:
    """Write the displacements of all nodes at many times to one compact file.

    It holds the shapes once and their factors at each time; `SavedFields.load(path)` reads it
    without the finite-element packages, too.

    Parameters
    ----------
    structure, history, body
        As for `write_series`.
    path : str or Path
        The `.npz` file.
    times : array_like (n,), optional
        Increasing times in s; default: those of the history.

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; times that do not increase; a
        file that cannot be written.
    """
    target = checks.path("path", path)
    shapes_of_body = shapes_of(structure, history, body)
    times_checked = np.unique(history.time) if times is None else checks.nonempty("times", times)
    points, cells, shapes = source(structure).at_nodes(structure, shapes_of_body)
    factors = amplitudes(history, times_checked, body)
    on_root(
        structure.comm,
        lambda: SavedFields(points, cells, shapes, times_checked, factors).save(target),
    )
    return target


#: Quantity of a map -> what it is, and its unit.
MAP_QUANTITIES = {
    "k0": ("static stiffness", "N/m"),
    "m_st": ("static mass", "kg"),
    "omega_1": ("first antiresonance", "rad/s"),
    "error": ("bound on the relative error of Z", ""),
    "peak_force": ("peak force", "N"),
    "contact_time": ("contact time", "s"),
    "restitution": ("coefficient of restitution", ""),
    "impulse": ("impulse", "N s"),
    "peak_deflection": ("peak deflection", "m"),
    "peak_stress": ("largest stress in the part", "Pa"),
    "exposure": ("largest stress over the yield strength", ""),
}


def plot_map(
    impact_map: Any,
    path: str | os.PathLike[str] | None = None,
    quantity: str = "peak_force",
) -> Figure | Path:
    """One quantity of an impact map over the surface of the part.

    Parameters
    ----------
    impact_map : ImpactMap
        Faces of which two corners or more are doubtful, and doubtful sites that are drawn as dots,
        are white with dark edges.
    path : str or Path, optional
        As for `plot_history`.
    quantity : str
        One of `impact_map.quantities()`.
    """
    if not callable(getattr(impact_map, "quantities", None)) or isinstance(impact_map, type):
        raise InputError(f"impact_map must be an ImpactMap; got {checks.shown(impact_map)}.")
    quantities = impact_map.quantities()
    if not isinstance(quantity, str) or quantity not in quantities:
        raise InputError(
            f"quantity must be one of {', '.join(quantities)}; got {checks.shown(quantity)}."
        )
    outlined = impact_map.doubtful & ~impact_map.doubtful.all()
    value = np.where(outlined, np.nan, quantities[quantity])
    label, unit = MAP_QUANTITIES.get(quantity, (quantity, ""))
    label += f" ({unit})" if unit else ""
    triangles = len(impact_map.elements) > 0 and impact_map.elements.shape[1] == 3
    figure, axes, scale, unit = surfaces.axes_in_space(impact_map.points, shown=path is None)
    x = scale * impact_map.points
    if triangles:
        front_faces = _front_faces(impact_map, axes)
        faces = impact_map.elements[front_faces]
        values = _on_faces(value[faces])
        single_sites = impact_map.alone
        scale = surfaces.colour_scale(np.concatenate([values, value[single_sites]]))
        doubted = outlined[faces].sum(axis=1) > 1
        surfaces.draw_faces(figure, axes, x[faces], values, label, scale, 0.85, doubted)
        _dots(axes, x[single_sites], scale.to_rgba(value[single_sites]), outlined[single_sites])
    else:
        scale = surfaces.colour_scale(value)
        _dots(axes, x, scale.to_rgba(value), outlined)
        figure.colorbar(scale, ax=axes, shrink=0.7, pad=0.12, label=label)
    if outlined.any():
        from matplotlib.patches import Patch  # which takes long to load

        patch = Patch(facecolor="white", edgecolor="black", label="doubtful sites")
        figure.legend(handles=[patch], loc="lower left", frameon=False)
    surfaces.fit_limits(axes, x)
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", zlabel=f"z ({unit})")
    return figure_or_path(figure, path)


def _dots(axes: Axes3D, points: Array, colours: Array, outlined: BoolArray) -> None:
    """Dots at points (n, 3), those of a mask white with dark edges."""
    edges = colours.copy()
    colours[outlined, :3], edges[outlined, :3] = 1.0, 0.0
    axes.scatter(*points.T, c=colours, edgecolors=edges, s=30, depthshade=False)


def _on_faces(value: Array) -> Array:
    """Mean (T,) of the known values at the corners (T, 3) of faces; NaN where fewer than two are
    known.
    """
    has_value = ~np.isnan(value)
    count = has_value.sum(axis=1)
    mean = np.where(has_value, value, 0.0).sum(axis=1) / np.maximum(count, 1)
    return np.where(count > 1, mean, np.nan)


def _front_faces(impact_map: Any, axes: Axes3D) -> BoolArray:
    """Mask (T,) of the faces to draw: the front faces of a solid that is struck against its
    surface.

    matplotlib sorts faces by their centres; back faces would show through openings.
    """
    corners = impact_map.points[impact_map.elements]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    directions = impact_map.directions[impact_map.elements].mean(axis=1)
    cosines = np.einsum("td,td->t", normal, directions)
    is_frontal = np.abs(cosines) > 0.5 * np.linalg.norm(normal, axis=1)
    if impact_map.info.get("cell_dimension") != 3 or np.mean(is_frontal) < 0.9:
        return np.ones(len(corners), dtype=bool)
    elevation = np.radians(axes.elev)
    azimuth = np.radians(axes.azim)
    view = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    return np.asarray((normal @ view) * -np.sign(cosines) > 0)


def plot_deformed(
    structure: Structure,
    history: History,
    path: str | os.PathLike[str] | None = None,
    time: float | None = None,
    *,
    body: str = "structure",
    point: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    view: Sequence[float] | None = None,
    field: str | None = None,
) -> Figure | Path:
    """The deformed part at one time; displacements are magnified and coloured by their magnitude.

    Parameters
    ----------
    structure, history, body
        As for `write_series`.
    path : str or Path, optional
        As for `plot_history`.
    time : float, optional
        In s; default: the time of the largest displacement of the site, for a scene that of the
        largest contact force.
    point, direction : sequence of 3 floats, optional
        An arrow that ends at `point` (m) shows the impact.
    view : (elevation, azimuth), optional
        Direction of view, degrees: elevation 90 is from above, azimuth 0 from +x and 90 from +y.
    field : str, optional
        Quantity that gives the colours in place of the displacement: one of `peak_field`, as
        "von_mises".

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; a mesh of lines.
    """
    seen_from = None if view is None else checks.floats("view", view, (2,))
    arrow = _arrow(point, direction)
    surface = deformed(structure, history, time, body, field)
    mark = None if field is None else int(np.argmax(surface.values))
    figure = surfaces.deformed_figure(
        surface, arrow=arrow, view=seen_from, mark=mark, shown=path is None
    )
    return figure_or_path(figure, path)


def deformed(
    structure: Structure,
    history: History,
    time: float | None,
    body: str,
    field: str | None = None,
) -> Deformed:
    """The surface of a part at one time; arguments as for `plot_deformed`."""
    checks.instance("structure", structure, Structure, "a Structure")
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    history.of(body)
    if time is None:
        time = float(history.time[np.argmax(_motion(history, body))])
    if field is not None:
        peak = peak_field(structure, history, field, [time], body=body)
        *_, displacements = nodal_motion(structure, history, time, body=body)
        return peak.surface(f"{peak.label} at {1e3 * time:.4g} ms", displacements)
    points, faces, displacements = skin(
        structure, history, checks.number("time", time, "s"), body=body
    )
    largest = float(np.linalg.norm(displacements, axis=1).max())
    return Deformed.of(points, faces, displacements, largest)


def _arrow(
    point: Sequence[float] | None, direction: Sequence[float] | None
) -> tuple[Array, Array] | None:
    """Point and direction of the arrow that shows the impact, if both are known."""
    if (point is None) != (direction is None):
        raise InputError("the arrow of the impact needs both point and direction.")
    if point is None or direction is None:
        return None
    tip = np.array(checks.coordinates("point", point))
    return tip, np.array(checks.coordinates("direction", direction))


def _motion(history: History, body: str) -> Array:
    """The curve that sets the time of the picture: motion of the site, or contact forces."""
    if isinstance(history, SceneHistory):
        return np.asarray(np.abs(history.run.force).max(axis=1))
    impactor = body == "impactor"
    return np.abs(history.impactor_displacement if impactor else history.displacement)
