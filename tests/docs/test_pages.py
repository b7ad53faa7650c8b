"""The pages: their programs run, their links hold, they name all that is public, they are built."""

from __future__ import annotations

import importlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import antiosc as ao
import html_pages
import pictures
import webdriver
from antiosc.plot import charts
from antiosc_app import cli
from paths import BENCHMARKS, DEMOS, ROOT, demo

DOCS = ROOT / "docs"
outputs = demo("page_outputs")
drawn = demo("pictures_drawn")
#: pages whose programs need NumPy and SciPy alone
LIGHT = {
    *("howto/contacts", "howto/report", "tutorials/measured", "api/gradients"),
    *("api/models", "api/contact", "api/simulation", "api/scenes", "api/drops", "api/chance"),
    *("api/errors", "api/exports", "api/extension", "api/measured"),
}
MESHED = {"howto/deck", "howto/open"}
#: The first programs of these pages are jobs that an engineer does: so many lines at most.
JOBS = {"howto/map", "howto/matrices", "howto/parts"}
LONGEST_JOB = 15
SLOW = {
    *("first_impact", "errors", "howto/map", "howto/stress", "howto/studies", "howto/parts"),
    *("howto/report", "tutorials/drop", "tutorials/measured", "api/measured", "api/drops"),
    *("api/extraction", "api/assemblies", "api/results", "api/structures", "api/find"),
}


def programs(page: str) -> list[str]:
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


#: Pages with sheets that deflect by more than half their thickness.
DEEP = {"howto/parts"}


#: What people look for, and the page that a search finds first.
SOUGHT = {
    "node id": "api/structures",
    "npz": "api/models",
    "golf ball": "api/simulation",
    "GUI": "howto/open",
}


def marked(page: str):
    marks = [pytest.mark.fem] * (page not in LIGHT) + [pytest.mark.slow] * (page in SLOW)
    marks += [pytest.mark.filterwarnings("ignore:.*deflects by")] * (page in DEEP)
    return pytest.param(page, marks=marks)


@pytest.mark.parametrize("page", [marked(page) for page in sorted(LIGHT | MESHED | SLOW)])
def test_a_page_shows_what_its_programs_print(page, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "meshes", tmp_path / "meshes")
    monkeypatch.chdir(tmp_path)
    found = outputs.printed(page, tmp_path)
    assert any(found)
    if page == "first_impact":
        same_numbers(found[0])
    if page in outputs.told() and outputs.comparable():
        assert outputs.changes(page, found) == []


def test_bars_tell_what_they_hold():
    pages = [ROOT / "README.md", *DOCS.rglob("*.md")]
    blocks = [b for page in pages for b in re.findall(r"```text\n(.*?)```", page.read_text(), re.S)]
    assert any("±" in block for block in blocks)
    assert [line for block in blocks for line in outputs.unsaid(block)] == []
    assert outputs.unsaid("peak force 1.7 kN ± 2 %") == ["peak force 1.7 kN ± 2 %"]
    assert outputs.unsaid("peak force 1.7 kN ± 2 %\nmesh 1 %, law 1.5 %") == []


@pytest.mark.fem
@pytest.mark.slow
def test_bars_of_a_report_tell_what_they_hold(tmp_path, capsys, generated, monkeypatch):
    """The report is the one that the pages show: their build need not run the scene again."""
    monkeypatch.setattr(charts, "render", pictures.render)
    report = generated.LIVE_REPORT
    report.parent.mkdir(exist_ok=True)
    scene = str(generated.REPORTED)
    assert cli.main(["run", scene, "--out", str(tmp_path), "--report", str(report)]) == 0
    said = capsys.readouterr().out
    text = re.sub(r"<(style|script).*?</\1>|<[^>]+>", " ", report.read_text(), flags=re.S)
    result = json.loads((tmp_path / "result.json").read_text())
    assert (result["result"]["status"], result["warnings"]) == (0, [])
    assert "±" in said
    assert "±" in text
    assert outputs.unsaid(text) == []


def test_figures_of_outputs_are_compared_and_noise_is_not():
    shown = "peak force    1.699 kN\nsite          (20, 30) mm\nenergy drift  9.6e-06\nseconds 1.5"
    assert outputs.differences(shown, shown.replace("1.699", "1.705").replace("9.6", "3.1")) == []
    (moved,) = outputs.differences(shown, shown.replace("1.699", "1.799"))
    assert moved.startswith("peak force    1.699 kN -> ")
    assert outputs.differences(shown, shown.replace("kN", "N"))
    assert outputs.differences(shown, shown + "\nmore") == ["5 lines for 4"]
    line = "details " + "word " * 40
    assert outputs.differences(outputs.wrapped(line), outputs.wrapped(line)) == []
    assert outputs.lines_of(outputs.wrapped(line)) == [line.rstrip()]
    page = "a\n```python\nprint(1)\n```\n\n```text\n2\n```\nb\n"
    assert outputs.with_outputs(page, ["1"]) == page.replace("2\n", "1\n")
    assert outputs.with_outputs(page, [""]) == "a\n```python\nprint(1)\n```\nb\n"


