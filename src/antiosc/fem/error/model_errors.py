"""What an extraction with error="estimate" adds to its models."""

from __future__ import annotations

import time
from dataclasses import replace

from antiosc.errors import InputError
from antiosc.fem.error.estimator import estimator
from antiosc.fem.error.facets import faceted
from antiosc.fem.error.patch import patch_of
from antiosc.fem.site.site import Functional
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.models.anti_oscillators import AntiOscillators


class ModelErrors:
    """The estimates of models of one structure; InputError where there are none."""

    def __init__(self, structure: Structure, named_sites: int = 0) -> None:
        if named_sites:
            raise InputError(
                "error='estimate' is for models of one site: extract each site by itself, or leave "
                "error=None."
            )
        self._structure, self._errors = structure, estimator(structure)
        self._geometry = faceted(on_mesh(structure).mesh)

    def added_to(self, model: AntiOscillators, site: Functional) -> AntiOscillators:
        """The model, with its shapes, and its `strain_error`; `info` holds patch and geometry."""
        started = time.perf_counter()
        assert model.shapes is not None
        model = replace(model, strain_error=self._errors.gram(model.shapes))
        model.info["patch"] = patch_of(self._structure, site)
        if self._geometry:
            model.info["geometry"] = self._geometry
        model.info["seconds"]["error"] = time.perf_counter() - started
        return model
