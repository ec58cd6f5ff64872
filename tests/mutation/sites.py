"""Places in a module where a small change is possible, and the changes."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

OPERATORS: Final[dict[type[ast.operator], tuple[type[ast.operator], ...]]] = {
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.FloorDiv: (ast.Mult,),
    ast.Mod: (ast.FloorDiv,),
    ast.Pow: (ast.Mult,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.BitXor: (ast.BitOr,),
    ast.LShift: (ast.RShift,),
    ast.RShift: (ast.LShift,),
}
COMPARISONS: Final[dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
EXCHANGED: Final = {
    one: other
    for pair in (
        ("sin", "cos"), ("sinh", "cosh"), ("min", "max"), ("minimum", "maximum"), ("argmin", "argmax"),
        ("any", "all"), ("floor", "ceil"), ("sum", "mean"), ("ones", "zeros"), ("log", "log10"), ("exp", "expm1"),
    )
    for one, other in (pair, pair[::-1])
}  # fmt: skip
"""Functions that are exchanged for one another."""

DROPPED: Final = ("sqrt", "abs", "fabs", "transpose")
"""Functions and methods whose argument, or object, is taken instead of their value."""

ORDERED: Final = ("isinstance", "field", "load", "store")
"""Functions whose arguments are not swapped: it would not compile."""

UNCHANGED: Final = ("strict",)
"""Keywords that only check their caller."""


@dataclass(frozen=True)
class Site:
    """Place of a mutation.

    Attributes
    ----------
    begin, end : int
        Bytes of the source that are replaced.
    row : int
        Line, from one.
    owner : str
        Function, class or constant of the module that holds the place; empty for other statements.
    function : str
        Qualified name of the function around it, without nested ones; empty outside of functions.
    node : ast.expr or ast.stmt
    """

    begin: int
    end: int
    row: int
    owner: str
    function: str
    node: ast.expr | ast.stmt

    @property
    def was(self) -> str:
        """Return what stands there, on one line."""
        return ast.unparse(self.node)

    @property
    def choices(self) -> tuple[str, ...]:
        """Return what may stand there instead."""
        return tuple(ast.unparse(each) for each in _changes(self.node))


def find_sites(source: str) -> list[Site]:
    """Find all places of a module, in order.

    Docstrings, annotations, decorators, messages of errors, formatted text, imports and sizes of empty arrays are left
    alone.

    >>> [(site.was, site.choices) for site in find_sites("def f(x: int = 1):\\n    return x + y")]
    [('1', ('2', '0')), ('x + y', ('x - y',))]
    """
    lines = source.encode().split(b"\n")
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line) + 1)
    sites = []
    for node, owner, function in _expressions(ast.parse(source)):
        if next(_changes(node), None) is not None:
            assert node.end_lineno is not None
            assert node.end_col_offset is not None
            begin = starts[node.lineno - 1] + node.col_offset
            end = starts[node.end_lineno - 1] + node.end_col_offset
            sites.append(Site(begin, end, node.lineno, owner, function, node))
    return sorted(sites, key=lambda site: (site.begin, -site.end))


def mutate(source: str, site: Site, choice: str) -> str:
    """Return the source with a choice at its place, and as many lines as before."""
    text = source.encode()
    lost = text[site.begin : site.end].count(b"\n")
    new = choice + ";" + "\\\n" * lost if isinstance(site.node, ast.stmt) else f"({choice}{chr(10) * lost})"
    return (text[: site.begin] + new.encode() + text[site.end :]).decode()


def _expressions(tree: ast.Module) -> Iterator[tuple[ast.expr | ast.stmt, str, str]]:
    """Yield what may be changed, with the name in the module that holds it and the function around it."""

    def walk(node: ast.AST, owner: str, function: str) -> Iterator[tuple[ast.expr | ast.stmt, str, str]]:
        match node:
            case ast.Raise() | ast.JoinedStr() | ast.Import() | ast.ImportFrom() | ast.Assert():
                return
            case ast.Expr(value=ast.Constant()):
                return  # docstring
            case ast.Call(func=ast.Attribute(attr="empty")):
                return  # more room changes no result, and less is an overrun
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                return
            case ast.FunctionDef(name=name):
                inside = function or (f"{owner}.{name}" if owner else name)
                held = owner or name
                defaults = [each for each in (*node.args.defaults, *node.args.kw_defaults) if each is not None]
                for each in defaults:
                    yield from walk(each, held, function)
                for statement in node.body:
                    yield from walk(statement, held, inside)
                return
            case ast.ClassDef(name=name):
                for statement in node.body:
                    yield from walk(statement, owner or name, function)
                return
            case ast.AnnAssign(value=value, target=target):
                if value is not None:
                    yield from walk(value, owner or _name(target), function)
                return
            case ast.Assign(value=ast.Tuple(elts=values), targets=[ast.Tuple(elts=targets)]) if not owner:
                for value, target in zip(values, targets, strict=True):
                    yield from walk(value, _name(target), function)
                return
            case ast.Assign(value=value, targets=[target]) if not owner:
                yield from walk(value, _name(target), function)
                return
            case ast.keyword(arg=arg) if arg in UNCHANGED:
                return
            case ast.expr() | ast.AugAssign():
                yield node, owner, function
        for child in ast.iter_child_nodes(node):
            yield from walk(child, owner, function)

    yield from walk(tree, "", "")


def _name(target: ast.expr) -> str:
    return target.id if isinstance(target, ast.Name) else ""


def _setting(node: ast.AST, **values: object) -> ast.AST:
    changed = copy.copy(node)
    for name, value in values.items():
        setattr(changed, name, value)
    return changed


def _changes(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the changes of one expression or statement."""
    match node:
        case ast.BinOp(op=op):
            for other in OPERATORS.get(type(op), ()):
                yield _setting(node, op=other())
        case ast.Compare(ops=ops):
            for place, op in enumerate(ops):
                for comparison in COMPARISONS[type(op)]:
                    yield _setting(node, ops=[*ops[:place], comparison(), *ops[place + 1 :]])
        case ast.BoolOp(op=op):
            yield _setting(node, op=ast.Or() if isinstance(op, ast.And) else ast.And())
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
            yield operand
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
            yield ast.Constant(value - 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(2.0 * value if value else 1.0)
            yield ast.Constant(0.5 * value if value else -1.0)
            yield ast.UnaryOp(ast.USub(), ast.Constant(value if value else 0.5))
        case ast.AugAssign(op=op):
            yield ast.Pass()
            for other in OPERATORS.get(type(op), ()):
                yield _setting(node, op=other())
        case ast.Attribute(value=value, attr="T"):
            yield value
        case ast.Call(func=func, args=args):
            yield from _call_changes(node, func, args)


def _call_changes(node: ast.Call, func: ast.expr, args: list[ast.expr]) -> Iterator[ast.AST]:
    called = func.attr if isinstance(func, ast.Attribute) else func.id if isinstance(func, ast.Name) else ""
    if called in EXCHANGED:
        yield _setting(
            node,
            func=_setting(func, **{"attr" if isinstance(func, ast.Attribute) else "id": EXCHANGED[called]}),
        )
    if called in DROPPED:
        if called == "transpose" and isinstance(func, ast.Attribute):
            yield func.value
        elif len(args) == 1:
            yield args[0]
    plain = not any(isinstance(each, ast.Starred) for each in args)
    if len(args) >= 2 and plain and ast.dump(args[0]) != ast.dump(args[1]) and called not in ORDERED:
        yield _setting(node, args=[args[1], args[0], *args[2:]])