@pytest.mark.parametrize("page", sorted(JOBS))
def test_a_job_takes_few_lines(page):
    lines = [line.strip() for line in programs(page)[0].splitlines()]
    assert 0 < len([line for line in lines if line and line[0] != "#"]) <= LONGEST_JOB


def same_numbers(said: str) -> None:
    """The page tells what its program prints."""
    text = (DOCS / "first_impact.md").read_text(encoding="utf-8")
    peak, contact, rest = re.search(  # type: ignore[union-attr]
        r"about (\d+) N.*about (\d+) µs.*\((0\.\d+)\)", text, re.DOTALL
    ).groups()
    found = dict(re.findall(r"(peak force|contact time|restitution) +(\S+)", said))
    assert 1e3 * float(found["peak force"]) == pytest.approx(float(peak), rel=0.01)  # kN
    assert float(found["contact time"]) == pytest.approx(float(contact), rel=0.01)  # µs
    assert float(found["restitution"]) == pytest.approx(float(rest), abs=0.01)


def test_no_page_with_a_program_is_left_out():
    """Pages of other rooms have their own tests; all others stand in the lists above."""
    elsewhere = {"howto/matrices"}
    with_programs = {
        str(path.relative_to(DOCS).with_suffix(""))
        for folder in (DOCS, DOCS / "howto", DOCS / "api", DOCS / "tutorials")
        for path in folder.glob("*.md")
        if "```python\nimport antiosc" in path.read_text(encoding="utf-8")
        or "\nimport antiosc as ao\n" in path.read_text(encoding="utf-8")
    }
    assert with_programs - elsewhere <= LIGHT | MESHED | SLOW


def test_every_public_name_stands_in_a_program_that_is_run():
    pages = [*sorted(LIGHT | MESHED | SLOW), "howto/matrices"]
    text = "\n".join(program for page in pages for program in programs(page))
    text += (ROOT / "README.md").read_text(encoding="utf-8")
    assert [name for name in ao._MODULES if not re.search(rf"\bao\.{name}\b", text)] == []


