"""What tells the arguments of two ranks apart, and what does not."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse

import antiosc as ao
import parts
from antiosc.fem import platform
from antiosc.fem.platform import fingerprint, named, number


def within(limit):
    return lambda x: x[0] <= limit


def within_default(limit):
    return lambda x, limit=limit: x[0] <= limit


class Box:
    """A callable object, as of a caller's own class."""

    def __init__(self, limit):
        self.limit = limit
        self.calls = []

    def __call__(self, x):
        self.calls.append(len(x))
        return x[0] <= self.limit

    def inside(self, x):
        return x[0] <= self.limit


@dataclass(frozen=True)
class Material:
    E: float
    shapes: object = None


#: pairs made twice by the same lines: alike for equal arguments, unlike for others
MAKERS = {
    "number": lambda v: v,
    "float": lambda v: v * 0.1,
    "numpy number": np.float64,
    "complex": lambda v: complex(0, v),
    "text": str,
    "array": lambda v: np.array([1.0, v, 2.0]),
    "integers": lambda v: np.arange(v),
    "large array": lambda v: np.linspace(0, v, 100_000),
    "list": lambda v: [1, [v]],
    "dict": lambda v: {"a": v},
    "set": lambda v: {"x", "y", str(v)},
    "sparse": lambda v: scipy.sparse.identity(3, format="csr") * float(v),
    "closure": within,
    "default": within_default,
    "partial": lambda v: functools.partial(within, v),
    "callable": Box,
    "method": lambda v: Box(v).inside,
    "material": lambda v: {"all": ao.Solid(E=v * 1e9, nu=0.3, rho=1.0)},
    "support": lambda v: [ao.Support(within(v), ("x", "y"))],
    "site": lambda v: ao.Site((v, 0, 0), (0, 0, 1)),
    "vector": lambda v: ao.Site(vector=np.arange(5.0) * v),
    "law": lambda v: ao.Hertz(v * 1e9),
}


@pytest.mark.parametrize("name", MAKERS)
def test_equal_arguments_are_alike_and_others_are_not(name):
    make = MAKERS[name]
    assert fingerprint(make(3)) == fingerprint(make(3))
    assert fingerprint(make(3)) != fingerprint(make(4))


def test_what_ranks_may_have_of_their_own_does_not_count():
    used = Box(0.1)
    used(np.zeros((3, 4)))
    assert fingerprint(used) == fingerprint(Box(0.1))
    rows = [Material(1.0, np.zeros(n)) for n in (3, 4)]
    assert fingerprint(rows[0]) == fingerprint(rows[1])
    masks = [np.zeros(n, dtype=bool) for n in (300, 400)]
    tests = [lambda _, mask=mask: mask for mask in masks]
    assert fingerprint(tests[0]) == fingerprint(tests[1])


def test_names_in_any_order_make_one_support():
    for names in ({"x", "y", "z"}, frozenset(["z", "y", "x"])):
        assert ao.Support("left", names).fix == ("x", "y", "z")


def test_nothing_raises():
    class Hostile:
        def __getattribute__(self, name):
            raise RuntimeError(name)

    loop: list = []
    loop.append(loop)
    for value in (Hostile(), loop, (c for c in "xy"), object(), np.array([object()]), open):
        assert len(fingerprint(value)) == 16
    mesh = parts.box((1, 1, 1))
    for value in (mesh, mesh.dolfinx, ao.Structure(mesh, ao.Solid(**parts.STEEL)).K):
        assert fingerprint(value) == fingerprint(value)


def test_memory_that_is_not_there_is_told():
    @platform.collective()
    def work(error):
        raise error

    with pytest.raises(ao.OutOfMemoryError, match="work"):
        work(MemoryError())
    with pytest.raises(ao.OutOfMemoryError, match=r"Unable to allocate"):
        work(MemoryError("Unable to allocate 7.3 TiB"))
    with pytest.raises(ao.OutOfMemoryError, match=r"^as it was$"):
        work(ao.OutOfMemoryError("as it was"))


def test_no_two_objects_have_one_number():
    """A list takes as many numbers as it has objects: none of those before it and after it."""
    body = parts.box((1, 1, 1)).dolfinx
    meshes = [ao.Mesh(body) for _ in range(5)]
    for made, serial in ((meshes[0], 10**6), (meshes[1:4], 10**6 + 1), (meshes[4], 10**6 + 4)):
        number(made, serial)
    assert {named(one) for one in meshes} == {f"Mesh no. {10**6 + k}" for k in range(5)}
