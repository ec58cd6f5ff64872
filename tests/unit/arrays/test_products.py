"""Products M P M' are in one module: the syntax trees of the package have no other but where a reason is given.

A product is found however it is written: ``M @ P @ M.T``, ``M @ (P @ M.T)``, ``M.T @ P @ M``, with ``.mT``,
``swapaxes`` or ``transpose``, by ``dot``, ``matmul``, ``multi_dot`` or ``einsum``, and in two lines with a name
between.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

import pytest

import mcnav

PACKAGE: Final = Path(mcnav.__file__).parent

ONE_MODULE: Final = "arrays/products.py"

EXEMPT: Final = {
    "systems/ins/ensemble": "compiled kernels of samples",
    "systems/closed_loop/algebra.py": "compiled kernels of samples, whose bits do not depend on a library",
    "systems/closed_loop/filter.py:FilterStates.start_covariance": "enters the gains of samples",
    "systems/ins/filter/tables.py:initial_covariance": "enters the gains of samples",
    "systems/ins/sensors/flexure.py:Flexure.covariance": "enters the gains of samples",
    "systems/ins/sensors/flexure.py:Flexure.added": "enters the flexure that samples draw",
    "systems/ins/reference": "a second opinion, which shares nothing with the linear engine",
    "rare/curvature.py": "curvatures turned to other axes, which are no covariances and enter the search of failures",
    "judgement/whitened_records.py:Together": "squares of scores by the inverse information, x' A x",
    "report/figures/dispersion.py:_farthest": "squared distances of samples, x' A x",
}
"""Modules, folders or functions with products of their own, by path, and why."""

TRANSPOSING: Final = ("swapaxes", "transpose", "matrix_transpose", "moveaxis")
MULTIPLYING: Final = ("matmul", "dot")


def products_in(source: str) -> list[tuple[str, int]]:
    """Return the products M P M' of a module: names of the functions they are in, and lines."""
    return [(name, line) for name, body in _scopes(ast.parse(source), "") for line in _lines(body)]


def _scopes(node: ast.AST, name: str) -> Iterator[tuple[str, list[ast.AST]]]:
    """Yield the name of each function, and of the module, with the nodes that are its own."""
    own, queue = [], list(ast.iter_child_nodes(node))
    while queue:
        child = queue.pop(0)
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            yield from _scopes(child, f"{name}.{child.name}".lstrip("."))
        else:
            own.append(child)
            queue += ast.iter_child_nodes(child)
    yield name, own


def _lines(nodes: list[ast.AST]) -> Iterator[int]:
    """Yield the lines of a scope's products."""
    named = _assigned(nodes)
    for node in nodes:
        if isinstance(node, ast.expr) and (_is_product(node, named) or _is_einsum(node) or _is_multi_dot(node)):
            yield node.lineno


def _assigned(nodes: list[ast.AST]) -> dict[str, list[ast.expr]]:
    """Return what is assigned to the names of a scope."""
    named: dict[str, list[ast.expr]] = {}
    for node in nodes:
        if isinstance(node, ast.NamedExpr | ast.AnnAssign) and node.value is not None:
            pairs = [(node.target, node.value)]
        elif isinstance(node, ast.Assign):
            pairs = [pair for target in node.targets for pair in _paired(target, node.value)]
        else:
            continue
        for target, value in pairs:
            if isinstance(target, ast.Name):
                named.setdefault(target.id, []).append(value)
    return named


def _paired(target: ast.expr, value: ast.expr) -> list[tuple[ast.expr, ast.expr]]:
    """Return targets with their values, of ``a, b = c, d`` each with its own."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        return list(zip(target.elts, value.elts, strict=True))
    return [(target, value)]


def _factors(node: ast.expr) -> tuple[ast.expr, ast.expr] | None:
    """Return the factors of a matrix product; none of anything else."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
        return node.left, node.right
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in MULTIPLYING:
        of_module = isinstance(node.func.value, ast.Name) and node.func.value.id == "np"
        factors = node.args if of_module else [node.func.value, *node.args]
        return (factors[0], factors[1]) if len(factors) == 2 else None
    return None


def _products(node: ast.expr, named: dict[str, list[ast.expr]]) -> list[tuple[ast.expr, ast.expr]]:
    """Return the factors of a product, or of the products that a name may stand for."""
    values = named.get(node.id, []) if isinstance(node, ast.Name) else [node]
    return [factors for value in values if (factors := _factors(_bare(value))) is not None]


