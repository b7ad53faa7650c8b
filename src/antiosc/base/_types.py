"""Types in signatures; the docstrings state shapes and units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure
    from numpy.typing import ArrayLike as ArrayLike, NDArray as NDArray
else:
    Figure = Any  # matplotlib is loaded where a picture is drawn
    NDArray = np.ndarray  # numpy.typing takes long to load

    class ArrayLike:
        """Placeholder for numpy.typing.ArrayLike at run time: scene files read annotations."""


Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
#: integers of any width
IntArray = NDArray[np.integer[Any]]
#: length, width and thickness of a part, m, in descending order
Box = tuple[float, float, float]
#: the integers that NumPy's searches and sorts return
Index = NDArray[np.intp]
#: a PETSc.Mat or a scipy.sparse.csr_matrix: neither package tells its types
Matrix: TypeAlias = Any
#: real or complex numbers
Numbers: TypeAlias = NDArray[np.float64] | NDArray[np.complex128]
#: choice of a solver; "auto" is direct if the factor fits in memory
SolverChoice: TypeAlias = Literal["auto", "direct", "iterative"]
