"""Matrix files as other programs write them, made here by rules of their manuals."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np


def spring_frame(nodes: int = 5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(K, M, labels) of nodes in space on springs to the ground and to each other; full rank."""
    rng = np.random.default_rng(nodes)
    n = 3 * nodes
    K = np.zeros((n, n))
    for i in range(nodes):
        k = rng.standard_normal((3, 3))
        K[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += 1e5 * (k @ k.T + np.eye(3))
        if i + 1 < nodes:
            d = np.zeros((n, 3))
            d[3 * i : 3 * i + 3], d[3 * i + 3 : 3 * i + 6] = np.eye(3), -np.eye(3)
            K += 1e6 * d @ np.diag(rng.uniform(1, 2, 3)) @ d.T
    M = np.diag(rng.uniform(1, 2, n))
    M[0, 4] = M[4, 0] = 0.05
    labels = np.column_stack([10 * (1 + np.arange(n) // 3), 1 + np.arange(n) % 3])
    return K, M, labels


def triples(A: np.ndarray, half: bool = True) -> list[tuple[int, int, float]]:
    """Entries (row, column, value) of the lower triangle, or of all."""
    rows, columns = np.nonzero(np.tril(A) if half else A)
    return [(int(i), int(j), float(A[i, j])) for i, j in zip(rows, columns, strict=True)]


def matrix_market(path: Path, A: np.ndarray, half: bool = True) -> None:
    own = triples(A, half)
    kind = "symmetric" if half else "general"
    head = f"%%MatrixMarket matrix coordinate real {kind}\n% by hand\n"
    lines = [f"{i + 1} {j + 1} {v!r}" for i, j, v in own]
    path.write_text(head + f"{len(A)} {len(A)} {len(own)}\n" + "\n".join(lines) + "\n")


def sierra(path: Path, A: np.ndarray, name: str, half: bool = True) -> None:
    """Sierra/SD's function for MATLAB."""
    lines = [f"{i + 1} {j + 1} {v!r};" for i, j, v in triples(A, half)]
    n = len(A)
    head = f"function a={name}()\nNumRows = {n};\na=[\n"
    path.write_text(head + "\n".join(lines) + f"\n];\na=sparse(a(:,1),a(:,2),a(:,3),{n},{n});\n")


def sierra_map(gid: Path, aset: Path, labels: np.ndarray) -> None:
    """Sierra/SD's vectors of the numbers of nodes, and of the rows of their nine dofs."""
    nodes = list(dict.fromkeys(labels[:, 0].tolist()))
    texts = [f"x({k + 1}) = {node};" for k, node in enumerate(nodes)]
    rows = [
        f"x({9 * nodes.index(node) + dof}) = {row + 1};"
        for row, (node, dof) in enumerate(labels.tolist())
    ]
    for path, size, lines in ((gid, len(nodes), texts), (aset, 9 * len(nodes), rows)):
        path.write_text(f"function x = f()\nx = zeros({size}, 1);\n" + "\n".join(lines) + "\n")


def abaqus_labels(path: Path, A: np.ndarray, labels: np.ndarray, half: bool = True) -> None:
    """FORMAT=MATRIX INPUT: with commas, comments and the upper triangle."""
    lines = ["** matrix of a test", "*MATRIX INPUT, NAME=A"] if half else []
    for i, j, v in triples(A, half):
        (a, b), (c, d) = labels[j], labels[i]
        lines.append(f"{a},{b}, {c},{d}, {v:.16e}")
    path.write_text("\n".join(lines) + "\n")


def op4_binary(
    path: Path, matrices: dict[str, np.ndarray], style: str, order: str = "<", wide: bool = False
) -> None:
    """`style`: "dense", "sparse" (one word a string) or "bigmat"; `wide`: integers of 8 bytes."""
    word = "q" if wide else "i"
    out = []

    def record(content: bytes) -> None:
        mark = struct.pack(order + "i", len(content))
        out.append(mark + content + mark)

    for name, A in matrices.items():
        n = len(A)
        rows = -n if style == "bigmat" else n
        label = name.encode().ljust(16 if wide else 8)
        record(struct.pack(f"{order}4{word}", n, rows, 6, 2) + label)
        per_number = 1 if wide else 2
        for column in range(n):
            here = np.flatnonzero(A[:, column])
            if style == "dense":
                values = A[here[0] : here[-1] + 1, column].astype(order + "f8")
                head = (column + 1, here[0] + 1, per_number * len(values))
                record(struct.pack(f"{order}3{word}", *head) + values.tobytes())
                continue
            runs = np.split(here, np.flatnonzero(np.diff(here) != 1) + 1)
            body = b""
            for run in runs:
                length = per_number * len(run) + 1
                if style == "bigmat":
                    body += struct.pack(f"{order}2{word}", length, run[0] + 1)
                else:
                    body += struct.pack(f"{order}{word}", (length << 16) + run[0] + 1)
                body += A[run, column].astype(order + "f8").tobytes()
            words = len(body) // (8 if wide else 4)
            record(struct.pack(f"{order}3{word}", column + 1, 0, words) + body)
        record(struct.pack(f"{order}3{word}", n + 1, 1, per_number) + struct.pack(order + "d", 1.0))
    path.write_bytes(b"".join(out))


def dmig(path: Path, matrices: dict[str, np.ndarray], labels: np.ndarray) -> None:
    """One triangle in free fields."""
    out = ["$ DMIG by hand"]
    for name, A in matrices.items():
        out.append(f"{'DMIG':8}{name:8}{0:8d}{6:8d}{2:8d}{0:8d}{'':16}{len(A):8d}")
        for column, (grid, component) in enumerate(labels):
            rows = [i for i in range(column, len(A)) if A[i, column]]
            head = f"DMIG,{name},{grid},{component},"
            for i in rows:
                out.append(f"{head},{labels[i][0]},{labels[i][1]},{A[i, column]:.15e}")
                head = "+"
    path.write_text("\n".join(out) + "\n")
