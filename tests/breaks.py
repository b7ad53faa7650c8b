"""The breaks of a source file: changes of one place that a test should notice.

An operator, a comparison, a constant (× 1.1, 0, negated; a whole number + 1), a condition, a
statement that is left out, or the first two arguments of a call, swapped. Left out are changes that
change nothing that is computed: of words (docstrings, messages, what is logged), of type hints, the
last of a pair or the last axis by -1 in place of 1, and those named below.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any, TypeGuard

from antiosc.fem.compat import DOLFINX
from antiosc.fem.compiler import FFCX
from paths import ROOT

OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
}
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
# Changes that change nothing are not drawn: -0.0 for 0.0, the order of the arguments of SYMMETRIC
# functions, a tenth more of a threshold that only has to lie above rounding or of a length in
# PICTURES, code for other VERSIONS of the libraries than those installed here.
SYMMETRIC = (
    *("max", "min", "np.maximum", "np.minimum", "np.clip", "np.array_equal"),
    *("math.hypot", "np.hypot", "math.isclose"),
)
ROUNDING_THRESHOLD = 1e-6
PICTURES = ("charts", "plotting")
VERSIONS: dict[str, tuple[int, ...]] = {"DOLFINX": DOLFINX, "FFCX": FFCX}


@dataclass(frozen=True)
class Break:
    """One change of one file: bytes `start` to `end` become `text`."""

    path: Path
    line: int
    start: int
    end: int
    before: str
    text: str

    def apply(self, source: bytes) -> bytes:
        """The file with the change."""
        return source[: self.start] + self.text.encode() + source[self.end :]

    def __str__(self) -> str:
        before, after = (" ".join(text.split()) for text in (self.before, self.text))
        return f"{self.path}:{self.line}: {before[:60]}  ->  {after[:60]}"


def breaks(path: Path) -> list[Break]:
    """All breaks of one file, relative to the root of the repository."""
    source = (ROOT / path).read_bytes()
    starts, found = offsets(source), []
    for node, text in changes(ast.parse(source)):
        if path.parts[2] in PICTURES and _is_a_tenth_more(node, text):
            continue
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + node.end_col_offset
        found.append(Break(path, node.lineno, start, end, source[start:end].decode(), text))
    return found


def offsets(source: bytes) -> list[int]:
    """Where each line of the source starts, bytes."""
    return [0, *accumulate(len(row) for row in source.splitlines(keepends=True))]


def _is_a_tenth_more(node: ast.AST, text: str) -> bool:
    if not isinstance(node, ast.Constant) or not isinstance(node.value, float):
        return False
    return text == f"({1.1 * node.value!r})"


def works(one: Break) -> bool:
    """Whether the break leaves a program, and another one."""
    source = (ROOT / one.path).read_bytes()
    try:
        return ast.dump(ast.parse(one.apply(source))) != ast.dump(ast.parse(source))
    except SyntaxError:
        return False


def changes(node: ast.AST, index: bool = False) -> Iterator[tuple[Any, str]]:
    """(node, text that takes its place) below and including `node`, in the order of the source.

    `index`: the node is an index, or a part of one.
    """
    if _is_text(node) or _is_typing(node) or _is_guard(node):
        return
    if _is_of_versions(node):
        yield from _for_this_version(node)
        return
    if isinstance(node, ast.Constant) and node.value == 1 and index:
        yield node, "(2)"
    elif isinstance(node, ast.expr):
        yield from ((node, f"({ast.unparse(new)})") for new in expressions(node))
    elif left_out(node):
        yield node, "pass"
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "exc"):
            continue
        within = _is_index(node, field) or (index and isinstance(node, ast.Tuple))
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from changes(child, within)


def expressions(node: ast.expr) -> Iterator[ast.expr]:
    """What may stand for an expression."""
    match node:
        case ast.BinOp(left, operator, right) if type(operator) in OPERATORS:
            yield ast.BinOp(left, OPERATORS[type(operator)](), right)
        case ast.BinOp(_, ast.MatMult(), _):  # `*` is the same of SciPy's matrices
            yield ast.UnaryOp(ast.USub(), node)
        case ast.Compare(left, [operator], right):
            yield ast.Compare(left, [COMPARISONS[type(operator)]()], right)
        case ast.BoolOp(operator, values):
            other = ast.And() if isinstance(operator, ast.Or) else ast.Or()
            yield ast.BoolOp(other, values)
        case ast.UnaryOp(ast.Not() | ast.USub(), operand):
            yield operand
        case ast.Constant(bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(float(value)) if abs(value) < ROUNDING_THRESHOLD:
            yield ast.Constant(1.0 if value == 0 else 0.0)
            yield from [ast.Constant(-value)] if value else []
        case ast.Constant(float(value)):
            yield from (ast.Constant(new) for new in (1.1 * value, 0.0, -value))
        case ast.Constant(int(value)):
            yield from (ast.Constant(new) for new in (value + 1, -value))
        case ast.Call(function, [first, second, *rest], keywords):
            starred = isinstance(first, ast.Starred) or isinstance(second, ast.Starred)
            same = ast.dump(first) == ast.dump(second) or ast.unparse(function) in SYMMETRIC
            if not starred and not same:
                yield ast.Call(function, [second, first, *rest], keywords)


def left_out(node: ast.AST) -> bool:
    """Whether the statement may be dropped: a call, x += y, raise; not what only tells."""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Call) and not ast.unparse(node).startswith("log.")
    return isinstance(node, ast.AugAssign | ast.Raise)


def _is_index(node: ast.AST, field: str) -> bool:
    """Whether a field holds the index of an array, or the number of an axis."""
    if isinstance(node, ast.keyword):
        return node.arg == "axis"
    return isinstance(node, ast.Subscript) and field == "slice"


def _is_text(node: ast.AST) -> bool:
    """Docstrings, strings and what they are made of."""
    if isinstance(node, ast.Expr):
        node = node.value
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
    )


def _is_guard(node: ast.AST) -> bool:
    """What changes no result: `strict` of zip notices mistakes, `optimize` of einsum saves time."""
    return isinstance(node, ast.keyword) and node.arg in ("strict", "optimize")


def _is_typing(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _is_of_versions(node: ast.AST) -> TypeGuard[ast.If | ast.IfExp]:
    """Whether the version of a library decides what runs."""
    if not isinstance(node, ast.If | ast.IfExp) or not isinstance(node.test, ast.Compare):
        return False
    return isinstance(node.test.left, ast.Name) and node.test.left.id in VERSIONS


def _for_this_version(node: ast.If | ast.IfExp) -> Iterator[tuple[Any, str]]:
    """The changes of what runs with the library that is installed here."""
    runs = eval(ast.unparse(node.test), {}, VERSIONS)
    part = node.body if runs else node.orelse
    for child in part if isinstance(part, list) else [part]:
        yield from changes(child)
