"""What the code says of itself: no circle of imports by file, docstrings that name what exists."""

from __future__ import annotations

import ast
import functools
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

import antiosc as ao
from antiosc import extension
from antiosc.base import lazily
from antiosc_app.scene_file import schema
from paths import ROOT

SRC = ROOT / "src"


def module(path: Path) -> str:
    parts = path.relative_to(SRC).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module(path): path for path in SRC.rglob("*.py")}
#: Module that gives names of other modules -> name -> module that defines it.
DOORS = {"antiosc": lazily.names_in_stub(str(FILES["antiosc"]))}


@functools.cache
def trees() -> dict[str, ast.Module]:
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in FILES.items()}


def imported_by(node: ast.AST) -> set[tuple[str, str]]:
    """(module, name) of what a node imports; the name is "" if it imports the module as a whole."""
    if isinstance(node, ast.ImportFrom):
        return {(str(node.module), alias.name) for alias in node.names}
    return {(alias.name, "") for alias in node.names} if isinstance(node, ast.Import) else set()


def statements(block: ast.AST) -> Iterator[ast.AST]:
    """All statements within a block; expressions, most of a tree, are left out."""
    for name in ("body", "handlers", "orelse", "finalbody", "cases"):
        for each in getattr(block, name, ()):
            yield each
            yield from statements(each)


@functools.cache
def all_imports() -> dict[str, set[tuple[str, str]]]:
    """Module -> (module, name) of its imports, within functions and for types alone too."""
    return {
        name: {found for node in statements(tree) for found in imported_by(node)}
        for name, tree in trees().items()
    }


def imports(name: str) -> set[str]:
    """Files of the packages that a file imports."""
    found = set()
    for source, imported in all_imports()[name]:
        source = DOORS.get(source, {}).get(imported, source)
        whole = f"{source}.{imported}"
        found.add(whole if whole in FILES else source)
    return found & FILES.keys()


def circles(arrows: dict[str, set[str]]) -> list[set[str]]:
    names = sorted(arrows)
    number = {name: k for k, name in enumerate(names)}
    pairs = [(number[a], number[b]) for a in names for b in arrows[a] if a != b]
    rows, columns = np.array(pairs).T
    shape = len(names), len(names)
    graph = scipy.sparse.csr_matrix((np.ones(len(pairs)), (rows, columns)), shape)
    _, label = scipy.sparse.csgraph.connected_components(graph, connection="strong")
    groups = ({names[i] for i in np.flatnonzero(label == k)} for k in np.unique(label))
    return [group for group in groups if len(group) > 1]


@pytest.mark.slow
def test_files_import_each_other_in_no_circle():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [{"a", "b", "c"}]
    found = circles({name: imports(name) for name in FILES})
    assert found == []


#: Package -> what else it imports of this distribution.
PACKAGES = {
    "antiosc": set(),
    "antiosc_decks": {"antiosc"},
    "antiosc_studies": {"antiosc"},
    "antiosc_app": {"antiosc", "antiosc_decks", "antiosc_studies"},
}


def package(name: str) -> str:
    return name.partition(".")[0]


@pytest.mark.slow
def test_packages_import_those_below_them():
    assert {package(name) for name in FILES} == PACKAGES.keys()
    arrows = {(package(name), package(to)) for name in FILES for to in imports(name)}
    assert arrows == {(a, b) for a, below in PACKAGES.items() for b in {a, *below}}


def test_readers_of_decks_need_no_finite_elements():
    """They run in processes of their own, with NumPy alone."""
    meshed = {name for name in FILES if package(name) == "antiosc" and room(name) not in READABLE}
    decks = {name for name in FILES if package(name) == "antiosc_decks"}
    arrows = {name: imports(name) for name in decks}
    with_meshes = {"antiosc_decks.from_deck", "antiosc_decks.shared_nodes"}
    assert {name for name, to in arrows.items() if to & meshed} == with_meshes
    readers = decks - with_meshes
    assert not {name for name in readers if arrows[name] & with_meshes}


#: Rooms of the core that readers of files import.
READABLE = {"base", "io"}
#: Room of the core -> rooms below it that it imports: one way from the mesh to the force.
ROOMS = {
    "base": set(),
    "engine": {"base"},
    "io": {"base"},
    "plot": {"base"},
    "models": {"base", "engine", "io", "plot"},
    "impact": {"base", "engine", "models", "plot"},
    "fem": {"base", "engine", "io", "models"},
    "recovery": {"base", "fem"},
    "reduce": {"base", "engine", "fem", "io", "models", "recovery"},
    "fields": {"base", "fem", "impact", "io", "models", "plot", "recovery", "reduce"},
    "strikes": {
        "base",
        "engine",
        "fem",
        "fields",
        "impact",
        "io",
        "models",
        "plot",
        "recovery",
        "reduce",
    },
}


def room(name: str) -> str:
    """The folder of the core that holds a module; "" for the modules that give names alone."""
    parts = name.split(".")
    folder = SRC / "antiosc" / parts[1] if len(parts) > 1 else SRC
    return folder.name if (folder / "__init__.py").is_file() else ""


@pytest.mark.slow
def test_rooms_of_the_core_import_those_below_them():
    arrows = {
        (room(name), room(to))
        for name in FILES
        for to in imports(name)
        if package(name) == package(to) == "antiosc"
    }
    assert {room(name) for name in FILES if package(name) == "antiosc"} - {""} == ROOMS.keys()
    assert {(a, b) for a, b in arrows if a and b and a != b} == {
        (a, b) for a, below in ROOMS.items() for b in below
    }


