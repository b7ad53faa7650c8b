"""One table of a collection of decks: read, struck, or refused, and in which words.

    make bench-decks                        those of Debian's calculix-ccx-test, if it is installed
    make bench-decks DECKS=some/folder      any other folder of .inp (also .inp.gz)

Every deck that becomes a structure is struck. Its mass is compared with ρV of the deck's elements
as an independent parser measures them (`census`), and k0 with a sparse solve by SciPy: of matrices
assembled in NumPy alone for solids (`reference`), of the assembled K for shells and beams. Decks
are worked on in a process of their own; one that dies or hangs is told. Materials without a density
get 7800. The exit status is 1 where a process died, a number is off by more than 1e-8, a deck is
taken without all its elements, or less than 95 % of the class are struck.
"""

from __future__ import annotations

import argparse
import gzip
import json
import re
import select
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import census
import numpy as np

DEBIAN = Path("/usr/share/doc/calculix-ccx-test/examples/test")
DENSITY = 7800.0
#: Seconds that one deck may take.
PATIENCE = 300.0
#: Largest difference of a mass or a stiffness from its reference.
CLOSE = 1e-8
#: Share of the class that must be struck.
LEAST = 0.95


# --- One deck, in the working process -------------------------------------------------------------


def tried(path: Path) -> dict[str, Any]:
    """What becomes of one deck."""
    import antiosc as ao

    result: dict[str, Any] = {"name": path.name}
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            ao.read_mesh(path)
            result["read"] = ""
        except ao.AntioscError as error:
            result["read"] = str(error)
        del told[:]
        for density in (None, DENSITY):
            try:
                part = ao.read_model(path, density=density)
            except ao.AntioscError as error:
                result["refused"] = str(error)
                if "no density" not in str(error):
                    return result
                continue
            result.pop("refused", None)
            result["density"] = density
            bare = not any(census.BESIDE.match(kind) for kind in census.take(path).types)
            result |= struck(part, bare)
            break
    result["told"] = [str(one.message) for one in told]
    return result


def struck(part: Any, bare: bool) -> dict[str, Any]:
    """The part struck at a corner that moves: its mass, k0 and the reference of k0.

    `bare`: no masses or springs are attached.
    """
    import antiosc as ao

    point, direction = _site(part)
    try:
        model = ao.extract(part, ao.Site(point, direction), n=min(8, part.dofs - 1))
    except ao.AntioscError as error:
        return {"refused": f"structure, but not struck: {error}"}
    found = {"mass": part.mass, "k0": model.k0, "dofs": part.dofs}
    found["reference"], found["by"] = reference_of(part, point, direction, bare)
    stiff = model.k0 or float(model.omega[0] ** 2 * model.m_st)
    impactor = ao.RigidMass(mass=model.m_st, velocity=1.0)
    duration = 10 * np.sqrt(model.m_st / stiff)
    hit = ao.simulate(model, impactor, ao.Linear(stiff), duration=duration)
    if not (hit.status == 0 and np.isfinite(hit.force).all() and hit.peak_force > 0):
        found["refused"] = f"structure, but not struck: {hit.message}"
    return found


def _site(part: Any) -> tuple[Any, Any]:
    """A vertex that nothing holds, as far from what is held as any, and a skew direction."""
    from antiosc.fem.platform import compat

    if part.matrices.assembled:
        return _free_vertex(part)
    gdim = part.mesh.gdim
    x = part.mesh.dolfinx.geometry.x[compat.vertex_nodes(part.mesh.dolfinx, 0)[:, 0]]
    held = [np.zeros((0, 3))]
    for path in part.form.components.values():
        dofs, places = compat.dof_coordinates(part.form.space, path)
        held.append(places[np.isin(dofs, part.fixed)])
    fixed = np.vstack(held)
    far = np.linalg.norm(x - x.mean(axis=0), axis=1)
    if len(fixed):
        from scipy.spatial import cKDTree

        far = cKDTree(fixed).query(x)[0]
    direction = np.array([0.36, 0.48, 0.8])[:gdim]
    return x[int(np.argmax(far))][:gdim], direction / np.linalg.norm(direction)


def _free_vertex(part: Any) -> tuple[Any, Any]:
    """The same on an assembly: a vertex of which most dofs move, far from the others' middle."""
    layout = part.matrices.layout
    gdim = 2 if layout.plane else 3
    places, fixed = [], []
    for member in layout.members.values():
        held = np.zeros((len(member.nodes), member.block), dtype=bool)
        own = part.fixed[(part.fixed >= member.first) & (part.fixed < member.first + member.size)]
        held.ravel()[own - member.first] = True
        vertices = {tuple(np.round(x, 12)) for x in member.vertices}
        for x, row in zip(member.nodes, held, strict=True):
            if tuple(np.round(x, 12)) in vertices and not row[:gdim].all():
                places.append(x[:gdim])
                fixed.append(row[:gdim])
    x, held = np.array(places), np.array(fixed)
    far = np.linalg.norm(x - x.mean(axis=0), axis=1)
    best = np.lexsort((-far, held.sum(axis=1)))[0]
    direction = np.where(held[best], 0.0, np.array([0.36, 0.48, 0.8])[:gdim])
    return x[best], direction / np.linalg.norm(direction)