def _bare(node: ast.expr) -> ast.expr:
    """Return what ``np.asarray(...)`` is given."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "asarray":
        return node.args[0]
    return node


def _is_product(node: ast.expr, named: dict[str, list[ast.expr]]) -> bool:
    factors = _factors(node)
    if factors is None:
        return False
    left, right = factors
    first = [outer for outer, _ in _products(left, named) if _transposed_of(outer, right)]
    last = [outer for _, outer in _products(right, named) if _transposed_of(left, outer)]
    return bool(first or last)


def _transposed_of(one: ast.expr, other: ast.expr) -> bool:
    """Return whether one of two expressions is the other one transposed."""
    return any(
        transposed is not None and ast.dump(transposed) == ast.dump(plain)
        for transposed, plain in ((_transposed(one), other), (_transposed(other), one))
    )


def _transposed(node: ast.expr) -> ast.expr | None:
    """Return what an expression transposes; none where it transposes nothing."""
    if isinstance(node, ast.Attribute) and node.attr in ("T", "mT"):
        return node.value
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in TRANSPOSING:
        of_module = isinstance(node.func.value, ast.Name) and node.func.value.id == "np"
        return node.args[0] if of_module else node.func.value
    return None


def _is_multi_dot(node: ast.expr) -> bool:
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "multi_dot"):
        return False
    factors = node.args[0]
    return isinstance(factors, ast.List | ast.Tuple) and any(
        _transposed_of(one, other) for one, other in zip(factors.elts, factors.elts[2:], strict=False)
    )


def _is_einsum(node: ast.expr) -> bool:
    """Return whether an ``einsum`` has a matrix on both sides of another one, with rows that this one has not."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "einsum"):
        return False
    subscripts, operands = node.args[0], node.args[1:]
    if not (isinstance(subscripts, ast.Constant) and isinstance(subscripts.value, str)):
        return False
    terms, _, result = subscripts.value.replace("...", "").partition("->")
    named = list(zip(map(set, terms.split(",")), map(ast.dump, operands), strict=True))
    both_sides = [
        (first - set(result), between, last - set(result), (first & last & set(result)) | (first - last) & set(result))
        for first, one in named for last, other in named if one == other for between, middle in named if middle != one
    ]  # fmt: skip
    return any(between & first - last and between & last - first and rows - between
               for first, between, last, rows in both_sides)  # fmt: skip


@cache
def products_of_the_package() -> tuple[tuple[str, int], ...]:
    """Return all products of the package: ``module:function``, and lines."""
    sources = {path: path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}
    return tuple(
        (f"{path.relative_to(PACKAGE).as_posix()}:{name}", line)
        for path, source in sources.items()
        if any(word in source for word in (" @ ", "einsum", *MULTIPLYING, "multi_dot"))
        for name, line in products_in(source)
    )


def test_no_other_module_multiplies_covariances() -> None:
    outside = [
        f"{place}, line {line}"
        for place, line in products_of_the_package()
        if not any(_is_in(place, room) for room in (ONE_MODULE, *EXEMPT))
    ]
    assert not outside, "use mcnav.arrays.products, or say here why not"


def _is_in(place: str, room: str) -> bool:
    """Return whether a place, ``module:function``, is in a room: a folder, a module or a function."""
    return place == room or place.startswith((f"{room}/", f"{room}:", f"{room}."))


def test_each_exemption_is_used() -> None:
    compiled = ("systems/ins/ensemble", "systems/closed_loop/algebra.py")  # loops and vectors, no products of matrices
    places = [place for place, _ in products_of_the_package()]
    assert [room for room in EXEMPT if room not in compiled and not any(_is_in(place, room) for place in places)] == []


@pytest.mark.parametrize(
    "code",
    [
        "x = a @ p @ a.T",
        "x = (a @ p) @ a.mT",
        "x = a.T @ p @ a",
        "x = a @ (p @ a.T)",
        "x = f.a @ p @ np.swapaxes(f.a, -1, -2) + q",
        "x = a @ p @ a.swapaxes(1, 2)",
        "x = a @ p @ np.transpose(a)",
        "x = a[0] @ (p + q) @ a[0].T",
        "x = np.linalg.multi_dot([a, p, a.T])",
        "x = a.dot(p).dot(a.T)",
        "x = np.matmul(np.matmul(a, p), a.T)",
        "x = np.einsum('ij,jk,lk->il', a, p, a)",
        "x = np.einsum('tij,jk,tik->ti', a, p, a)",
        "h = a @ p\nx = h @ a.T + r",
        "h, g = a @ p, 1\nx = np.asarray(h @ a.T)",
        "def f(a, p):\n    left = np.eye(3) - k @ a\n    p = left @ p @ left.T + k @ r @ k.T",
    ],
)
def test_products_are_found(code: str) -> None:
    assert products_in(code)


@pytest.mark.parametrize(
    "code",
    [
        "x = a @ p @ b.T",
        "x = a @ a.T",
        "x = w @ p @ w",
        "x = np.einsum('n,ni,nj->ij', w, a, a)",
        "x = np.einsum('iab,ia,ib->i', h, g, g)",
        "x = transform(a, p)",
    ],
)
def test_other_products_are_not_found(code: str) -> None:
    assert not products_in(code)
