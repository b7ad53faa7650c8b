"""What the ranks agree on, with two threads in place of two processes."""

from __future__ import annotations

import functools
import threading
import warnings
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse

import antiosc as ao
import parts
from antiosc.fem import platform
from antiosc.fem.platform import compat, fingerprint, named, number
from antiosc.recovery import mesh_fields


class Ranks:
    """The common part of the communicators of `size` threads."""

    def __init__(self, size: int = 2) -> None:
        self.size = size
        self.barrier = threading.Barrier(size, timeout=20)
        self.slots = [None] * size


class Comm:
    """What antiosc calls of a communicator, for one thread."""

    def __init__(self, ranks: Ranks, rank: int) -> None:
        self.ranks, self.rank, self.size = ranks, rank, ranks.size

    def allgather(self, value):
        self.ranks.slots[self.rank] = value
        self.ranks.barrier.wait()
        found = list(self.ranks.slots)
        self.ranks.barrier.wait()
        return found

    def bcast(self, value, root=0):
        return self.allgather(value)[root]


def on_ranks(call, size: int = 2) -> list:
    """What `call(comm)` returns or raises on every rank."""
    ranks, found = Ranks(size), [None] * size

    def work(rank):
        try:
            found[rank] = call(Comm(ranks, rank))
        except Exception as error:
            found[rank] = error

    threads = [threading.Thread(target=work, args=(rank,)) for rank in range(size)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def texts(found) -> set[str]:
    assert all(isinstance(one, ao.InputError) for one in found), found
    return {str(one) for one in found}


class Thing:
    def __init__(self, comm) -> None:
        self.comm = comm


@pytest.fixture
def guarded(monkeypatch):
    """A collective function whose communicator is the one of the thread."""
    monkeypatch.setattr(
        platform,
        "_communicator",
        lambda values, default: next(one.comm for one in values if isinstance(one, Thing)),
    )

    @platform.collective(count=lambda value: len(value))
    def divide(thing, a, b=1.0, count=()):
        if a < 0:
            raise ao.InputError(f"a must be >= 0; got {a}.")
        if a == 13:
            raise MemoryError
        return a / b

    return divide


def test_arguments_that_look_alike_but_differ(guarded):
    """Of long arrays only the ends are shown."""
    whole = np.zeros(5000)

    def call(comm):
        own = whole.copy()
        own[2500] = comm.rank
        return guarded(Thing(comm), own)

    (text,) = texts(on_ranks(call))
    assert "a differs: on rank 1 not what it is on rank 0" in text


def test_only_what_counts_of_an_argument_is_compared(guarded):
    assert on_ranks(lambda comm: guarded(Thing(comm), 6.0, count=[comm.rank])) == [6.0, 6.0]
    found = on_ranks(lambda comm: guarded(Thing(comm), 6.0, count=[0] * (1 + comm.rank)))
    assert "count differs: 1 on rank 0, 2 on rank 1" in texts(found).pop()
    # what cannot be counted is left to the function
    assert on_ranks(lambda comm: guarded(Thing(comm), 6.0, count=None)) == [6.0, 6.0]


def test_arguments_that_do_not_fit_are_compared_by_place(guarded):
    found = on_ranks(lambda comm: guarded(Thing(comm), 1, 2, 3, 4 + comm.rank))
    assert "argument 5 differs: 4 on rank 0, 5 on rank 1" in texts(found).pop()
    found = on_ranks(lambda comm: guarded(Thing(comm), 1, 2, 3, 4))
    assert all(isinstance(one, TypeError) for one in found)


def test_memory_that_is_short_is_told_on_all_ranks(guarded):
    found = on_ranks(lambda comm: guarded(Thing(comm), 13))
    assert all(isinstance(one, ao.OutOfMemoryError) for one in found)
    assert "divide ran out of memory (Python itself)" in str(found[0])


def test_the_first_of_several_errors_wins():
    def call(comm):
        platform.agree(comm, ao.InputError(f"of rank {comm.rank}") if comm.rank else None)

    assert texts(on_ranks(call, 3)) == {"of rank 1"}


def test_work_on_the_root():
    done = []

    def call(comm):
        return platform.on_root(comm, lambda: done.append(comm.rank) or 7)

    assert on_ranks(call, 3) == [7] * 3
    assert done == [0]

    def fails(comm):
        return platform.on_root(comm, lambda: 1 / 0)

    assert all(isinstance(one, ZeroDivisionError) for one in on_ranks(fails, 3))


def test_a_warning_is_given_once():
    with warnings.catch_warnings(record=True, action="always") as said:
        on_ranks(lambda comm: platform.warn(comm, "a coarse mesh"))
    assert [str(one.message) for one in said] == ["a coarse mesh"]


def test_what_all_ranks_made_has_one_number(guarded):
    """Later calls compare such an object by its number, not by its content."""

    class Made(ao.Linear):
        __hash__ = object.__hash__

    Made.__module__ = "antiosc.made"

    @platform.collective()
    def make(thing):
        return [Made(1.0), Made(2.0)]

    (a, b), (c, d) = on_ranks(lambda comm: make(Thing(comm)))
    from antiosc.fem.platform import fingerprint, named

    assert fingerprint(a) == fingerprint(c) != fingerprint(b)
    assert fingerprint(b) == fingerprint(d)
    assert named(a) == named(c)
    assert named(a).startswith("Made no. ")


def test_parts_of_one_rank_stay_and_shared_ones_are_made_whole(monkeypatch):
    """Also where one part has several names; superelements are whole on every rank already."""
    from antiosc.fem.assembly import parts

    monkeypatch.setattr(parts, "whole", lambda mesh: f"{mesh}, whole")

    class Part(Thing):
        mesh = "mesh"

        def again(self, mesh, *, bare):
            assert bare
            return mesh

    def call(comm):
        shared, own = Part(comm), Part(SimpleNamespace(size=1))
        made = parts.on_every_rank({"a": shared, "b": own, "c": shared}, comm)
        return made["a"], made["b"] is own, made["c"]

    assert on_ranks(call) == [("mesh, whole", True, "mesh, whole")] * 2


def test_nodes_of_cells_with_those_of_other_ranks(monkeypatch):
    """Of a list of all nodes in turn, as older versions give it: two own cells and a ghost."""
    nodes = np.arange(12, dtype=np.int32)
    geometry = SimpleNamespace(dofmap=SimpleNamespace(array=nodes))
    geometry.dofmaps = [geometry.dofmap]
    cells = SimpleNamespace(size_local=2, num_ghosts=1)
    monkeypatch.setattr(compat, "cell_map", lambda _: cells)
    found = compat.geometry_nodes(SimpleNamespace(geometry=geometry))
    assert found.tolist() == nodes.reshape(3, 4).tolist()


def test_cells_of_several_ranks_share_their_nodes():
    """Sums over the cells of a node: every rank gets those of the others, its own counted once."""
    numbers = [np.array([10, 11, 12]), np.array([12, 13, 11])]
    sums = [np.array([[1.0], [2.0], [3.0]]), np.array([[40.0], [50.0], [60.0]])]

    def call(comm):
        geometry = SimpleNamespace(input_global_indices=numbers[comm.rank])
        mesh = SimpleNamespace(comm=comm, dolfinx=SimpleNamespace(geometry=geometry))
        total, count = sums[comm.rank].copy(), np.ones(3)
        part = SimpleNamespace(mesh=mesh, parts=["one"])
        mesh_fields._join_ranks(part, np.arange(3), total, count)
        return total[:, 0].tolist(), count.tolist()

    assert on_ranks(call) == [
        ([1.0, 62.0, 43.0], [1.0, 2.0, 2.0]),
        ([43.0, 50.0, 62.0], [2.0, 1.0, 2.0]),
    ]


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