def reference_of(part: Any, point: Any, direction: Any, bare: bool) -> tuple[float, str]:
    """1/(bᵀK⁻¹b) by SciPy's sparse LU, 0 where the body is free to move; and whose K it is.

    `bare`: no springs are attached.
    """
    import scipy.sparse as sp
    from scipy.sparse.linalg import splu

    from antiosc.reduce.site import functional
    from antiosc.reduce.site.site import Site

    b = functional(part, Site(point, direction)).b
    if part.rigid_modes.size and np.abs(part.rigid_modes.T @ b).max() > 1e-9:
        return 0.0, "free"
    solid = not part.matrices.assembled and part.kind.name == "solid"
    solid = solid and all(hasattr(material, "nu") for material, _ in part.parts)  # isotropic
    if solid and bare and not part.rigid_modes.size:
        return _by_numpy(part, point, direction), "NumPy's K"
    rows, columns, values = part.K.getValuesCSR()
    K = sp.csr_matrix((values, columns, rows)).tocsc()
    if part.rigid_modes.size:  # it slides across the blow: held there by its own rigid motions
        R = sp.csc_matrix(part.rigid_modes)
        K = sp.bmat([[K, R], [R.T, None]]).tocsc()
        b = np.append(b, np.zeros(R.shape[1]))
    return float(1 / (b @ refined(K, splu(K), b))), "assembled K"


def refined(K: Any, lu: Any, b: Any) -> Any:
    """K⁻¹b, with residuals in extended precision."""
    y = lu.solve(b).astype(np.longdouble)
    long = K.astype(np.longdouble).tocsr()
    for _ in range(6):
        y += lu.solve(np.asarray(b - long @ y, dtype=float))
    return np.asarray(y, dtype=float)


def _by_numpy(part: Any, point: Any, direction: Any) -> float:
    import reference
    from scipy.sparse.linalg import splu
    from scipy.spatial import cKDTree

    from antiosc.fem.platform import compat

    mesh, dim = part.mesh, part.mesh.gdim
    nodes = compat.geometry_nodes(mesh.dolfinx)
    x = mesh.dolfinx.geometry.x[nodes][:, :, :dim]
    corners = nodes[:, : {"triangle": 3, "tetrahedron": 4}.get(mesh.cell, 2**dim)]
    moduli = np.zeros((len(x), 2))
    for material, cells in part.parts:
        mu = material.E / (2 * (1 + material.nu))
        lam = 2 * mu * material.nu / (1 - (1 if material.plane == "stress" else 2) * material.nu)
        depth = material.thickness if dim == 2 else 1.0
        moduli[cells] = lam * depth, mu * depth
    K, places = reference.stiffness(mesh.cell, x, corners, mesh.order, moduli)
    tree = cKDTree(places)
    free = np.ones((len(places), dim), dtype=bool)
    for name, path in part.form.components.items():
        dofs, at = compat.dof_coordinates(part.form.space, path)
        held = at[np.isin(dofs, part.fixed)][:, :dim]
        if len(held):
            free[tree.query(held)[1], "xyz".index(name)] = False
    b = np.zeros((len(places), dim))
    b[tree.query(point)[1]] = direction
    keep = np.flatnonzero(free.ravel())
    own = K[keep][:, keep].tocsc()
    lu = splu(own.astype(float))
    return float(1 / (b.ravel()[keep] @ refined(own, lu, b.ravel()[keep])))


# --- All decks ------------------------------------------------------------------------------------


def results(paths: list[Path]) -> Iterator[dict[str, Any]]:
    """What becomes of each deck; a process that dies or hangs is one of the results."""
    process = None
    for path in paths:
        if process is None:
            command = [sys.executable, __file__, "--work"]
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(f"{path}\n".encode())
        process.stdin.flush()
        ready = select.select([process.stdout], [], [], PATIENCE)[0]
        line = process.stdout.readline() if ready else b""
        if line:
            yield json.loads(line)
            continue
        if not ready:
            process.kill()
        process.communicate()
        code, process = process.returncode, None
        yield {"name": path.name, "died": f"exit {code}" if ready else f"over {PATIENCE:g} s"}
    if process is not None:
        process.communicate()


