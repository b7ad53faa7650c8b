"""Surfaces by PyVista: a page that is turned by hand without a network, and pictures."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from antiosc._types import Array, IntArray
from antiosc.errors import AntioscError, MissingDependencyError

#: What pip installs for it.
REMEDY = "install PyVista with trame: pip install 'pyvista[jupyter]'"
#: Where vtk.js would fetch a picture for the window's title bar from.
ICONS = "https://kitware.github.io/vtk-js/icon/"
#: Longest time for one page, s.
LIMIT = 120.0
#: Whether PyVista draws pictures on this machine; None: not tried.
_draws: bool | None = None


def available() -> bool:
    """Whether PyVista and what exports its views are installed."""
    return all(importlib.util.find_spec(name) for name in ("pyvista", "trame_vtk"))


def turning_page(
    points: Array, faces: IntArray, values: Array, label: str, arrow: Array | None = None
) -> str:
    """A page in HTML with a surface that is turned, moved and enlarged by the mouse.

    Parameters
    ----------
    points : (P, 3) [m]; faces : (F, 3 or 4) corners; values : (P,) by which they are coloured.
    label : of the scale of colours.
    arrow : (2, 3), optional
        Tail and tip of an arrow.

    Raises
    ------
    MissingDependencyError
        PyVista or trame.
    AntioscError
        PyVista cannot draw here; it works in a process of its own, since VTK aborts the process
        on some machines without a screen.
    """
    if not available():
        raise MissingDependencyError(f"fields that are turned by hand are not here: {REMEDY}.")
    content = _drawn("page.html", points, faces, values, label, arrow)
    return content.decode().replace(ICONS, "data:,")


def picture(
    points: Array,
    faces: IntArray,
    values: Array,
    label: str,
    arrow: Array | None = None,
    *,
    view: tuple[float, float],
    scale: tuple[float, float] | None = None,
) -> bytes | None:
    """A picture of the surface as PNG; None where PyVista is missing, or cannot draw here.

    Arguments as of `turning_page`; `view`: (elevation, azimuth), degrees; `scale`: values of the
    ends of the colours, by default the least and the largest.
    """
    global _draws
    if _draws is None:
        _draws = importlib.util.find_spec("pyvista") is not None
    if not _draws:
        return None
    more = {"view": np.array(view), "scale": np.array(scale or ())}
    try:
        return _drawn("picture.png", points, faces, values, label, arrow, **more)
    except AntioscError:  # no screen, and no drawing without one: matplotlib serves
        _draws = False
        return None


def _drawn(
    name: str,
    points: Array,
    faces: IntArray,
    values: Array,
    label: str,
    arrow: Array | None,
    **more: Array,
) -> bytes:
    """The file `name` that PyVista writes in a process of its own."""
    used, corners = np.unique(faces, return_inverse=True)
    with tempfile.TemporaryDirectory(prefix="antiosc-") as folder:
        source, target = Path(folder) / "surface.npz", Path(folder) / name
        np.savez(
            source,
            points=points[used],
            faces=corners.reshape(faces.shape),
            values=values[used],
            label=label,
            arrow=np.zeros((0, 3)) if arrow is None else arrow,
            **more,
        )
        child = Path(__file__).with_name("turning_child.py")
        program = [sys.executable, "-P", str(child), str(source), str(target)]
        try:
            done = subprocess.run(
                program, capture_output=True, text=True, timeout=LIMIT, check=False, cwd=folder
            )
        except subprocess.TimeoutExpired:
            raise AntioscError(f"PyVista drew for more than {LIMIT:g} s: broken off.") from None
        if done.returncode or not target.is_file():
            last = (done.stderr.strip().splitlines() or ["without a word"])[-1]
            raise AntioscError(f"PyVista ended with code {done.returncode}: {last}.")
        return target.read_bytes()
