"""Spiders with thousands of nodes, by elimination or bordered: the table in benchmarks/speed.

A post (beam) stands on a face of a steel block, by `Mean` (RBE3) or by `Rigid` (RBE2). The joint is
solved for in three ways: as `assemble` does, where the dofs of large means get a nested basis; by
elimination without that basis, which couples all dofs of the face to each other; and by Lagrange
multipliers, the bordered system [[K, Cᵀ], [C, 0]] of the parts. That matrix is indefinite: CHOLMOD
cannot factor it, so that MUMPS does, and for comparison it factors the eliminated ones too.

    .venv/bin/python benchmarks/spiders.py --help
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import dolfinx
import numpy as np
import options
import scipy.sparse
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

import antiosc as ao
from antiosc.fem.assembly import layout
from antiosc.fem.assembly.joint import HeldDofs, Rows
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.reduce.site import functional

Array = NDArray[np.float64]
T = TypeVar("T")
ROOT = Path(__file__).resolve().parent.parent
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
SIDE, DEEP, POST = 0.2, 0.02, 0.1  # of the block, its depth, height of the post, m
LAYERS = 2
SITE = ao.Site((SIDE / 2, SIDE / 2, DEEP + POST), (1, 0, -0.5), part="post")
#: Most dofs of a face that elimination without a basis couples to each other here.
MOST_DENSE = 5000
COLUMNS = ("unknowns", "entries of the matrix", "of the factor, CHOLMOD", "of the factor, MUMPS",
           "joint s", "factor s, CHOLMOD", "factor s, MUMPS", "compliance")  # fmt: skip
Row = dict[str, float]


def main(
    sizes: tuple[int, ...] = (16, 32), out: Path = ROOT / "benchmarks/speed"
) -> dict[str, dict[str, Row]]:
    """Measure each size; return the numbers by case and way.

    Parameters
    ----------
    sizes : elements along a side of the face
    out : folder of the table
    """
    found, lines = {}, []
    for size in sizes:
        for joint in (ao.Mean, ao.Rigid):
            ways = measured(size, joint("block:top", ("post", (SIDE / 2, SIDE / 2, DEEP))))
            nodes = (2 * size + 1) ** 2
            found[f"{joint.__name__} of {nodes} nodes"] = ways
            exact = ways["bordered"]["compliance"]
            for way, row in ways.items():
                lines.append(line(f"{joint.__name__}, {nodes}", way, row, exact))
                print(lines[-1])
    out.mkdir(parents=True, exist_ok=True)
    text = [
        "# Spiders with thousands of nodes",
        "",
        "Written by `benchmarks/spiders.py`: a post on a face of a block of quadratic hexahedra; "
        "CPU seconds of one process; the last column is the compliance at the top of the post "
        "beside "
        f"that of the bordered system, less 1. {options.code_state()}",
        "",
        f"| joint, nodes | way | {' | '.join(COLUMNS)} |",
        "|---" * (len(COLUMNS) + 2) + "|",
        *lines,
        "",
        "`Rigid` is better eliminated. Of a `Mean` the bordered matrix has fewer entries in its "
        "factor, but it is indefinite: CHOLMOD cannot factor it, and what rests on the Cholesky "
        "factor cannot use it: a site takes MUMPS 4.8 to 7.4 times as long, a map 1.6 to 2.6 times "
        "([table](cholmod_or_mumps.md)). A Schur complement of the multipliers needs a regular K "
        "of the parts, which the free post does not have. So `assemble` eliminates both, and gives "
        f"faces whose mean has {layout.DENSE_ROW} dofs or more the nested basis.",
    ]
    (out / "spiders.md").write_text("\n".join(text) + "\n")
    return found


def measured(size: int, joint: ao.Mean | ao.Rigid) -> dict[str, Row]:
    """Way -> its numbers."""
    parts = {"block": block(size), "post": post()}
    usual = layout.DENSE_ROW
    found = {"block alone": alone(parts["block"])}
    kinds = {"as assemble does": usual}
    if isinstance(joint, ao.Mean) and 3 * (2 * size + 1) ** 2 <= MOST_DENSE:
        kinds["eliminated, no basis"] = 10**9
    for way, least in kinds.items():
        layout.DENSE_ROW = least
        try:
            part, seconds = clocked(lambda: ao.assemble(parts, [joint]))
        finally:
            layout.DENSE_ROW = usual
        b = functional(part, SITE).b
        found[way] = {**by_both(part, b), "joint s": seconds}
    found["bordered"] = bordered(part, joint, of_post(parts["post"]))
    return found


def by_both(part: ao.Structure, b: Array) -> Row:
    """The factor of a structure by CHOLMOD and by MUMPS, and its compliance by CHOLMOD."""
    factor, seconds = clocked(part.factorize)
    return {
        **by_mumps(csr(part.K), b),
        "unknowns": part.dofs,
        "of the factor, CHOLMOD": factor.entries,
        "factor s, CHOLMOD": seconds,
        "compliance": float(b @ factor.solve_block(b[:, None])[:, 0]),
    }


def alone(part: ao.Structure) -> Row:
    """The block without a spider."""
    row = by_both(part, np.zeros(part.size))
    return {**row, "joint s": np.nan, "compliance": np.nan}


def bordered(part: ao.Structure, joint: ao.Mean | ao.Rigid, load_of_post: Array) -> Row:
    """The parts with multipliers."""
    matrix, seconds = clocked(lambda: with_multipliers(part, joint))
    load = np.zeros(matrix.shape[0])
    (member,) = part.members("post")
    load[member.rows] = load_of_post
    return {
        **by_mumps(matrix, load),
        "unknowns": matrix.shape[0],
        "joint s": seconds,
        "of the factor, CHOLMOD": np.nan,
        "factor s, CHOLMOD": np.nan,
    }


def with_multipliers(part: ao.Structure, joint: ao.Mean | ao.Rigid) -> scipy.sparse.csr_matrix:
    """[[K, Cᵀ], [C, 0]] of the parts and the constraints of the joint, scaled alike."""
    none: list[Rows] = []
    held = np.zeros(part.layout.count, dtype=bool)
    for member in part.members():
        held[member.first + member.part.fixed] = True
    rows = joint.constraints(part.layout, HeldDofs(none, held), "the spider")
    C = scipy.sparse.vstack([one.matrix for one in rows])
    K = scipy.sparse.block_diag([csr(member.part.K) for member in part.members()])
    size = float(np.median(K.diagonal()))
    return scipy.sparse.bmat([[K, size * C.T], [size * C, None]], format="csr")


def by_mumps(A: scipy.sparse.csr_matrix, b: Array) -> Row:
    """LDLᵀ by MUMPS: seconds, entries, and bᵀA⁻¹b."""
    A = (A + scipy.sparse.csr_matrix(A.shape)).tocsr()
    A.sort_indices()
    arrays = (A.indptr.astype(PETSc.IntType), A.indices.astype(PETSc.IntType), A.data)
    matrix = PETSc.Mat().createAIJ(A.shape, csr=arrays, comm=MPI.COMM_SELF)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setOperators(matrix)
    solver.setType("preonly")
    solver.setErrorIfNotConverged(True)
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    # delayed pivots of an indefinite matrix outgrow the forecast of the memory
    solver.setOptionsPrefix("bordered_")
    PETSc.Options()["bordered_mat_mumps_icntl_14"] = 200
    solver.setFromOptions()
    _, seconds = clocked(solver.setUp)
    x, load = matrix.createVecs()
    load.setArray(b)
    solver.solve(load, x)
    entries = solver.getPC().getFactorMatrix().getMumpsInfog(29)
    entries = entries if entries > 0 else -(10**6) * entries  # of large ones in millions
    return {
        "entries of the matrix": A.nnz,
        "of the factor, MUMPS": float(entries),
        "factor s, MUMPS": seconds,
        "compliance": float(b.dot(x.getArray())),
    }


def line(case: str, way: str, row: Row, exact: float) -> str:
    """A line of the table."""
    cells = [
        f"{row['unknowns']:.0f}",
        *(millions(row[name]) for name in COLUMNS[1:4]),
        *("" if np.isnan(row[name]) else f"{row[name]:.2f}" for name in COLUMNS[4:7]),
        "" if np.isnan(row["compliance"]) else f"{row['compliance'] / exact - 1:.0e}",
    ]
    return f"| {case} | {way} | {' | '.join(cells)} |"


def millions(count: float) -> str:
    return "" if np.isnan(count) else f"{count / 1e6:.2f} M"


# -- the parts


def block(size: int) -> ao.Structure:
    """The block, held at its bottom."""
    corners, kind = [np.zeros(3), np.array([SIDE, SIDE, DEEP])], dolfinx.mesh.CellType.hexahedron
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, corners, [size, size, LAYERS], kind)
    faces = dolfinx.mesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[2], DEEP))
    tags = dolfinx.mesh.meshtags(mesh, 2, np.sort(faces), np.ones(len(faces), np.int32))
    bottom = ao.Support(lambda x: np.isclose(x[2], 0.0))
    return ao.Structure(ao.read_mesh(mesh, groups={"top": (tags, 1)}), ao.Solid(**STEEL), [bottom])


def post() -> ao.Structure:
    """A beam along z, free."""
    points = [(SIDE / 2, SIDE / 2, DEEP), (SIDE / 2, SIDE / 2, DEEP + POST)]
    return ao.Structure(
        options.line(*points, count=4), ao.Beam(**STEEL, section=ao.Section.circle(0.02))
    )


def of_post(part: ao.Structure) -> Array:
    """The load of the site on the dofs of the post alone."""
    site = ao.Site(SITE.point, SITE.direction)
    return np.asarray(functional(part, site).b)


def clocked(work: Callable[[], T]) -> tuple[T, float]:
    """(result, CPU seconds)."""
    started = time.process_time()
    result = work()
    return result, time.process_time() - started


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--sizes", type=options.listed(options.count), default=(16, 32), help="elements to a side"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks/speed")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
