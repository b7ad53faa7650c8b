"""What an extraction with error="estimate" adds to its models."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from antiosc._types import Array
from antiosc.errors import InputError
from antiosc.fem.error.beam_model import beam_facts
from antiosc.fem.error.estimator import NO_MESH, estimator
from antiosc.fem.error.facets import faceted
from antiosc.fem.error.gaps import mean_gaps
from antiosc.fem.error.halving import HalvedBeams
from antiosc.fem.error.lines import inside, polygon
from antiosc.fem.error.patch import patch_of
from antiosc.fem.error.shell import ShellErrors
from antiosc.fem.error.solid import refuse_locking
from antiosc.fem.site.site import Functional
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.model_info import FacetGaps


class ModelErrors:
    """The estimates of models of one structure; InputError where there are none."""

    def __init__(self, structure: Structure, named_sites: int = 0) -> None:
        if named_sites:
            raise InputError(
                "error='estimate' is for models of one site: extract each site by itself, or leave "
                "error=None."
            )
        part = on_mesh(structure, NO_MESH)
        self._structure = structure
        self._errors = HalvedBeams(part) if part.kind.name == "beam" else estimator(structure)
        self._geometry, self._layers, self._mass = "", np.zeros(0), 0.0
        self._not_included = ""
        if isinstance(self._errors, HalvedBeams):
            self._not_included = polygon(part.mesh)
        elif isinstance(self._errors, ShellErrors):
            self._not_included = self._errors.faceted
        else:
            refuse_locking(part)
            self._geometry = faceted(part.mesh)
            if self._geometry:
                self._layers, self._mass = layers(part)

    def added_to(self, model: AntiOscillators, site: Functional) -> AntiOscillators:
        """The model with its `strain_error`; `info` holds what the budget must know besides."""
        started = time.perf_counter()
        misfit = None
        info = replace(model.info, not_included=self._not_included or None)
        if isinstance(self._errors, HalvedBeams):
            E = self._errors.gram(model, site)
            assert site.point is not None  # or `gram` refuses it
            part = on_mesh(self._structure)
            info = replace(
                info, inside_element=inside(part.mesh, site.point), model=beam_facts(part, site)
            )
        elif isinstance(self._errors, ShellErrors):
            E, misfit = self._errors.gram_and_misfit(_shapes(model))
        else:
            E, outside = self._errors.gram_and_layers(_shapes(model), self._layers)
            info = replace(
                info,
                patch=patch_of(self._structure, site),
                geometry=self._gaps(outside, model.k0 == 0),
            )
        seconds = {**(info.seconds or {}), "error": time.perf_counter() - started}
        info = replace(info, seconds=seconds)
        return replace(model, strain_error=E, strain_misfit=misfit, info=info)

    def _gaps(self, outside: Array, rigid: bool) -> FacetGaps | None:
        """The energies `outside` of the layers; the first shape may be a rigid motion."""
        if not self._geometry:
            return None
        if rigid:
            outside[0] = 0.0
        return {"note": self._geometry, "stiffness": outside.tolist(), "mass": self._mass}


def _shapes(model: AntiOscillators) -> Array:
    assert model.shapes is not None  # of an extraction
    return model.shapes


def layers(part: MeshedStructure) -> tuple[Array, float]:
    """What lies between the faces of this rank and the surface that they stand for.

    (volumes (F,) [m³], in the plane areas, negative where the mesh has too much; their mass over
    that of the structure)
    """
    gap, area = mean_gaps(part.faces)
    volumes = gap * area
    heaviness = [material.rho * depth(material) for material, _ in part.parts]
    number = part.part_of_cells()[part.faces.cells]
    mass = part.comm.allreduce(float(volumes @ np.array(heaviness)[number]))
    return volumes, mass / part.total_mass


def depth(material: Any) -> float:
    """Thickness of a plane part; 1 otherwise, for volumes hold it."""
    return float(material.thickness) if getattr(material, "plane", None) else 1.0
