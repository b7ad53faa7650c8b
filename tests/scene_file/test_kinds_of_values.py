"""What annotations hold, and which classes the sections have."""

from __future__ import annotations

import inspect
from types import SimpleNamespace

import pytest
from numpy.typing import ArrayLike

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.app.scene_file.schema import FAMILIES, IMPACTORS, JOINTS, LAWS, kinds_of


def test_a_name_for_a_type_holds_what_the_type_holds():
    """From NumPy 2.4 ArrayLike is such a name, of which nothing but its value tells the type."""
    for annotation in (float, list[int], ArrayLike):
        assert kinds_of(SimpleNamespace(__value__=annotation)) == kinds_of(annotation) != ()


#: Bodies that are no impactors.
BODIES = (ao.AntiOscillators, ao.LinearBody, ao.SoilCone)


def test_every_public_class_of_a_section_is_in_its_list():
    """A new material, law, impactor or joint, and each constructor of a law or an impactor."""
    public = [getattr(ao, name) for name in ao.__all__ if inspect.isclass(getattr(ao, name))]
    public = [kind for kind in public if not inspect.isabstract(kind)]
    laws = [kind for kind in public if issubclass(kind, ao.ContactLaw)]
    impactors = [kind for kind in public if callable(getattr(kind, "modal", None))]
    impactors = [kind for kind in impactors if kind not in BODIES]

    def constructors(kind: type) -> list[str]:
        names = inspect.getmembers(kind, inspect.ismethod)
        own = [n for n, method in names if method.__annotations__["return"] == kind.__name__]
        return [kind.__name__, *(f"{kind.__name__}.{n}" for n in own)]

    found = {
        FAMILIES: [kind.__name__ for kind in public if hasattr(kind, "weak_form")],
        JOINTS: [kind.__name__ for kind in public if hasattr(kind, "constraints")],
        LAWS: [name for kind in laws for name in constructors(kind)],
        IMPACTORS: [name for kind in impactors for name in constructors(kind)],
    }
    for names, kinds in found.items():
        assert set(kinds) == set(names.split()) - {"named_impactor"}
