"""Loops of finite elements in C (`csrc/fem/antiosc_fem.h`), in the same library as the march.

Other threads run during a call.
"""

from __future__ import annotations

import ctypes
from ctypes import Structure, c_double, c_float, c_int64, c_void_p

from antiosc.engine import library


class Tetra(Structure):
    """The C structure `afe_tetra`."""

    _fields_ = [("n_groups", c_int64), ("nodes", c_void_p), ("data", c_void_p)]


_SIGNATURES: dict[str, tuple[object, ...]] = {  # result, arguments
    "afe_tetra_product_double": (None, c_void_p, c_double, c_double, c_void_p, c_void_p),
    "afe_tetra_product_float": (None, c_void_p, c_float, c_float, c_void_p, c_void_p),
}

#: The functions of the library, which `antiosc.engine.library` has checked.
functions = ctypes.CDLL(str(library.FILE))

for _name, (_result, *_arguments) in _SIGNATURES.items():
    _function = getattr(functions, _name)
    _function.restype, _function.argtypes = _result, _arguments
