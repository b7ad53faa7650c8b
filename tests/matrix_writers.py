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


def matrix_market_array(path: Path, A: np.ndarray, half: bool = True) -> None:
    n = len(A)
    values = [repr(float(A[i, j])) for j in range(n) for i in range(j if half else 0, n)]
    kind = "symmetric" if half else "general"
    path.write_text(
        f"%%MatrixMarket matrix array real {kind}\n{n} {n}\n" + "\n".join(values) + "\n"
    )


def abaqus_labels(path: Path, A: np.ndarray, labels: np.ndarray, half: bool = True) -> None:
    """FORMAT=MATRIX INPUT: with commas, comments and the upper triangle."""
    lines = ["** matrix of a test", "*MATRIX INPUT, NAME=A"] if half else []
    for i, j, v in triples(A, half):
        (a, b), (c, d) = labels[j], labels[i]
        lines.append(f"{a},{b}, {c},{d}, {v:.16e}")
    path.write_text("\n".join(lines) + "\n")


def abaqus_coordinates(path: Path, A: np.ndarray, half: bool = True) -> None:
    """FORMAT=COORDINATE: blanks, Fortran's exponents."""
    lines = [f"{j + 1:10d}{i + 1:10d}  {v:.16e}".replace("e", "D") for i, j, v in triples(A, half)]
    path.write_text("\n".join(lines) + "\n")


def harwell_boeing(path: Path, A: np.ndarray, right_hand_side: bool = False) -> None:
    """RSA as HBMAT writes it: lower triangle by columns, fields without blanks between them."""
    n, own = len(A), sorted((j, i, v) for i, j, v in triples(A))
    pointers = 1 + np.searchsorted([j for j, _, _ in own], np.arange(n + 1))
    blocks = [
        [f"{p:14d}" for p in pointers],
        [f"{i + 1:8d}" for _, i, _ in own],
        [f"{v:25.15E}".replace("E", "D")[-22:] for _, _, v in own],
    ]
    per_line = (1, 10, 3)
    lines = [
        ["".join(b[k : k + w]) for k in range(0, len(b), w)]
        for b, w in zip(blocks, per_line, strict=True)
    ]
    rhs = [f"{0.0:22.15E}"] * n if right_hand_side else []
    counts = [len(block) for block in lines]
    head = [
        f"{'by hand':72}{'KEY':8}",
        "".join(f"{c:14d}" for c in [sum(counts) + len(rhs), *counts, len(rhs)]),
        f"RSA{'':11}{n:14d}{n:14d}{len(own):14d}{0:14d}",
        f"{'(1I14)':16}{'(10I8)':16}{'(1P,3D22.15)':20}{'(1E22.15)':20}",
    ]
    if right_hand_side:
        head.append(f"{'F':14}{1:14d}{n:14d}")
    path.write_text("\n".join([*head, *lines[0], *lines[1], *lines[2], *rhs]) + "\n")


def op4_text(path: Path, matrices: dict[str, np.ndarray], style: str) -> None:
    """`style`: "dense", "sparse" (one word for each string) or "bigmat"."""
    out = []
    for name, A in matrices.items():
        n = len(A)
        rows = -n if style == "bigmat" else n
        out.append(f"{n:8d}{rows:8d}{6:8d}{2:8d}{name:8}1P,3E24.16")
        for column in range(n):
            here = np.flatnonzero(A[:, column])
            if style == "dense":
                first, last = here[0], here[-1]
                values = A[first : last + 1, column]
                out.append(f"{column + 1:8d}{first + 1:8d}{len(values):8d}")
                out += _text_lines(values)
                continue
            runs = np.split(here, np.flatnonzero(np.diff(here) != 1) + 1)
            lead = 2 if style == "bigmat" else 1
            words = sum(2 * len(run) + lead for run in runs)
            out.append(f"{column + 1:8d}{0:8d}{words:8d}")
            for run in runs:
                length = 2 * len(run) + 1
                if style == "bigmat":
                    out.append(f"{length:8d}{run[0] + 1:8d}")
                else:
                    out.append(f"{(length << 16) + run[0] + 1:8d}")
                out += _text_lines(A[run, column])
        out += [f"{n + 1:8d}{1:8d}{1:8d}", f"{1.0:24.16E}"]
    path.write_text("\n".join(out) + "\n")


def _text_lines(values: np.ndarray) -> list[str]:
    return ["".join(f"{v:24.16E}" for v in values[k : k + 3]) for k in range(0, len(values), 3)]


def op4_binary(
    path: Path, matrices: dict[str, np.ndarray], style: str, order: str = "<", wide: bool = False
) -> None:
    """The same in Fortran records; `wide`: integers of 8 bytes."""
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


def dmig(path: Path, matrices: dict[str, np.ndarray], labels: np.ndarray, style: str) -> None:
    """`style`: "large" (one triangle), "square" (both), "small" or "free" fields."""
    out = ["$ DMIG by hand"]
    for name, A in matrices.items():
        form = 1 if style == "square" else 6
        out.append(f"{'DMIG':8}{name:8}{0:8d}{form:8d}{2:8d}{0:8d}{'':16}{len(A):8d}")
        for column in range(len(A)):
            rows = [i for i in range(len(A)) if A[i, column] and (i >= column or style == "square")]
            cells = [(*labels[i], A[i, column]) for i in rows]
            grid, component = labels[column]
            if style == "free":
                head = f"DMIG,{name},{grid},{component},"
                for k in range(0, len(cells), 1):
                    g, c, v = cells[k]
                    out.append(f"{head},{g},{c},{v:.15e}" if k == 0 else f"+,{g},{c},{v:.15e}")
                continue
            if style == "small":
                g, c, v = cells[0]
                out.append(
                    f"{'DMIG':8}{name:8}{grid:8d}{component:8d}{'':8}{g:8d}{c:8d}{_small(v)}"
                )
                out += [f"{'':8}{g:8d}{c:8d}{_small(v)}" for g, c, v in cells[1:]]
                continue
            out.append(f"{'DMIG*':8}{name:16}{grid:16d}{component:16d}")
            out += [
                f"{'*':8}{g:16d}{c:16d}" + f"{v:16.9E}".replace("E", "D")[-16:] for g, c, v in cells
            ]
    path.write_text("\n".join(out) + "\n")


def _small(v: float) -> str:
    mantissa, exponent = f"{v:.2e}".split("e")
    return f"{mantissa}{int(exponent):+d}".rjust(8)