def work() -> None:
    """Answer each path on standard input by a line of JSON."""
    import os

    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is no answer
    for line in sys.stdin:
        path = Path(line.rstrip("\n"))
        try:
            result = tried(path)
        except Exception as error:
            result = {"name": path.name, "died": f"{type(error).__name__}: {error}"}
        answers.write(json.dumps(result) + "\n")
        answers.flush()


def counted(deck: census.Census, result: dict[str, Any]) -> str:
    """What a structure lacks of its deck's elements, as the warning and the mass tell; "" if none.

    The mass of every body is in that of the structure; masses and springs are in its matrices; all
    others must be told by number.
    """
    known = (census.MODELLED, census.BESIDE)
    lost = sum(n for kind, n in deck.types.items() if not any(p.match(kind) for p in known))
    told = re.search(r"holds (\d+) elements; (\d+) of them", " ".join(result["told"]))
    left = int(told[1]) - int(told[2]) if told else 0
    return f"{lost} elements are no part of it, {left} are told" if left != lost else ""


def summary(folder: Path) -> tuple[str, bool]:
    """(the table, whether all is as it must be)."""
    paths = sorted(folder.glob("*.inp"))
    read = made = struck_as_it_is = struck_with_density = 0
    in_class, class_struck = [], 0
    refusals: dict[str, list[str]] = defaultdict(list)
    faults: list[str] = []
    worst = {"mass": (0.0, ""), "k0": (0.0, "")}
    kinds: dict[str, int] = defaultdict(int)
    unmeasured = []
    for path, result in zip(paths, results(paths), strict=True):
        deck, name = census.take(path), path.name
        outside = deck.outside()
        if "died" in result:
            faults.append(f"{name}: {result['died']}")
            continue
        read += not result["read"]
        if not outside:
            in_class.append(name)
        if "refused" in result:
            made += "mass" in result
            refusals[sentence(result["refused"], name)].append(f"{name} ({outside or 'class'})")
            continue
        made += 1
        struck_as_it_is += result["density"] is None
        struck_with_density += result["density"] is not None
        class_struck += not outside
        kinds[result["by"]] += 1
        mass = deck.mass(result["density"])
        if mass is None:
            unmeasured.append(name)
        pairs = {"mass": (result["mass"], mass), "k0": (result["k0"], result["reference"])}
        for what, (value, wanted) in pairs.items():
            if wanted is None:
                continue
            off = abs(value - wanted) / abs(wanted) if wanted else abs(value)
            worst[what] = max(worst[what], (off, name))
            if not off <= CLOSE:
                faults.append(f"{name}: {what} {value:.12g}, reference {wanted:.12g} ({off:.1e})")
        if lacking := counted(deck, result):
            faults.append(f"{name}: {lacking}")
    share = class_struck / max(len(in_class), 1)
    struck_count = struck_as_it_is + struck_with_density
    lines = [
        f"{len(paths)} decks: {read} read as meshes, {made} are structures, {struck_count} struck "
        f"({struck_as_it_is} as they are, {struck_with_density} with density={DENSITY:g})",
        f"class (linear elastic solids, shells, beams): {class_struck} of {len(in_class)} struck, "
        f"{100 * share:.1f} %",
        "references of k0: " + ", ".join(f"{n} by {by}" for by, n in sorted(kinds.items())),
        *(f"largest difference of {what}: {off:.1e} ({n})" for what, (off, n) in worst.items()),
        f"mass not measured here (layers, several sections): {', '.join(unmeasured) or 'none'}",
        "",
        f"{sum(map(len, refusals.values()))} refused:",
    ]
    for text, names in sorted(refusals.items(), key=lambda one: -len(one[1])):
        lines += [f"{len(names):4d}  {text}", f"      {', '.join(names)}"]
    lines += ["", f"{len(faults)} faults", *faults]
    return "\n".join(lines), not faults and share >= LEAST


def sentence(text: str, name: str) -> str:
    """A refusal without what differs from deck to deck."""
    text = re.sub(r"line \d+ of \S+?(?=[:);, ]|$)", "line …", text).replace(name, "the deck")
    text = re.sub(r"(?<![A-Za-z\d])-?\d[\d.]*(e[+-]?\d+)?(?![A-Za-z\d])", "#", text)
    return re.sub(r"'[^']*'", "'…'", text)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=DEBIAN)
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        work()
        return 0
    if not given.folder.is_dir():
        print(f"no folder {given.folder}: sudo apt install calculix-ccx-test, or DECKS=folder")
        return 1
    with tempfile.TemporaryDirectory() as folder:
        for path in given.folder.iterdir():
            if path.name.endswith(".inp.gz"):
                Path(folder, path.stem).write_bytes(gzip.decompress(path.read_bytes()))
            elif path.is_file():
                shutil.copy(path, folder)
        text, good = summary(Path(folder))
    print(text)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
