"""Axisymmetric meshes of Abaqus and CalculiX decks, revolved about y into solids.

The radius is x and the axis is y. Sector k of the solids lies between the angles 2πk/n and
2π(k + 1)/n; the nodes and elements of the file are those at angle 0 and in sector 0. The arcs have
middle nodes, so that the surface is curved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.io.deck import Block, Deck, IntArray
from antiosc.io.neutral import EDGES
from antiosc_decks.abaqus_assembly import Whole
from antiosc_decks.abaqus_cards import OTHER
from antiosc_decks.abaqus_joints import READERS
from antiosc_decks.abaqus_mesh import NONE
from antiosc_decks.builder import ModelBuilder
from antiosc_decks.coarser import CoarsePlane, Plane

#: Number of sectors by the largest number of plane elements. A ring on 16 sectors had its first six
#: frequencies within 1e-3 of a fine mesh of tetrahedra; 1500 elements on the axis became 585 000
#: dofs in 35 s. The area of a circle on 8 sectors is 8e-4 too small.
SECTORS = ((1500, 16), (3000, 8))
#: A plane mesh of more elements is made coarser: number of solids, sectors, and length of a solid
#: around the axis over that in the plane, at the middle radius.
SOLIDS_OF_COARSE, COARSE_SECTORS, AROUND_OVER_PLANE = 20_000, (16, 64), 4.0
#: Solids of the coarse mesh over that number, beyond which it is refused.
MOST_OVER = 1.5
#: Radii below this share of the largest lie on the axis.
ON_AXIS = 1e-9
#: Plane shape -> that of a sector.
SOLIDS = {"triangle": "wedge", "quad": "hexahedron"}
#: Cards that act on single nodes or in axes, which have no counterpart on a ring.
REFUSED = (*(name for name in READERS if name != "TIE"), "TRANSFORM", "ORIENTATION")


@dataclass(frozen=True)
class Revolved:
    """An axisymmetric mesh that is revolved.

    Attributes
    ----------
    along : motions (0 to 5) that mean one along the axis: of a mesh that is drawn in x, z both y,
        as in all axisymmetric elements, and z.
    nodes_at : (nodes of the plane, angles) rows of the copies of each node.
    between : (n, 4) nodes of the file between which the last n nodes of the plane lie, of a mesh
        that is made coarser.
    """

    along: tuple[int, ...]
    nodes_at: IntArray
    between: IntArray

    def hold(self, builder: ModelBuilder) -> None:
        """Turn motions fixed along the radius and the axis into those of the revolved mesh.

        Nodes held along the radius are held around the axis too, where an axisymmetric model has no
        motion. On the axis the radial motion is zero by symmetry alone, and is not held.
        """
        coarse = self.nodes_at[len(self.nodes_at) - len(self.between) :]
        held = builder.fixed[self.between].all(axis=1)
        builder.fixed[coarse] |= held[:, None]
        radial = builder.fixed[:, 0]
        axial = builder.fixed[:, self.along].any(axis=1)
        x = builder.deck.points
        off_axis = np.hypot(x[:, 0], x[:, 2]) > ON_AXIS * np.abs(x).max()
        across = radial & off_axis
        builder.fixed = np.pad(np.stack([across, axial, across], axis=1), ((0, 0), (0, 3)))


def revolve(whole: Whole) -> Revolved | None:
    """Revolve the mesh of an axisymmetric deck, with its sets; None for other decks.

    Raises
    ------
    MeshError
        Other elements beside the axisymmetric ones, constraints, axes, and negative radii.
    """
    deck = whole.deck
    roles = {block.role for block in deck.blocks if len(block)}
    if "axisymmetric" not in roles:
        return None
    upright = _upright(deck)
    _check(whole, roles)
    count = len(deck.points)
    sectors = next((n for most, n in SECTORS if deck.n_elements <= most), 0)
    coarse = None if sectors else _coarser(whole)
    if coarse is not None:
        mesh, sectors = coarse
        deck.points = np.vstack([deck.points, np.pad(mesh.points, ((0, 0), (0, 1)))])
        missing = np.zeros((len(mesh.cells), 0), dtype=np.int64)
        corners = mesh.cells + count
        deck.blocks = [Block("quad", deck.blocks[0].type, corners, missing, missing)]
    elements = deck.n_elements
    nodes_at = _turned_nodes(deck, sectors)
    plane = deck.blocks
    deck.blocks = [_sector(block, nodes_at, k) for k in range(sectors) for block in plane]
    in_plane = _in_plane(mesh, count) if coarse is not None else None
    whole.spread(nodes_at, elements, sectors, in_plane)
    deck.remarks.append(
        f"the axisymmetric mesh of {deck.name} is revolved about y into {sectors} sectors of"
        " solids; what it holds along the radius is held around the axis too."
    )
    between = mesh.between if coarse is not None else np.zeros((0, 4), dtype=np.int64)
    return Revolved((1, 2) if upright else (1,), nodes_at, between)


def _in_plane(mesh: CoarsePlane, count: int) -> Callable[[str, IntArray], IntArray]:
    """A function that gives members of a set of the file their counterparts in a coarse mesh."""

    def members(keyword: str, rows: IntArray) -> IntArray:
        """The nodes (NSET), those of the file among them, or elements (ELSET)."""
        if keyword == "NSET":
            mask = np.zeros(count, dtype=bool)
            mask[rows] = True
            return np.concatenate([rows, count + mesh.nodes(mask)])
        return np.flatnonzero(np.isin(mesh.within, rows))

    return members


def _coarser(whole: Whole) -> tuple[CoarsePlane, int]:
    """A mesh in the plane of fewer elements, and the number of sectors for it."""
    deck = whole.deck
    if ties := whole.named("TIE"):
        raise ties[0].place.error(
            f"*TIE of {deck.n_elements} axisymmetric elements, which are more than"
            f" {SECTORS[-1][0]} and would be made coarser: join the nodes, or mesh it coarser."
        )
    plane = Plane.of(deck.blocks, deck.points, _kinds(whole), _held(whole))
    around = 2 * np.pi * plane.moment() / plane.area()
    size = (plane.area() * around / AROUND_OVER_PLANE / SOLIDS_OF_COARSE) ** (1 / 3)
    sectors = int(np.clip(round(around / AROUND_OVER_PLANE / size), *COARSE_SECTORS))
    most = SOLIDS_OF_COARSE // sectors
    mesh = plane.coarser(float(np.sqrt(plane.area() / most)), most)
    if len(mesh.cells) > MOST_OVER * most:
        raise MeshError(
            f"{deck.name} has {deck.n_elements} axisymmetric elements, which are revolved to solids"
            f" after they are made coarser; its outline needs {len(mesh.cells)} of them, and"
            f" {sectors} sectors carry {most}: leave out details of the outline."
        )
    change = 100 * (mesh.moment() / plane.moment() - 1)
    deck.remarks.append(
        f"the {deck.n_elements} axisymmetric elements of {deck.name} are made coarser before they"
        f" are revolved, {len(mesh.cells)} of them, with middle nodes; the volume changes by"
        f" {change:.2g} %."
    )
    return mesh, sectors


def _held(whole: Whole) -> BoolArray:
    """(nodes, s) the nodes that each of the distinct supports of the deck holds."""
    top = whole.instances[""]
    steps = [card.of(top) for step in whole.steps for card in step]
    held: dict[tuple[str, ...], BoolArray] = {}
    for card in [*whole.cards, *steps]:
        for row in card.rows() if card.keyword == "BOUNDARY" else ():
            nothing = np.zeros(len(whole.deck.points), dtype=bool)
            held.setdefault(tuple(row.fields[1:]), nothing)[row.nodes()] = True
    return np.array(list(held.values()), dtype=bool).reshape(len(held), len(whole.deck.points)).T


def _kinds(whole: Whole) -> IntArray:
    """Number of the section, and of the part that is wanted, of each element."""
    deck = whole.deck
    sets = [card.elements() for card in whole.named("SOLIDSECTION")]
    sets += [whole.sets.get(("ELSET", name.upper()), NONE) for name in deck.wanted or ()]
    kinds = np.zeros(deck.n_elements, dtype=np.int64)
    for rows in sets:
        members = np.zeros(len(kinds), dtype=bool)
        members[rows[rows < OTHER]] = True
        kinds = np.unique(2 * kinds + members, return_inverse=True)[1].ravel()
    return kinds


def _upright(deck: Deck) -> bool:
    """Whether the mesh is drawn in x, z, its z being the axis; it is turned into x, y then."""
    span = np.ptp(deck.points, axis=0)
    if span[1] > ON_AXIS * span.max() or not span[2]:
        return False
    deck.points = np.stack([*deck.points.T[[0, 2]], np.zeros(len(deck.points))], axis=1)
    deck.remarks.append(
        f"the axisymmetric mesh of {deck.name} is drawn in x, z: z is taken as the axis, y here."
    )
    return True


def _check(whole: Whole, roles: set[str]) -> None:
    """Raise MeshError for what cannot be revolved."""
    deck = whole.deck
    others = sorted({block.type for block in deck.blocks if block.role != "axisymmetric"})
    if others or deck.left:
        kinds = ", ".join([*others, *deck.left])
        raise MeshError(
            f"{deck.name} has {kinds} elements beside axisymmetric ones, which are revolved alone:"
            " remove them."
        )
    steps = [card for step in whole.steps for card in step]
    for card in [*whole.cards, *steps]:
        card.needs(
            card.keyword not in REFUSED,
            f"{card.label} of an axisymmetric mesh is not supported: remove it, or revolve the"
            " mesh to solids (C3D8, C3D20).",
        )
    largest = np.abs(deck.points).max()
    off_plane = np.abs(deck.points[:, 2]).max()
    if off_plane > ON_AXIS * largest:
        raise MeshError(
            f"{deck.name} has an axisymmetric node at z = {off_plane:.6g} (z or -z): radius and"
            " axis are x and y, and z must be 0."
        )
    smallest = deck.points[:, 0].min()
    if smallest < -ON_AXIS * largest:
        raise MeshError(
            f"{deck.name} has an axisymmetric node at a radius (x) of {smallest:.6g}: it must not"
            " be negative."
        )


def _turned_nodes(deck: Deck, sectors: int) -> IntArray:
    """Add the nodes of all angles to the deck; rows (nodes, 2 n) of each at angles πk/n.

    Those at odd k are middles of arcs. A node on the axis is its own copy; so is one that has none:
    of no element, or at odd k the middle of an edge.
    """
    plane = deck.points
    used = np.unique(np.concatenate([block.nodes for block in deck.blocks]))
    corners = np.unique(np.concatenate([block.corners.ravel() for block in deck.blocks]))
    off_axis = plane[:, 0] > ON_AXIS * np.abs(plane).max()
    nodes_at = np.repeat(np.arange(len(plane))[:, None], 2 * sectors, axis=1)
    points = [plane]
    count = len(plane)
    for k in range(1, 2 * sectors):
        turned = corners if k % 2 else used
        turned = turned[off_axis[turned]]
        nodes_at[turned, k] = count + np.arange(len(turned))
        count += len(turned)
        angle = np.pi * k / sectors
        radius, height = plane[turned, :2].T
        points.append(np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=1))
    deck.points = np.vstack(points)
    return nodes_at


def _sector(block: Block, nodes_at: IntArray, k: int) -> Block:
    """The solids of one sector."""
    columns = np.arange(2 * k, 2 * k + 3) % nodes_at.shape[1]
    start, middle, end = nodes_at[:, columns].T
    missing = np.full((len(block), len(EDGES[block.shape])), -1)
    in_plane = block.mids if block.mids.shape[1] else missing
    mids = [np.where(in_plane >= 0, nodes[in_plane], -1) for nodes in (start, end)]
    corners = np.hstack([start[block.corners], end[block.corners]])
    mids.append(middle[block.corners])
    return Block(
        SOLIDS[block.shape], block.type, corners, np.hstack(mids), corners[:, :0], role="solid"
    )