def from_other_packages() -> set[tuple[str, str, str]]:
    """(module, module that it imports from, name) of all imports from another package."""
    return {
        (name, source, imported)
        for name in FILES
        for source, imported in all_imports()[name]
        if package(source) in PACKAGES and package(source) != package(name)
    }


def is_open(source: str, name: str) -> bool:
    """Whether other packages may import a name of a module: public, listed, of an open module."""
    if source in DOORS:
        return not name or name in {*DOORS[source], "__version__", "extension"}
    if name in extension.NAMES.get(source, "").split():
        return True
    open_paths = [path for path in (source, f"{source}.{name}") if FILES.keys() & {path}]
    hidden = name.startswith("_") and name != "_types"
    return not hidden and any(
        path == module or path.startswith(f"{module}.")
        for path in open_paths
        for module in extension.MODULES
    )


@pytest.mark.slow
def test_packages_come_in_by_the_public_names_and_the_list_for_extensions():
    """`antiosc`, and the names and modules that `antiosc.extension` says are open."""
    allowed = [("antiosc", "Structure"), ("antiosc.base.checks", "positive")]
    assert all(is_open(*each) for each in allowed)
    refused = [("antiosc.base.checks", "_hidden"), ("antiosc.fem.structure.structure", "Structure")]
    assert not any(is_open(*each) for each in refused)
    imported = from_other_packages()
    assert sorted(each for each in imported if not is_open(*each[1:])) == []
    listed = {(path, name) for path, names in extension.NAMES.items() for name in names.split()}
    assert listed <= {(source, name) for _, source, name in imported}
    assert all(
        any(f"{source}.{name}".startswith(module) for _, source, name in imported)
        for module in extension.MODULES
    )


def documented(text: str | None, section: str) -> list[str]:
    """Names of the entries "a, b : …" of a section of a docstring."""
    until = r"(?=\n *\n? *\w+\n *---|\Z)"
    found = re.search(rf"^ *{section}\n *-+\n(.*?){until}", text or "", re.M | re.S)
    if found is None:
        return []
    lines = found[1].split("\n")
    indent = min((len(line) - len(line.lstrip()) for line in lines if line.strip()), default=0)
    heads = [line[indent:] for line in lines if line[indent : indent + 1].strip()]
    entries = [re.match(r"((?:\*{0,2}\w+, )*\*{0,2}\w+)(?: :.*)?$", head) for head in heads]
    return [name.lstrip("*") for one in entries if one for name in one[1].split(", ")]


def parameters(node: ast.FunctionDef) -> set[str]:
    own = node.args
    every = [*own.posonlyargs, *own.args, *own.kwonlyargs, own.vararg, own.kwarg]
    return {one.arg for one in every if one is not None}


def members(node: ast.ClassDef, classes: dict[str, ast.ClassDef]) -> set[str]:
    """Fields, methods and attributes of a class and of the bases that have its sources."""
    found = set()
    for inner in ast.walk(node):
        if isinstance(inner, ast.FunctionDef):
            found |= {inner.name} | (parameters(inner) if inner.name == "__init__" else set())
        if isinstance(inner, ast.AnnAssign | ast.Assign):
            targets = [inner.target] if isinstance(inner, ast.AnnAssign) else inner.targets
            for target in targets:
                for one in target.elts if isinstance(target, ast.Tuple) else [target]:
                    found.add(getattr(one, "id", getattr(one, "attr", "")))
    for base in node.bases:
        name = getattr(base, "id", getattr(base, "attr", ""))
        if name in classes and classes[name] is not node:
            found |= members(classes[name], classes)
    return found


def stale() -> list[str]:
    """Parameters and attributes in docstrings that do not exist."""
    classes = {
        node.name: node
        for tree in trees().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    }
    found = []
    for name, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                known, sections = parameters(node), ["Parameters"]
            elif isinstance(node, ast.ClassDef):
                known, sections = members(node, classes), ["Parameters", "Attributes"]
            else:
                continue
            text = ast.get_docstring(node)
            named = [one for section in sections for one in documented(text, section)]
            place = f"{name}:{node.lineno} {node.name}"
            found += [f"{place}: {one}" for one in named if one not in known]
    return found


@pytest.mark.slow
def test_docstrings_name_parameters_and_attributes_that_exist():
    text = "Attributes\n----------\na, b : x\n    c\n\nNotes\n-----\nd : e"
    assert documented(text, "Attributes") == ["a", "b"]
    assert stale() == []


@pytest.mark.fem
def test_groups_of_names_are_those_of_the_package():
    spaces = {name: getattr(ao, name) for name in ("errors", "joints", "laws", "results")}
    assert ao.laws.Hertz is ao.Hertz
    assert len(dir(ao)) <= 95
    for space in spaces.values():
        names = lazily.names_in_stub(str(space.__file__)).keys()
        assert names <= set(ao._MODULES)
        assert all(getattr(space, name) is getattr(ao, name) for name in names)
        with pytest.raises(AttributeError, match="'Hooke'"):
            space.Hooke  # noqa: B018
    classes = {name: one for name in ao._MODULES if inspect.isclass(one := getattr(ao, name))}
    laws = {name for name, kind in classes.items() if issubclass(kind, ao.ContactLaw)}
    assert laws <= set(dir(ao.laws))
    assert laws - {"ContactLaw"} <= set(schema.LAW_NAMES.split())
    errors = {name for name, kind in classes.items() if issubclass(kind, Exception)}
    assert errors == lazily.names_in_stub(str(ao.errors.__file__)).keys()
