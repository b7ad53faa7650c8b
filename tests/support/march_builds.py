"""The march compiled for tests: with its inner functions, or with other numbers in it."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from ctypes import byref, c_double, c_int, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

from antiosc.engine import library
from paths import ROOT, SUPPORT

_PARTS: dict[str, tuple[Any, ...]] = {
    "part_crossing": (c_double, *[c_double] * 6),
    "part_polished": (c_double, c_double, c_void_p, c_void_p, c_double, c_double),
    "part_misfit": (c_double, c_double, c_void_p, c_double, c_double, c_int),
    "part_chord": (c_double, c_void_p, c_int, c_double),
    "part_mass_felt": (c_double, c_void_p, c_int, c_double),
    "part_ripple": (c_double, c_void_p, c_double, c_double, c_int),
    "part_left_over": (c_double, c_double),
    "part_bounds": (None, c_void_p, c_int, c_void_p, c_void_p),
    "part_sizes": (None, c_void_p),
    "part_next_branch": (c_int, c_void_p, c_int, c_int, c_double, c_double, c_void_p),
}


@cache
def built(*defines: str) -> Any:
    """The library with `march_parts.c`, and macros such as SWEEPS=0."""
    sys.path.insert(0, str(ROOT / "packaging"))
    try:
        import library as packaged
    finally:
        sys.path.pop(0)
    out = Path(tempfile.mkdtemp()) / "libmarch.so"
    flags = ["-std=c99", "-O0", "-fPIC", "-shared", *(f"-D{each}" for each in defines)]
    units = [SUPPORT / "march_parts.c", ROOT / "csrc" / "export" / "antiosc_model.c"]
    command = [*packaged.compiler(), *flags, "-o", str(out), *map(str, units), "-lm"]
    subprocess.run(command, check=True)
    found = library.load(out, out.parent)
    for name, (result, *arguments) in _PARTS.items():
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    return found


def law_at(law: Any) -> Any:
    """The library's structure of a law."""
    return byref(law.kernel[0])
