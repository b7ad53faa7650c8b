"""The common base of all estimators of mesh errors: solids, sheets and beams."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.reduce.site import Functional


@dataclass(frozen=True)
class Estimate:
    """Errors of the mesh in a model of one site.

    Attributes
    ----------
    energies : (N + 1, N + 1) energies and products of the errors of its shapes, `strain_error`.
    misfit : `strain_misfit` of sheets.
    facts : further fields of `ModelInfo` for the budget.
    """

    energies: Array
    misfit: Array | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)


class MeshErrors(ABC):
    """Estimator of the errors of the meshes of a structure.

    Attributes
    ----------
    not_included : a sentence on errors that no estimate includes; "" if there are none.
    """

    not_included: str = ""

    @abstractmethod
    def prepare(self) -> None:
        """Compute the data that all models share; InputError for a mesh whose errors cannot be
        estimated.
        """

    @abstractmethod
    def estimate(self, structure: Structure, model: AntiOscillators, site: Functional) -> Estimate:
        """The estimate for a model of the structure at a site."""


class PartErrors(MeshErrors):
    """Estimator of the errors of the mesh of a part."""

    def __init__(self, part: MeshedStructure) -> None:
        self.part = part


class StrainErrors(PartErrors):
    """Base of estimators that compare the strains of shapes with recovered strains."""

    @abstractmethod
    def gram(self, shapes: Array) -> Array:
        """Energies E_ij = ∫ e_i:C:e_j (k, k) of the strain errors e of shapes (rows, k)."""

    @abstractmethod
    def of_cells(self, shapes: Array) -> Array:
        """Energy Σ_j ∫ e_j:C:e_j of the strain errors in each cell that this rank owns:
        (cells,).
        """

    def of_state(self, structure: Structure, shapes: Array, energies: Array) -> Array:
        """Estimated change (k, k) of the energies of shapes by the error of a prestress.

        The loads add ∫ N : η(ψ, ψ) to the stiffness, a functional of the state q. Its error is the
        product of the errors in energy of q and of its dual solution (Becker and Rannacher, Acta
        Numerica 10 (2001) 1). The relative error of the latter is assumed to be the larger of those
        of q and of the shape.
        """
        preload = structure.matrices.preload
        if preload is None or not preload.q.any():
            return np.zeros_like(energies)
        comm = structure.comm
        q = preload.q[:, None]
        part = on_mesh(structure).unloaded
        assert part is not None  # of a prestress
        stiffness = dot(comm, shapes, multiply(part.K, shapes))
        loads_stiffness = dot(comm, shapes, multiply(structure.K, shapes)) - stiffness
        relative_error = float(self.gram(q)[0, 0]) / float(dot(comm, q, multiply(part.K, q))[0, 0])
        tiny = np.finfo(float).tiny
        ratios = np.diag(energies) / np.maximum(np.diag(stiffness), tiny)
        share = (relative_error * np.clip(ratios, relative_error, 1.0)) ** 0.25
        values, vectors = np.linalg.eigh((loads_stiffness + loads_stiffness.T) / 2)
        return np.asarray(share[:, None] * ((vectors * np.abs(values)) @ vectors.T) * share)


def shapes_of(model: AntiOscillators) -> Array:
    """The shapes of an extraction."""
    assert model.shapes is not None
    return model.shapes


def loads_of_shapes(
    structure: Structure | MeshedStructure, model: AntiOscillators, motions: Array, load: Array
) -> Array:
    """Loads (rows, N + 1) of the shapes psi_0 … psi_N: the site's, and the inertia forces ω² M ψ
    with their reaction at the site.

    motions : (rows, N + 1) the shapes on the mesh of `structure`; load : (rows, 1) b of the site.
    """
    masses = np.append(0.0, model.m)
    squares = np.append(0.0, np.square(model.omega))
    forces = squares * (multiply(structure.M, motions) - masses * load)
    forces[:, :1] = model.k0 * load
    return np.asarray(forces)
