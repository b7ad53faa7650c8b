"""The kinds of arrays that signatures name; shapes and units stand in the docstrings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
#: whole numbers of any width, as libraries count with
IntArray = NDArray[np.integer[Any]]
#: length, width and thickness of a part, m, in falling order
Box = tuple[float, float, float]
#: what NumPy's own searches and sorts return
Index = NDArray[np.intp]
