"""Loops of finite elements in C (`csrc/fem/antiosc_fem.h`), in the same library as the march.

Other threads run during a call.
"""

from __future__ import annotations

import ctypes
from ctypes import Structure, c_double, c_float, c_int, c_int64, c_void_p

from antiosc.engine import library


class Cells(Structure):
    """The C structure `afe_cells`."""

    _fields_ = [
        ("kernel", c_void_p),
        *((name, c_int) for name in ("n_nodes", "n_coefficients", "first", "n_dofs", "n_vectors")),
        *((name, c_void_p) for name in ("nodes", "points", "coefficients", "constants")),
        *((name, c_void_p) for name in ("vectors", "weights")),
    ]


class Tetra(Structure):
    """The C structure `afe_tetra`."""

    _fields_ = [("n_groups", c_int64), ("nodes", c_void_p), ("data", c_void_p)]


_SIGNATURES: dict[str, tuple[object, ...]] = {  # result, arguments
    "afe_cell_sums": (None, c_void_p, c_int64, c_int64, c_void_p, c_void_p),
    "afe_tetra_product_double": (None, c_void_p, c_double, c_double, c_void_p, c_void_p),
    "afe_tetra_product_float": (None, c_void_p, c_float, c_float, c_void_p, c_void_p),
}

#: The functions of the library, which `antiosc.engine.library` has checked.
functions = ctypes.CDLL(str(library.FILE))

for _name, (_result, *_arguments) in _SIGNATURES.items():
    _function = getattr(functions, _name)
    _function.restype, _function.argtypes = _result, _arguments
