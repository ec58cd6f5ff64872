"""Which names of the package refer to which, and which modules contain compiled code of others."""

from __future__ import annotations

import ast
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

Node = tuple[str, str]
"""Path of a module, and a name that it defines."""

COMPILERS: Final = (
    "compiled", "allocation_free", "allocation_free_loop", "allocation_free_part", "allocation_free_subroutine",
    "allocation_free_uncontracted", "uncontracted", "uncontracted_subroutine",
    "reduced_math", "inlined",
)  # fmt: skip
"""Decorators of `mcnav.compiled.jit`."""


@dataclass
class References:
    """References between the names of all modules of a tree.

    Attributes
    ----------
    users : mapping of Node to set of Node
        Definitions that mention a name.
    uses : mapping of Node to set of Node
        Names that a definition mentions.
    importers : mapping of str to set of str
        Modules that import a module.
    lines : mapping of Node to int
        Lines of each compiled function.
    """

    users: dict[Node, set[Node]] = field(default_factory=lambda: defaultdict(set))
    uses: dict[Node, set[Node]] = field(default_factory=lambda: defaultdict(set))
    importers: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    lines: dict[Node, int] = field(default_factory=dict)

    def compiled_after(self, node: Node) -> set[Node]:
        """Return the compiled functions that contain a definition, themselves or by way of others."""
        return _closure(node, self.users) & set(self.lines)

    def compiled_by(self, node: Node) -> set[Node]:
        """Return the compiled functions that a definition calls, itself or by way of others."""
        return _closure(node, self.uses) & set(self.lines)


def _closure(node: Node, edges: dict[Node, set[Node]]) -> set[Node]:
    found, left = {node}, [node]
    while left:
        further = edges.get(left.pop(), set()) - found
        found |= further
        left.extend(further)
    return found


def read_references(tree: Path, folders: tuple[str, ...] = ("mcnav", "tests")) -> References:
    """Read the references between all modules of some folders of a tree."""
    found = References()
    paths = sorted(str(path.relative_to(tree)) for folder in folders for path in (tree / folder).rglob("*.py"))
    for path in paths:
        _read(path, ast.parse((tree / path).read_text()), set(paths), found)
    return found


def _read(path: str, module: ast.Module, paths: set[str], found: References) -> None:
    names: dict[str, Node] = {}
    for node in ast.walk(module):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                base = node.module.replace(".", "/")
                whole, inner = f"{base}.py", f"{base}/{alias.name}.py"
                package = f"{base}/__init__.py"
                target = inner if inner in paths else whole if whole in paths else package
                if target in paths:
                    names[alias.asname or alias.name] = (target, "" if target == inner else alias.name)
                    found.importers[target].add(path)
    for statement in module.body:
        for defined in _defined(statement):
            names[defined] = (path, defined)
    for statement in module.body:
        owners = [(path, defined) for defined in _defined(statement)] or [(path, "")]
        if path.startswith("mcnav/") and _compiles(statement):
            for owner in owners:
                found.lines[owner] = (statement.end_lineno or 0) - statement.lineno
        for target in _mentioned(statement, names):
            for owner in owners:
                found.users[target].add(owner)
                found.uses[owner].add(target)


def _compiles(statement: ast.stmt) -> bool:
    return any(isinstance(node, ast.Name) and node.id in COMPILERS for node in ast.walk(statement))


def _defined(statement: ast.stmt) -> list[str]:
    match statement:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return [name]
        case ast.Assign(targets=targets):
            return [each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)]
        case ast.AnnAssign(target=ast.Name(id=name)):
            return [name]
    return []


def _mentioned(statement: ast.stmt, names: dict[str, Node]) -> list[Node]:
    found = []
    for node in ast.walk(statement):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in names:
            found.append(names[node.id])
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in names:
            path, name = names[node.value.id]
            if not name:
                found.append((path, node.attr))
    return found
