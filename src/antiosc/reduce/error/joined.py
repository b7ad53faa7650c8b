"""Errors of the mesh of solids that are joined: those of the strains of each part."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import FacetGaps
from antiosc.reduce.error.patch import patch_of
from antiosc.reduce.error.scheme import Estimate, MeshErrors, shapes_of
from antiosc.reduce.error.solid import SolidErrors, refuse_one_cell
from antiosc.reduce.site import Functional


def all_solids(matrices: AssembledMatrices) -> bool:
    """Whether an assembly consists of solids alone, and bears no load at rest."""
    members = matrices.members()
    plain = not matrices.layout.condensed and matrices.preload is None
    return plain and all(member.part.kind.outside for member in members)


class JoinedSolids(MeshErrors):
    """The estimator of solids that are joined. Joints are taken as exact: they have no strains."""

    def __init__(self, matrices: AssembledMatrices) -> None:
        self._matrices = matrices
        self._parts = [SolidErrors(member.part) for member in matrices.members()]

    def prepare(self) -> None:
        for errors in self._parts:
            refuse_one_cell(errors.part)
            errors.prepare()

    def estimate(self, structure: Structure, model: AntiOscillators, site: Functional) -> Estimate:
        fields = self._matrices.fields(shapes_of(model))
        rigid = model.k0 == 0

        def work() -> list[tuple[Array, FacetGaps | None]]:
            pairs = zip(self._parts, fields, strict=True)
            return [errors.of_shapes(shapes, rigid) for errors, (_, shapes) in pairs]

        of_parts = self._matrices.decided(work)
        energies = np.sum([energy for energy, _ in of_parts], axis=0)
        gaps = self._together([gap for _, gap in of_parts])
        return Estimate(energies, facts={"patch": patch_of(structure, site), "geometry": gaps})

    def _together(self, gaps: list[FacetGaps | None]) -> FacetGaps | None:
        """The gaps of all parts, with the note of the first that has any."""
        found = [(errors.part, gap) for errors, gap in zip(self._parts, gaps, strict=True) if gap]
        if not found:
            return None
        mass = sum(part.total_mass * gap["mass"] for part, gap in found) / self._matrices.mass
        stiffness = np.sum([gap["stiffness"] for _, gap in found], axis=0).tolist()
        return {"note": found[0][1]["note"], "stiffness": stiffness, "mass": mass}
