"""What given matrices may leave by rounding, and from where on they are refused or hold a dof."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse

import antiosc as ao
from antiosc.fem.structure.given_matrices import supported

pytestmark = pytest.mark.fem

N, STIFF = 6, 1e4


def chain() -> np.ndarray:
    """Springs between N masses and the ground at both ends."""
    return STIFF * (2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))


def held(K: np.ndarray, M: np.ndarray | None = None) -> list[int]:
    """The dofs that penalties hold; InputError for what is no pair of matrices."""
    M = np.eye(len(K)) if M is None else M
    return supported(*(scipy.sparse.csr_matrix(one) for one in (K, M)))[2].tolist()


def changed(changes: dict[tuple[int, int], float]) -> np.ndarray:
    K = chain()
    for place, value in changes.items():
        K[place] = value
    return K


def askew(share: float) -> np.ndarray:
    """One entry off by a share of √(a_ii a_jj)."""
    return changed({(1, 2): -STIFF + share * 2 * STIFF})


def third(change: float) -> np.ndarray:
    """Eigenvalues -2 `change`, 1.5 + `change` twice."""
    return (1.5 + change) * np.eye(3) - (0.5 + change) * np.ones((3, 3))


#: (below the limit, above it), and the words of the refusal
LIMITS = [
    (lambda s: held(askew(s * 1e-9)), "must be symmetric"),
    (lambda s: held(np.array([[1, 1 + s * 1e-9], [1 + s * 1e-9, 1]])), "exceeds"),
    (
        lambda s: held(changed({(1, 1): -s * 1e-15 * 2 * STIFF, **_alone(1)})),
        "positive semidefinite; its diagonal has -",
    ),
    (lambda s: held(np.eye(3), third(s * 0.75e-8)), "below -"),
    (
        lambda s: held(chain() + s * 1e16 * _between(2, 3)),
        "couples dofs 2 and 3 by a penalty of 1.1e.16",
    ),
]


def _alone(k: int) -> dict[tuple[int, int], float]:
    """Without couplings of one dof."""
    return {(k, k - 1): 0.0, (k - 1, k): 0.0, (k, k + 1): 0.0, (k + 1, k): 0.0}


def _between(i: int, j: int) -> np.ndarray:
    """A spring between two dofs."""
    n = np.eye(N)[i] - np.eye(N)[j]
    return np.outer(n, n)


@pytest.mark.parametrize(("make", "words"), LIMITS)
def test_rounding_is_taken_and_more_is_refused(make, words):
    assert make(0.9) == []
    with pytest.raises(ao.InputError, match=words):
        make(1.1)


def test_a_penalty_holds_from_where_it_hides_its_row():
    """1e14 of what the row holds besides, and 1e12 of what rows hold usually."""
    weak = {(0, 1): -1.0, (1, 0): -1.0}
    for penalty, others in ((1e18, {}), (1e16, weak)):
        assert held(changed({**others, (0, 0): 0.9 * penalty})) == []
        assert held(changed({**others, (0, 0): 1.1 * penalty})) == [0]
        both = changed({**others, (0, 0): 1.1 * penalty, (5, 5): 1e30})
        K, M, fixed = supported(*(scipy.sparse.csr_matrix(one) for one in (both, np.eye(N))))
        assert fixed.tolist() == [0, 5]
        inner = chain()[1:5, 1:5]
        np.testing.assert_array_equal(K.toarray()[1:5, 1:5], inner)
        for matrix, value in ((K.toarray(), 1.0), (M.toarray(), 0.0)):
            for k in (0, 5):
                np.testing.assert_array_equal(matrix[k], value * np.eye(N)[k])
                np.testing.assert_array_equal(matrix[:, k], value * np.eye(N)[k])
