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


class Supernodes(Structure):
    """The C structure `afe_supernodes`."""

    _fields_ = [
        ("n_supernodes", c_int64),
        *((name, c_void_p) for name in ("start", "row", "rows", "value", "values", "scale")),
    ]


class Lower(Structure):
    """The C structure `afe_lower`."""

    _fields_ = [(name, c_void_p) for name in ("start", "rows", "values")]


class Blas(Structure):
    """The C structure `afe_blas`."""

    _fields_ = [(name, c_void_p) for name in ("potrf", "trsm", "syrk", "gemm")]


_SIGNATURES: dict[str, tuple[object, ...]] = {  # result, arguments
    "afe_cell_sums": (None, c_void_p, c_int64, c_int64, c_void_p, c_void_p),
    "afe_cell_products": (None, c_void_p, c_int64, c_int64, c_double, *[c_void_p] * 3),
    "afe_cell_blocks": (None, c_void_p, c_int64, c_int64, c_double, *[c_void_p] * 2),
    "afe_tetra_product_double": (None, c_void_p, c_double, c_double, c_void_p, c_void_p),
    "afe_tetra_product_float": (None, c_void_p, c_float, c_float, c_void_p, c_void_p),
    "afe_supernodes_forward_float": (None, c_void_p, c_void_p, c_void_p),
    "afe_supernodes_backward_float": (None, c_void_p, c_void_p, c_void_p),
    "afe_supernodes_forward_int16_t": (None, c_void_p, c_void_p, c_void_p),
    "afe_supernodes_backward_int16_t": (None, c_void_p, c_void_p, c_void_p),
    "afe_supernodes_factor": (c_int, *[c_void_p] * 5),
    "afe_supernodes_to_16_bits": (None, c_void_p, c_void_p),
}

#: The functions of the library, which `antiosc.engine.library` has checked.
functions = ctypes.CDLL(str(library.FILE))

for _name, (_result, *_arguments) in _SIGNATURES.items():
    _function = getattr(functions, _name)
    _function.restype, _function.argtypes = _result, _arguments
