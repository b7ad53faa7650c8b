"""Functions that numba compiles in the compiled copy of this package, and nobody in the other."""

from __future__ import annotations

import sys
from typing import Any

PACKAGE = __name__.rpartition(".")[0]
COMPILED = PACKAGE.endswith("_compiled")

if COMPILED:
    from numba import njit

    CACHE: bool = vars(sys.modules[PACKAGE])["CACHE"]

    def compiled(signature: str, allocates: bool = False, inline: bool = False) -> Any:
        """Compile to the signature when first imported; afterwards the cache is read.

        What does not allocate needs no counting of references, which costs more than the work.
        `inline` what each step calls: to hand over all the arrays of a scene costs more than a
        step of twenty modes.
        """
        return njit(
            signature,
            cache=CACHE,
            nogil=True,
            _nrt=allocates,
            forceinline=inline,
            error_model="numpy",
            fastmath={"reassoc", "contract", "arcp", "nsz"},
        )

else:

    def compiled(signature: str, allocates: bool = False, inline: bool = False) -> Any:
        """Leave the function as it is."""
        return lambda function: function
