"""Scripts as pages, in jupytext's light format: paragraphs of comments are text, the rest is code.

A paragraph of comments stands between blank lines and begins in the first column. Debian 12 has no
jupytext, so that its format is read here.
"""

from __future__ import annotations

import ast
import json
import re

#: a comment that heads a part of a script: `# -- title`, `# --- title ---`
HEADING = re.compile(r"# -{2,} (?P<title>.*?)(?: -+)?$")


def text_of(paragraph: list[str]) -> str | None:
    """The Markdown of a paragraph of comments, or None of code."""
    if not all(re.match(r"#(?!:|!)", line) for line in paragraph):
        return None
    heading = HEADING.match(paragraph[0])
    if heading and len(paragraph) == 1:
        title = heading["title"]
        return f"## {title[0].upper()}{title[1:]}"
    return "\n".join(re.sub(r"^# ?", "", line) for line in paragraph)


def cells(script: str) -> list[tuple[str, str]]:
    """("text" or "code", its lines) in their order, without the docstring of the module."""
    lines = script.splitlines()
    body = ast.parse(script).body
    after = body[0].end_lineno if ast.get_docstring(ast.parse(script)) else 0
    paragraphs: list[list[str]] = [[]]
    inside = _strings(script)
    for number, line in enumerate(lines[after:], (after or 0) + 1):
        if line.strip() or number in inside:
            paragraphs[-1].append(line)
        elif paragraphs[-1]:
            paragraphs.append([])
    found: list[tuple[str, str]] = []
    for paragraph in filter(None, paragraphs):
        text = text_of(paragraph)
        if text is not None:
            found.append(("text", text))
        elif found and found[-1][0] == "code":
            space = "\n\n" if paragraph[0].startswith(" ") else "\n\n\n"
            found[-1] = ("code", found[-1][1] + space + "\n".join(paragraph))
        else:
            found.append(("code", "\n".join(paragraph)))
    return found


def notebook(name: str, script: str) -> str:
    """A script as a Jupyter notebook for the folder of the script; its last cell calls main."""
    program, _, _ = script.partition('\nif __name__ == "__main__":')
    told = ast.get_docstring(ast.parse(script)) or ""
    place = [
        ("text", f"# {told}\n\nKeep this notebook in `demos/`, beside `{name}.py`."),
        ("code", f'__file__ = "{name}.py"'),
    ]
    parts = [*place, *cells(program), ("code", "main()")]

    made = [_cell(kind, text) for kind, text in parts]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    book = {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 4}
    return json.dumps(book, ensure_ascii=False, indent=1) + "\n"


def _cell(kind: str, text: str) -> dict[str, object]:
    """A cell of a notebook in its file format, nbformat 4."""
    cell = {"cell_type": "markdown", "metadata": {}, "source": text.splitlines(keepends=True)}
    if kind == "code":
        cell |= {"cell_type": "code", "execution_count": None, "outputs": []}
    return cell


def _strings(script: str) -> set[int]:
    """Lines inside texts of several lines, where a blank line separates nothing."""
    texts = (
        node
        for node in ast.walk(ast.parse(script))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    )
    return {line for node in texts for line in range(node.lineno, (node.end_lineno or 0) + 1)}


def markdown(script: str) -> list[str]:
    """The page of a script after its title: text, and code in fences."""
    return [body if kind == "text" else f"```python\n{body}\n```" for kind, body in cells(script)]
