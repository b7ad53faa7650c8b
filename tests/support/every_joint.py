"""One assembly with every joint, and its constrained matrices written by hand.

All parts are of first order, so that their nodes are the corners of their cells. `dense` uses the
matrices of the parts alone, and none of the code that joins them: the constraints are rows of
displacements and rotations of nodes, and K and M are projected on their null space.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from assemblies import NU, SOLID, E, box, line

SECTION = ao.Section.rectangle(0.01, 0.02)
STEEL = {"E": E, "nu": NU, "rho": 2700.0, "section": SECTION}
#: Its mass is none beside that of the rest.
BOLT = ao.Beam(E, NU, 1e-9, ao.Section.circle(0.02))
TURNED = ao.Placement((0.2, 0.05, 0.05), (1, 0, 0), np.pi / 2)
SET_DOWN = ao.Placement((0.5, 0.0, 0.0), (0, 0, 1), 0.4)
HUB, FOOT, GROUND, AXIS = (0.35, 0.05, 0.05), (0.55, 0.04, 0.02), (0.5, 0.1, 0.3), (0.1, 1.0, 0.2)
POINTS = {"hub": HUB, "foot": FOOT, "ground": GROUND}
SPRINGS = {"x": 2e5, "y": 3e5, "z": 4e5, "rx": 2e2, "ry": 3e2, "rz": 4e2}
CORNER, FAR = (0.6, 0.1, -0.1), (0.2, 0.0, 0.0)
#: A frame of six bars: nodes, stiffness of the bars, mass of the nodes.
FRAME = np.array([[0.03, 0, 0], [0.09, 0, 0], [0.06, 0.05, 0], [0.06, 0.02, 0.07]])
BAR, NODE = 3e6, 0.02
SITE = ao.Site((0.45, 0.05, 0.25), (0.2, 0.5, -1), part="d")


def frame() -> tuple[np.ndarray, np.ndarray]:
    """K and M (12, 12) of the frame of bars."""
    K = np.zeros((12, 12))
    for i in range(4):
        for j in range(i):
            n = np.zeros((4, 3))
            n[i] = (FRAME[i] - FRAME[j]) / np.linalg.norm(FRAME[i] - FRAME[j])
            n[j] = -n[i]
            K += BAR * np.outer(n.ravel(), n.ravel())
    return K, NODE * np.eye(12)


def parts(comm: MPI.Comm = MPI.COMM_SELF) -> dict[str, ao.Structure]:
    """The parts by name, in their own axes."""
    upright = ao.Beam(**STEEL, orientation=(1, 0, 0))
    level = ao.Beam(**STEEL, orientation=(0, 0, 1))
    blocks = {
        "a": (box((0, 0, 0), (0.2, 0.1, 0.1), (2, 1, 1), comm=comm), [ao.Support("x0")]),
        "b": (box((0, -0.05, -0.05), (0.1, 0.05, 0.05), (1, 2, 2), comm=comm), []),
        "g": (box((0.5, 0, -0.1), (0.6, 0.1, 0), (2, 2, 1), comm=comm), []),
    }
    made = {name: ao.Structure(m, SOLID, held, order=1) for name, (m, held) in blocks.items()}
    for name, start, end, beam in (
        ("c", HUB, (0.35, 0.05, 0.25), upright),
        ("d", (0.35, 0.05, 0.25), (0.55, 0.05, 0.25), level),
        ("f", (0.55, 0.05, 0.25), FOOT, upright),
    ):
        made[name] = ao.Structure(line(start, end, 2, comm), beam, order=1)
    node, dof = np.repeat(np.arange(4) + 1, 3), np.tile([1, 2, 3], 4)
    where = np.repeat(FRAME, 3, axis=0)
    made["ecu"] = ao.Structure.from_matrices(*frame(), map=(node, dof, where))
    return made


def assembly(comm: MPI.Comm = MPI.COMM_SELF) -> ao.Structure:
    """All joints at once."""
    return ao.assemble(
        parts(comm),
        [
            ao.Tie("a:x1", "b:x0"),
            ao.Rigid("b:x1", "hub"),
            ao.Weld("hub", "c:start"),
            ao.Hinge("c:end", "d:start", axis=AXIS),
            ao.Ball("d:end", "f:start"),
            ao.Bushing("f:start", "ground", SPRINGS),
            ao.Slider("f:end", "foot", axis=(0, 0, 1)),
            ao.Mean("g:z1", "foot"),
            ao.Bolt("a:z0", "g:x0", BOLT),
            ao.Bushing(("a", FAR), ("g", CORNER), {"axial": 7e5}),
            ao.Equation([(("g", CORNER), "y", 2.0), ("c:end", "x", 1.0), ("hub", "rz", -0.5)]),
            *(ao.Ball(("g", tuple(_foot(k))), f"ecu:{k + 1}") for k in range(3)),
        ],
        {"b": TURNED, "ecu": SET_DOWN},
        points=POINTS,
        supports=[ao.Support("ground")],
        attached=[
            ao.PointMass("hub", 0.3, (1e-3, 2e-3, 3e-3)),
            ao.PointMass(FAR, 0.1),
            ao.Spring("c:end", {"y": 5e4}),
        ],
    )


def _foot(k: int) -> np.ndarray:
    """Where node k of the frame stands on the top of the block "g"."""
    return SET_DOWN.placed(FRAME[k : k + 1])[0]


class Dense:
    """Displacements and rotations of nodes as rows over the dofs of all parts."""

    def __init__(self, made: dict[str, ao.Structure]) -> None:
        self.size, self.parts = 0, {}
        blocks = []
        for name, part in made.items():
            R, shift = {"b": (TURNED.rotation, np.array(TURNED.shift))}.get(
                name, (np.eye(3), np.zeros(3))
            )
            if name == "ecu":
                pair = frame()
                x = FRAME @ SET_DOWN.rotation.T + SET_DOWN.shift
                R, step, names = SET_DOWN.rotation, 3, {"x": 0, "y": 1, "z": 2}
            else:
                pair = csr(part.K).toarray(), csr(part.M).toarray()
                form = part.form
                x = form.space.tabulate_dof_coordinates() @ R.T + shift
                step = form.space.dofmap.index_map_bs
                names = {key: path[0] for key, path in form.components.items()}
            self.parts[name] = self.size, x, R, step, names
            self.size += len(pair[0])
            blocks.append(pair)
        self.points = {}
        for name in POINTS:
            self.points[name] = self.size
            self.size += 6
            blocks.append((np.zeros((6, 6)), np.zeros((6, 6))))
        self.K, self.M = (scipy.linalg.block_diag(*one) for one in zip(*blocks, strict=True))
        self.held: list[np.ndarray] = []
        for name, part in made.items():
            first = self.parts[name][0]
            self.held += [np.eye(1, self.size, first + i) for i in part.fixed]

    def at(self, end: Any, x: Any = None) -> np.ndarray:
        """(6, n): displacement and rotation of a reference point, or of the node at x of a part."""
        if x is None:
            return np.eye(self.size)[self.points[end] : self.points[end] + 6]
        first, nodes, R, step, names = self.parts[end]
        node = int(np.argmin(np.linalg.norm(nodes - x, axis=1)))
        assert np.linalg.norm(nodes[node] - x) < 1e-9
        rows = np.zeros((6, self.size))
        for k, key in enumerate(("x", "y", "z", "rx", "ry", "rz")):
            if key in names:
                rows[3 * (k // 3) : 3 * (k // 3) + 3, first + step * node + names[key]] = R[
                    :, k % 3
                ]
        return rows

    def face(self, part: str, axis: int, value: float) -> np.ndarray:
        """Nodes (m, 3) of a part in a plane."""
        x = self.parts[part][1]
        return x[np.isclose(x[:, axis], value)]

    def mean(self, part: str, axis: int, value: float) -> tuple[np.ndarray, np.ndarray]:
        """(mean displacement and rotation (6, n), centroid) of a face of equal rectangles."""
        x = self.face(part, axis, value)
        across = [k for k in range(3) if k != axis]
        lines = [np.unique(x[:, k].round(9)) for k in across]
        gauss, weight = np.polynomial.legendre.leggauss(3)
        total, U, J, turned = 0.0, 0, np.zeros((3, 3)), 0
        centre = np.full(3, value)
        centre[across] = [line.mean() for line in lines]
        for i in range(len(lines[0]) - 1):
            for j in range(len(lines[1]) - 1):
                corner = np.array([[lines[0][i], lines[1][j]], [lines[0][i + 1], lines[1][j + 1]]])
                for p, wp in zip(gauss, weight, strict=True):
                    for q, wq in zip(gauss, weight, strict=True):
                        s = np.array([(1 + p) / 2, (1 + q) / 2])
                        point = np.full(3, value)
                        point[across] = corner[0] * (1 - s) + corner[1] * s
                        w = wp * wq * np.prod(corner[1] - corner[0])
                        u = 0
                        for a in (0, 1):
                            for b in (0, 1):
                                node = np.full(3, value)
                                node[across] = corner[a, 0], corner[b, 1]
                                share = (s[0] if a else 1 - s[0]) * (s[1] if b else 1 - s[1])
                                u = u + share * self.at(part, node)[:3]
                        r = point - centre
                        total, U = total + w, U + w * u
                        turned = turned + w * cross(r) @ u
                        J += w * (r @ r * np.eye(3) - np.outer(r, r))
        return np.vstack([U / total, np.linalg.solve(J, turned)]), centre


def cross(r: np.ndarray) -> np.ndarray:
    """The matrix of r × …"""
    return np.cross(r, np.eye(3)).T


def carried(six: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """The motion of a point at the end of a rigid arm."""
    return np.vstack([six[:3] - cross(arm) @ six[3:], six[3:]])


def beam(ends: list[np.ndarray], line: np.ndarray) -> np.ndarray:
    """Stiffness of a round Timoshenko beam from the compliance of its clamped-free half."""
    L, section = np.linalg.norm(line), BOLT.section
    EI, GJ = E * section.I, BOLT.G * section.torsion
    shear = L / (BOLT.G * section.A * section.shear)
    F = np.diag([L / (E * section.A), *2 * [L**3 / (3 * EI) + shear], L / GJ, L / EI, L / EI])
    F[1, 5] = F[5, 1] = L**2 / (2 * EI)
    F[2, 4] = F[4, 2] = -(L**2) / (2 * EI)
    first = line / L
    second = np.cross(first, [0.3, 0.8, 0.1])
    second /= np.linalg.norm(second)
    R = np.vstack([first, second, np.cross(first, second)])
    strain = scipy.linalg.block_diag(R, R) @ (ends[1] - carried(ends[0], line))
    return strain.T @ np.linalg.solve(F, strain)


def dense(made: dict[str, ao.Structure]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K, M and the load of the site on an orthonormal basis of all motions that are allowed."""
    d = Dense(made)
    hub, foot, ground = (d.at(name) for name in POINTS)
    rows = [*d.held, ground]
    # the finer side of the tie follows: at its nodes the bilinear function of the other side
    for x in d.face("b", 0, 0.2):
        u = 0
        for y in (0.0, 0.1):
            for z in (0.0, 0.1):
                share = abs(0.1 - abs(x[1] - y)) * abs(0.1 - abs(x[2] - z)) / 0.01
                u = u + share * d.at("a", (0.2, y, z))[:3]
        rows.append(d.at("b", x)[:3] - u)
    rows += [d.at("b", x)[:3] - carried(hub, x - np.array(HUB))[:3] for x in d.face("b", 0, 0.3)]
    top, knee = (0.35, 0.05, 0.25), (0.55, 0.05, 0.25)
    rows.append(d.at("c", HUB) - hub)
    apart = d.at("d", top) - d.at("c", top)
    across = scipy.linalg.null_space(np.array([AXIS]))
    rows += [apart[:3], across.T @ apart[3:]]
    rows.append((d.at("f", knee) - d.at("d", knee))[:3])
    rows.append((d.at("f", FOOT) - foot)[[0, 1, 3, 4, 5]])
    mean, centre = d.mean("g", 2, 0.0)
    rows.append(foot - carried(mean, np.array(FOOT) - centre))
    corner = d.at("g", CORNER)
    rows.append(2.0 * corner[1:2] + d.at("c", top)[:1] - 0.5 * hub[5:6])
    for k in range(3):
        rows.append(d.at("ecu", _foot(k))[:3] - above(d, _foot(k)))
    K, M = d.K, d.M
    K[np.ix_(*2 * [[int(np.argmax(h)) for h in d.held]])] = 0.0  # 1 on the diagonal
    moved = d.at("f", knee) - carried(ground, np.array(knee) - np.array(GROUND))
    K = K + moved.T @ np.diag(list(SPRINGS.values())) @ moved
    ends = [d.mean("a", 2, 0.0), d.mean("g", 0, 0.5)]
    K = K + beam([one for one, _ in ends], ends[1][1] - ends[0][1])
    strut = np.array(CORNER) - np.array(FAR)
    strut /= np.linalg.norm(strut)
    stretch = strut @ (corner - d.at("a", FAR))[:3]
    K = K + 7e5 * np.outer(stretch, stretch) + 5e4 * np.outer(d.at("c", top)[1], d.at("c", top)[1])
    M = M + hub.T @ np.diag([0.3, 0.3, 0.3, 1e-3, 2e-3, 3e-3]) @ hub
    M = M + 0.1 * d.at("a", FAR)[:3].T @ d.at("a", FAR)[:3]
    N = scipy.linalg.null_space(np.vstack(rows), rcond=1e-11)
    direction = np.array(SITE.direction) / np.linalg.norm(SITE.direction)
    b = direction @ d.at("d", SITE.point)[:3]
    return N.T @ K @ N, N.T @ M @ N, N.T @ b


def above(d: Dense, x: np.ndarray) -> np.ndarray:
    """Displacement (3, n) of the top of the block "g" at x, inside a rectangle of four nodes."""
    u = 0
    for node in d.face("g", 2, 0.0):
        share = np.prod([max(0.0, 1 - abs(x[k] - node[k]) / 0.05) for k in (0, 1)])
        if share > 0:
            u = u + share * d.at("g", node)[:3]
    return u