@pytest.fixture
def generated(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("generated")


def test_every_public_name_stands_on_one_page_of_the_api(generated):
    texts = generated.api_pages()
    listed = [
        name
        for text in texts
        for name in re.findall(r"auto(?:class|function):: (\w+)", generated.with_lists(text, texts))
    ]
    assert sorted(listed) == sorted(ao._MODULES)
    modules = [name for text in texts for name in generated.listed_modules(text)]
    assert [name for name in modules if not generated.api([name])] == []


def test_the_table_of_all_names_is_that_of_the_code(generated):
    """`python docs/generated.py` writes it."""
    text = (DOCS / "api/index.md").read_text(encoding="utf-8")
    assert generated.with_names(text) == text


@pytest.mark.slow
def test_every_script_has_a_page_and_its_pictures_exist(generated, tmp_path):
    generated.demo_pages(tmp_path / "demos")
    pages = {path.stem for path in (tmp_path / "demos").glob("*.md")} - {"index", "measurements"}
    scripts = {
        path.stem: path
        for folder in (DEMOS, BENCHMARKS)
        for path in folder.glob("*.py")
        if '"__main__"' in path.read_text(encoding="utf-8")
    }
    assert {page for page in pages if not page.endswith("_page")} == set(scripts)
    shown = {
        name: [ROOT / folder / "pictures" / p for p in pictures]
        for folder, named in generated.PICTURES.items()
        for name, pictures in named.items()
    }
    assert [p for pictures in shown.values() for p in pictures if not p.is_file()] == []
    assert {path.stem for path in scripts.values() if path.parent == DEMOS} <= set(shown)


@pytest.mark.slow
def test_pictures_were_drawn_from_the_programs_as_they_are():
    """`make bench-outputs` draws those that were not."""
    now = {name: drawn.of_demo(name) for name in drawn.of_demos()}
    now |= {name: drawn.of_page(name) for name in outputs.told() if drawn.on_page(name)}
    assert drawn.stored() == now
    kept = [path for name in outputs.told() for path in drawn.on_page(name).values()]
    assert [path for path in kept if not path.is_file()] == []


def test_another_mesh_is_another_input(tmp_path, monkeypatch):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/part.msh").write_text("one")
    monkeypatch.setattr(drawn.pages, "ROOT", tmp_path)
    program = 'read("meshes/part.msh")'
    before = drawn.digest(program)
    assert drawn.digest(program + " ") != before
    (tmp_path / "meshes/part.msh").write_text("two")
    assert drawn.digest(program) != before


def test_pages_that_measurements_wrote_keep_their_links(generated, tmp_path):
    generated.measured_pages(tmp_path)
    text = (tmp_path / "article_page.md").read_text(encoding="utf-8")
    pictures = re.findall(r"\]\(\.\./\.\./(benchmarks/[^)]+)\)", text)
    assert pictures
    assert [p for p in pictures if not (ROOT / p).is_file()] == []
    link = "[it](../benchmarks/speed/nine_million.md) [so](../demos/pictures/x.png) [all](../demos)"
    there = "[it](demos/nine_million_page.md) [so](../demos/pictures/x.png) [all](demos/index.md)"
    assert generated.of_this_folder(link) == there
    assert generated.of_this_folder("[a](../../demos/drop.py)") == "[a](../demos/drop.md)"


def test_demos_are_short_and_have_their_pictures(generated):
    """What a user opens: scripts of at most 100 lines each."""
    scripts = {path.stem: path for path in DEMOS.glob("*.py")}
    assert set(generated.PICTURES["demos"]) == set(scripts) - {"command_line", "compared"}
    long = {name for name, path in scripts.items() if len(path.read_text().splitlines()) > 100}
    assert long == set()


@pytest.mark.parametrize(
    "path", [*DOCS.glob("*.md"), *DOCS.glob("[aht]*/*.md"), ROOT / "CONTRIBUTING.md"], ids=str
)
def test_links_between_the_sources_hold(path):
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = [link.split("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text)]
    local = [link for link in links if link and not re.match(r"[a-z]+:", link)]
    assert [link for link in local if not (path.parent / link).exists()] == []


@pytest.mark.fem
@pytest.mark.slow
def test_the_pages_are_built_without_a_warning_and_can_be_read(tmp_path: Path):
    for package in ("sphinx", "myst_parser", "furo", "sphinx_copybutton"):
        pytest.importorskip(package)
    built = tmp_path / "html"
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-E", "-b", "html"]
    # half of the time goes into lists of members and the quotes of every word
    command += ["-D", "toc_object_entries=0", "-D", "smartquotes=0"]
    run = subprocess.run(
        [*command, "-d", str(tmp_path / "trees"), str(DOCS), str(built)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert html_pages.faults(built) == []
    seen = html_pages.loaded(built)
    if seen is None:
        pytest.skip("no browser here: links and pictures were checked without one")
    assert [name for name, page in seen.items() if page["missing"]] == []
    assert [name for name, page in seen.items() if page["text"] < 100] == []
    assert [n for n, page in seen.items() if page["width"] > html_pages.TELEPHONE] == []
    if webdriver.MISSING:
        return
    first, said, theme = html_pages.searched(built, [*SOUGHT])
    assert said == []
    assert theme in ("light", "dark")
    assert all(first.values())
    if importlib.import_module("sphinx").version_info < (7,):  # later ones have another order
        assert [word for word, page in SOUGHT.items() if not first[word].startswith(page)] == []


@pytest.mark.parametrize("script", sorted(DEMOS.glob("*.py")), ids=lambda path: path.stem)
def test_demos_are_notebooks_too(script, generated):
    """Every cell of code compiles; the last one runs the demo."""
    source = script.read_text(encoding="utf-8")
    if '__name__ == "__main__"' not in source:
        return
    book = json.loads(generated.light.notebook(script.stem, source))
    code = ["".join(one["source"]) for one in book["cells"] if one["cell_type"] == "code"]
    for cell in code:
        compile(cell, script.name, "exec")
    assert code[-1] == "main()"
    assert "def main(" in "\n".join(code)


def test_a_notebook_runs_in_the_folder_of_the_demos(tmp_path, monkeypatch, generated):
    shutil.copy(DEMOS / "command_line.py", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    source = (DEMOS / "flow.py").read_text(encoding="utf-8")
    book = json.loads(generated.light.notebook("flow", source))
    names = {"__name__": "__main__"}
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert (tmp_path.parent / "out/flow.png").is_file()
