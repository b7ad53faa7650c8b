"""What the pages take from the code: the lists of the API, the pages of the demos."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import light

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
#: a line of an API page: the public names of these packages and modules stand in its place
LISTED = re.compile(r"^%API(?P<modules>.*)$", re.MULTILINE)
#: folder of scripts -> script -> pictures that the repository keeps of it; demos in their order
PICTURES = {
    "demos": {
        "impact_on_bracket": ["bracket.png", "bracket_force.png"],
        "moving_model": ["moving_model.gif"],
        "drop": ["drop.png"],
        "drop_chance": ["drop_chance.png"],
        "composite_panel": ["composite_panel_part.png", "composite_panel.png"],
        "measured_part": ["measured_part.png"],
        "tip_damper": ["tip_damper.png"],
        "board_on_spacers": ["board_on_spacers_part.png", "board_on_spacers.png"],
        "find_blow": ["find_blow.png"],
        "impact_map": ["bracket_map.png"],
        "machine_guard": ["machine_guard_part.png", "machine_guard.png"],
        "guard_thickness": ["guard_thickness.png"],
        "robot_contact": ["robot_contact.png"],
        "oblique_blow": ["oblique_blow_part.png", "oblique_blow.png"],
        "roof_hail": ["roof_hail.png"],
        "flow": ["flow.png"],
    },
    "benchmarks": {
        "speed_chart": ["speed_chart.png"],
        "speed_accuracy": ["../speed/speed_accuracy_bracket_43935.png"],
        "stability": ["stability.png", "stability_rod.png", "stability_windows.png"],
        "stiffened_panel": ["stiffened_panel.png"],
        "strike_or_uniform": ["../speed/strike_or_uniform.png"],
        "work_precision": ["work_precision.png", "work_precision_contacts.png"],
    },
}
#: page -> words that people look for, which its text does not have, or has among many others
WORDS = {
    "api/structures": ("node id", "node number", "bolt", "screw"),
    "api/models": ("npz", "save a model", "load a model"),
    "api/simulation": ("golf ball", "tennis ball", "hail", "IK08 hammer", "headform", "pendulum"),
    "concepts": ("units", "SI units", "when not to use"),
    "howto/contacts": ("earthquake", "shaker", "random vibration", "several contacts"),
    "howto/deck": (
        "node ids of a deck",
        "inp",
        "bdf",
        "Ansys",
        "Abaqus",
        "Nastran",
        "inch",
        "tonne",
    ),
    "howto/open": ("GUI", "STEP", "STL", "CAD", "without programming"),
    "howto/parts": ("dashpot", "soil", "buckling", "membrane forces", "spin"),
    "howto/report": ("FMU", "Simulink", "Modelica", "Matlab"),
    "howto/stress": ("safety factor", "yield", "srs", "shock response spectrum", "ParaView", "vtu"),
    "howto/studies": ("Monte Carlo", "uncertainty", "optimization"),
    "install": ("pip", "conda", "docker"),
    "speed": ("benchmark", "time step", "stability", "MPI", "slurm", "parallel"),
    "theory": (
        "model reduction",
        "Craig-Bampton",
        "coefficient of restitution",
        "dent",
        "plasticity",
    ),
    "tutorials/drop": ("drop test", "free fall", "tumble"),
    "tutorials/measured": ("impact hammer", "modal test", "uff"),
}
#: the scene whose report stands in the pages
REPORTED = ROOT / "demos/scenes/step.toml"
LIVE_REPORT = ROOT / "out/live_report.html"


def public_names() -> dict[str, str]:
    """Public name -> module, in the order of the stub of the package."""
    from antiosc.base import lazily

    return lazily.names_in_stub(str(ROOT / "src/antiosc/__init__.py"))


def api(modules: list[str]) -> list[str]:
    """Public names of packages and modules, or single ones of a module, without "antiosc."."""
    whole = [each if each.startswith("antiosc_") else f"antiosc.{each}" for each in modules]
    wanted = tuple(f"{module}." for module in whole)
    return [
        name for name, module in public_names().items() if f"{module}.{name}.".startswith(wanted)
    ]


def with_lists(text: str, elsewhere: list[str]) -> str:
    """A page with its %API lines replaced; `%API rest` stands for the names of no other page."""

    def listed(found: re.Match[str]) -> str:
        modules = found["modules"].split()
        names = api(modules)
        if modules == ["rest"]:
            taken = {name for page in elsewhere for name in api(listed_modules(page))}
            names = [name for name in public_names() if name not in taken]
        if not names:
            return ""
        lines = ["```{eval-rst}", ".. currentmodule:: antiosc", ""]
        for name in names:
            kind = "autofunction" if name[0].islower() else "autoclass"
            members = ["   :members:", "   :inherited-members: Exception, ImportError, dict, tuple"]
            lines += [f".. {kind}:: {name}", *(members if kind == "autoclass" else ()), ""]
        return "\n".join([*lines, "```"])

    return LISTED.sub(listed, text.replace("%EXTENSION", extension_tables()))


def extension_tables() -> str:
    """The names and modules that `antiosc.extension` says are open."""
    from antiosc import extension

    rows = ["| of the module | names |", "|---|---|"]
    rows += [f"| `{path}` | {coded(names.split())} |" for path, names in extension.NAMES.items()]
    rows += ["", "| modules | |", "|---|---|"]
    rows += [f"| `{module}` | {purpose} |" for module, purpose in extension.MODULES.items()]
    return "\n".join(rows)


def listed_modules(text: str) -> list[str]:
    """Modules that the %API lines of a page name."""
    return [m for found in LISTED.finditer(text) for m in found["modules"].split() if m != "rest"]


def api_pages() -> list[str]:
    """Texts of all API pages."""
    return [path.read_text(encoding="utf-8") for path in sorted((HERE / "api").glob("*.md"))]


def with_names(index: str) -> str:
    """The index of the API with its table of all names, by page."""
    order = re.findall(r"^(\w+)$", index.partition("toctree}")[2].partition("```")[0], re.MULTILINE)
    texts = {page: (HERE / f"api/{page}.md").read_text(encoding="utf-8") for page in order}
    own = {page: api(listed_modules(text)) for page, text in texts.items()}
    listed = {name for names in own.values() for name in names}
    rest = next(page for page, text in texts.items() if "%API rest" in text)
    own[rest] = [*own[rest], *(name for name in public_names() if name not in listed)]
    titles = {page: f"[{titled(text)}]({page}.md)" for page, text in texts.items()}
    rows = [f"| {titles[page]} | {coded(names)} |" for page, names in own.items() if names]
    return "\n".join([index.split("| page |")[0] + "| page | |", "|---|---|", *rows, ""])


def titled(text: str) -> str:
    """The title of a page."""
    return text.partition("\n")[0].strip("# ")


def coded(names: list[str]) -> str:
    """Names as code."""
    return ", ".join(f"`{name}`" for name in names)


def with_other_pages(index: str) -> str:
    """The index with %PAGES replaced by the pages of this folder that it does not list yet."""
    listed = set(re.findall(r"^[\w/]+$", index, re.MULTILINE))
    pages = [path.stem for path in sorted(HERE.glob("*.md"))]
    others = [page for page in pages if page not in listed and page != "index"]
    return index.replace("%PAGES", "\n".join(others))


def with_words(page: str, text: str) -> str:
    """A page with the words by which it is also looked for, as entries of the index."""
    words = WORDS.get(page, ())
    entries = [f"```{{index}} single: {word}\n```\n" for word in words]
    return "\n".join([*entries, text]) if words else text


def plain(lines: list[str]) -> None:
    """Docstrings are plain text: what reStructuredText would read as markup is escaped."""
    for i, line in enumerate(lines):
        parts = re.split(r"(`[^`]*`)", line)
        parts[::2] = [
            re.sub(r"(?<=\w)_(?=\W|$)", r"\_", part.replace("\\", "\\\\").replace("|", r"\|"))
            for part in parts[::2]
        ]
        lines[i] = "".join(parts)


def with_notes(lines: list[str]) -> None:
    """A paragraph after the sections of a docstring gets the heading that numpydoc asks for."""
    inside = noted = False
    i = 0
    while i < len(lines):
        after = lines[i + 1] if i + 1 < len(lines) else ""
        if re.fullmatch(r"-{3,}", after.strip()) and lines[i].strip():
            inside, noted = lines[i] in ("Parameters", "Attributes", "Raises", "Returns"), False
            i += 2
            continue
        starts = i > 0 and not lines[i - 1].strip() and re.match(r"\S", lines[i])
        if inside and not noted and starts and not after.startswith(" "):
            lines[i:i] = ["Notes", "-----"]
            inside, noted = False, True
        i += 1


def demo_pages(folder: Path) -> None:
    """A page for each demo and each measurement, and the pages that measurements have written."""
    shutil.rmtree(folder, ignore_errors=True)  # pages of scripts that are gone
    folder.mkdir()
    lists = {name: script_pages(ROOT / name, folder) for name in PICTURES}
    lists["benchmarks"] += measured_pages(folder)
    index = ["# Gallery", "", "Each demo is a script of at most 100 lines in `demos/`;"]
    index += ["`--help` lists its options. Click on a picture for the program.", ""]
    index += [*gallery("demos", lists["demos"], folder), "", hidden(lists["demos"])]
    write(folder / "index.md", "\n".join(index) + "\n")
    index = ["# Measurements", "", "Scripts of `benchmarks/`, and the pages that they write.", ""]
    index += [*gallery("benchmarks", [*PICTURES["benchmarks"]], folder), "", "## All", ""]
    index += ["```{toctree}", ":maxdepth: 1", "", *lists["benchmarks"], "```"]
    write(folder / "measurements.md", "\n".join(index) + "\n")


def hidden(pages: list[str]) -> str:
    """A table of contents that the navigation alone shows."""
    return "\n".join(["```{toctree}", ":hidden:", "", *pages, "```"])


def gallery(scripts: str, names: list[str], folder: Path) -> list[str]:
    """Cards: the first picture of each page and its title."""
    lines = ["::::{container} cards"]
    for name in names:
        title = (folder / f"{name}.md").read_text(encoding="utf-8").split("\n")[0].strip("# ")
        picture = f"../../{scripts}/pictures/{PICTURES[scripts][name][0]}"
        lines += [":::{container} card", f"[![{title}]({picture})]({name}.md)", ""]
        lines += [f"[{title}]({name}.md)", ":::"]
    return [*lines, "::::"]


def embedded(out: str) -> str:
    """HTML that shows the report of a scene, which stands beside the pages after this."""
    made, shown = LIVE_REPORT, Path(out, "_static/report.html")
    sources = [REPORTED, *(ROOT / "src/antiosc_app").rglob("*.*")]
    if not made.is_file() or any(one.stat().st_mtime > made.stat().st_mtime for one in sources):
        made.parent.mkdir(exist_ok=True)
        with TemporaryDirectory() as folder:
            options = ["--report", str(made), "--out", folder]
            command = [sys.executable, "-P", "-m", "antiosc", "run", str(REPORTED), *options]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    shown.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(made, shown)
    return '<iframe class="report" src="_static/report.html" title="A report"></iframe>'


def rank(name: str, order: list[str]) -> int:
    """Place in a list; behind it, if it does not stand there."""
    return order.index(name) if name in order else len(order)


def script_pages(scripts: Path, folder: Path) -> list[str]:
    """A page for each script: what it shows, its pictures, its code in the light format."""
    names = []
    order = list(PICTURES[scripts.name]) if scripts.name == "demos" else []
    found = sorted(scripts.glob("*.py"), key=lambda path: (rank(path.stem, order), path.stem))
    for script in found:
        source = script.read_text(encoding="utf-8")
        text = ast.get_docstring(ast.parse(source))
        if text is None or '__name__ == "__main__"' not in source:
            continue  # a part of another script
        names.append(script.stem)
        title, *body = text.split("\n")
        above = f"../../{scripts.name}"
        pictures = PICTURES[scripts.name].get(script.stem, [])
        page = [f"# {title.rstrip('.')}", "", *fenced(body), ""]
        page += [f"![{script.stem}]({above}/pictures/{name})" for name in pictures]
        link = f"[`{scripts.name}/{script.name}`]({above}/{script.name})"
        if scripts.name == "demos":
            write(folder / f"{script.stem}.ipynb", light.notebook(script.stem, source))
            link += f", also as a {{download}}`notebook <{script.stem}.ipynb>`"
        page += ["", f"The script, {link}:", "", "\n\n".join(light.markdown(source))]
        write(folder / f"{script.stem}.md", "\n".join(page) + "\n")
    return names


def measured_pages(folder: Path) -> list[str]:
    """Copies of the pages that measurements have written, with links that hold from here."""
    sources = sorted((ROOT / "benchmarks").glob("*.md")) + sorted(
        (ROOT / "benchmarks/speed").glob("*.md")
    )
    stems = {source: f"{source.stem.lower()}_page" for source in sources}
    for source, stem in stems.items():

        def here(found: re.Match[str], folder: Path = source.parent) -> str:
            target = (folder / found[1]).resolve()
            if target in stems:
                return f"]({stems[target]}.md)"
            if not target.exists():
                return found[0]
            return f"](../../{target.relative_to(ROOT)})"

        text = source.read_text(encoding="utf-8")
        write(folder / f"{stem}.md", re.sub(r"\]\(([^)#:\s]+)\)", here, text))
    return list(stems.values())


def of_this_folder(text: str) -> str:
    """A page whose links to scripts and to pages of measurements lead to their pages here."""
    text = re.sub(r"\]\(((?:\.\./)*)\.\./demos\)", r"](\1demos/index.md)", text)
    scripts = re.compile(r"\]\(((?:\.\./)*)\.\./(?:demos|benchmarks)/(\w+)\.py\)")
    text = scripts.sub(r"](\1demos/\2.md)", text)
    copies = re.compile(r"\]\(((?:\.\./)*)\.\./benchmarks/(?:speed/)?(\w+)\.md\)")
    return copies.sub(lambda found: f"]({found[1]}demos/{found[2].lower()}_page.md)", text)


def fenced(lines: list[str]) -> list[str]:
    """Text whose indented lines, which are commands, are put into code blocks."""
    out: list[str] = []
    inside = False
    for line in lines:
        indented = line.startswith("    ")
        if indented and not inside:
            out.append("```sh")
        if inside and not indented and line.strip():
            out.append("```")
        inside = indented or (inside and not line.strip())
        out.append(line[4:] if indented else line)
    return [*out, "```"] if inside else out


def write(path: Path, text: str) -> None:
    """Write a page unless it stands there already, so that nothing is built in vain."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    of_api = HERE / "api/index.md"
    write(of_api, with_names(of_api.read_text(encoding="utf-8")))
