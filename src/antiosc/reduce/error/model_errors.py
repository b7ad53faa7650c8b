"""The error estimates that an extraction with error="estimate" adds to its models."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from antiosc.base.errors import InputError
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.parameters import JOINTED
from antiosc.reduce.error.beam import HalvedBeams
from antiosc.reduce.error.divided import DividedDeck, DividedShells, divides, too_large
from antiosc.reduce.error.joined import JoinedSolids, all_solids
from antiosc.reduce.error.scheme import MeshErrors, StrainErrors
from antiosc.reduce.error.shell import ShellErrors
from antiosc.reduce.error.shell_facts import shell_facts
from antiosc.reduce.error.solid import SolidErrors, refuse_one_cell
from antiosc.reduce.site import Functional

if TYPE_CHECKING:
    from antiosc.fem.assembly.assembled import AssembledMatrices

#: Message for matrices.
NO_MESH = "the error of a mesh needs the mesh: given matrices have none."
#: Element family -> reason why a recovery of strains does not show its errors.
WHY = {
    "beam": ("which are compared with a finer mesh: compare two element sizes"),
    "truss": "whose nodes are hinges, so that no mesh could be finer",
}


def estimator(structure: Structure) -> StrainErrors:
    """The estimator for the structure's element family; InputError if there is none."""
    return _part_estimator(on_mesh(structure, NO_MESH))


def _part_estimator(matrices: MeshedStructure) -> StrainErrors:
    """The estimator for a part."""
    if matrices.kind.name in WHY:
        raise InputError(_refused(matrices))
    refuse_one_cell(matrices)
    if matrices.kind.sheet:
        return ShellErrors(matrices)
    return SolidErrors(matrices)


def _of_structure(structure: Structure) -> MeshErrors:
    """The estimator for the models of a structure."""
    if structure.matrices.assembled:
        matrices = cast("AssembledMatrices", structure.matrices)
        return JoinedSolids(matrices) if all_solids(matrices) else DividedDeck(matrices)
    part = on_mesh(structure, NO_MESH)
    if part.kind.name == "beam":
        return HalvedBeams(part)
    if divides(part):
        return DividedShells(part)
    return _part_estimator(part)


def refusal(structure: Structure) -> str:
    """Why the mesh's error of a structure is not estimated; "" if it is."""
    if reason := _refusal(structure):
        return reason
    return _skipped(structure)


def _refusal(structure: Structure) -> str:
    """Why an assembly or trusses have no estimator; "" for others."""
    if structure.matrices.assembled:
        matrices = cast("AssembledMatrices", structure.matrices)
        halved = matrices.halved is not None and matrices.preload is None
        return "" if halved or all_solids(matrices) else JOINTED
    if not structure.matrices.meshed:
        return ""
    part = on_mesh(structure, NO_MESH)
    return _refused(part) if part.kind.name == "truss" else ""


def _skipped(structure: Structure) -> str:
    """Why a mesh is too large for its estimator; "" if it is not."""
    if structure.matrices.assembled:
        solids = all_solids(cast("AssembledMatrices", structure.matrices))
        return "" if solids else too_large(structure.size, "the deck")
    if not structure.matrices.meshed:
        return ""
    part = on_mesh(structure)
    if divides(part):
        return too_large(part.rows, part.mesh.name)
    return ""


def _refused(part: MeshedStructure) -> str:
    """Why a recovery of strains does not show the errors of a family."""
    name = part.kind.name
    return (
        f"the error 'estimate' holds for solids, beams and shells; {part.mesh.name} is made of"
        f" {name} elements, {WHY[name]}."
    )


def _struck(structure: Structure, site: Functional) -> MeshedStructure:
    """The part of a structure that is struck."""
    if not structure.matrices.assembled:
        return on_mesh(structure, NO_MESH)
    (member,) = cast("AssembledMatrices", structure.matrices).members(site.part)
    return member.part


class ModelErrors:
    """The mesh-error estimators for the models of one structure; InputError for a family without
    one.

    Attributes
    ----------
    skipped : why the models of an assembly, or of a mesh that is too large for its estimator, get
        no estimate, and their bars tell it; "" if they get one.
    """

    def __init__(self, structure: Structure, named_sites: int = 0) -> None:
        if named_sites:
            raise InputError(
                "the error 'estimate' is for models of one site: extract each site by itself."
            )
        reason = _refusal(structure)
        if reason and not structure.matrices.assembled:
            raise InputError(reason)
        self.skipped = reason or _skipped(structure)
        self._structure = structure
        if not self.skipped:
            self._errors = _of_structure(structure)
            self._errors.prepare()

    def added_to(self, model: AntiOscillators, site: Functional) -> AntiOscillators:
        """The model with its `strain_error`, and with the data of the error budget in `info`."""
        if self.skipped:
            return replace(model, info=replace(model.info, no_estimate=self.skipped))
        start_time = time.perf_counter()
        estimate = self._errors.estimate(self._structure, model, site)
        facts = dict(estimate.facts)
        part = _struck(self._structure, site)
        if part.kind.sheet:
            facts["model"] = shell_facts(part, site)
        seconds = {**(model.info.seconds or {}), "error": time.perf_counter() - start_time}
        not_included = self._errors.not_included or None
        facts |= {"no_estimate": None, "not_included": not_included, "seconds": seconds}
        info = replace(model.info, **facts)
        return replace(
            model, strain_error=estimate.energies, strain_misfit=estimate.misfit, info=info
        )
