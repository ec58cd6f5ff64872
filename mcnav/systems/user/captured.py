"""Code of a class or function that was defined in a notebook cell or script, as a file that any process can execute.

The file has the source of the object, and of all that it uses from the cells around it: imports, constants, functions
and classes. Where that cannot be read (a closure, an object that no literal states), the file holds a pickle by value
instead, and says so: it runs as well, but nobody can read it, and it is another file in every session.
"""

from __future__ import annotations

import ast
import base64
import dis
import inspect
import linecache
import sys
import textwrap
from collections.abc import Sequence
from types import CodeType, FunctionType, ModuleType
from typing import Any, Final

from mcnav.contract.quantities import Output, Source
from mcnav.entries.inputs import SourceFile

WRITTEN: Final = "# Source of {name}, kept by mcnav from the notebook or script that defined it.\n\n"

PICKLED: Final = """# The source of {name} could not be kept: {reason}.
# This is a pickle by value, which only this version of Python and of its packages is sure to load.

import base64

import cloudpickle

{name} = cloudpickle.loads(base64.b64decode("{pickle}"))
"""


class NoSource(Exception):
    """Raised for an object whose source cannot be kept; the message says why, as a clause."""


def captured_code(kind: type) -> SourceFile:
    """Return a file that defines a class as it is now."""
    return _file_of(kind, kind.__name__, "")


def captured_function(function: Any, name: str, sources: Sequence[Source], outputs: Sequence[Output]) -> SourceFile:
    """Return a file with a class whose ``propagate`` is a function of errors, (n, sources) to (n, outputs)."""
    own = function.__name__ if isinstance(function, FunctionType) and function.__name__.isidentifier() else "function"
    wrapper = "\n".join(
        [
            "", "", "from mcnav import Output, Source", "", "", f"class {name}:",
            f"    sources = ({', '.join(map(_declared, sources))},)",
            f"    outputs = ({', '.join(map(_declared, outputs))},)", "",
            "    def propagate(self, errors):", f"        return {own}(errors)", "",
        ]
    )  # fmt: skip
    return _file_of(function, own, wrapper, name)


def _declared(quantity: Source | Output) -> str:
    nominal = f", {quantity.nominal!r}" if isinstance(quantity, Source) else ""
    return f"{type(quantity).__name__}({quantity.name!r}, {quantity.unit!r}, {quantity.shown_in!r}{nominal})"


def _file_of(defined: Any, name: str, after: str, called: str = "") -> SourceFile:
    try:
        text = WRITTEN.format(name=name) + _Module(defined).text
    except NoSource as why:
        import cloudpickle

        pickle = base64.b64encode(cloudpickle.dumps(defined)).decode()
        text = PICKLED.format(name=name, reason=why, pickle=pickle)
    return SourceFile(f"{called or name}.py", text + after)


class _Module:
    """Text of an object and of what it uses, in an order in which it can be executed."""

    def __init__(self, defined: Any) -> None:
        self._imports: dict[str, str] = {}
        self._definitions: dict[str, str] = {}
        self._module = getattr(defined, "__module__", "")
        self._add(getattr(defined, "__name__", "?"), defined)

    @property
    def text(self) -> str:
        """Imports first, then constants and definitions, each after what it uses."""
        imports = "".join(f"{line}\n" for line in self._imports.values())
        return imports + "".join(f"\n\n{text}\n" for text in self._definitions.values())

    def _add(self, name: str, value: Any) -> None:
        """Add what a name stands for; `NoSource` when no text states it."""
        if name in self._imports or name in self._definitions:
            return
        if isinstance(value, ModuleType):
            self._imports[name] = f"import {value.__name__}" + ("" if value.__name__ == name else f" as {name}")
        elif isinstance(value, (type, FunctionType)) and value.__module__ == self._module:
            self._define(name, value)
        elif getattr(sys.modules.get(getattr(value, "__module__", None) or ""), str(name), None) is value:
            self._imports[name] = f"from {value.__module__} import {name}"
        elif isinstance(value, (type, FunctionType)) and "<locals>" not in value.__qualname__:
            self._imports[name] = f"from {value.__module__} import {value.__qualname__} as {name}"
        else:
            self._definitions[name] = f"{name} = {_literal(name, value)}"

    def _define(self, name: str, value: Any) -> None:
        """Add the source of a class or function, after what it uses."""
        text = source_of(value)
        if value.__name__ != name:
            raise NoSource(f"{value.__name__} goes by another name, {name}")
        known = functions_of(value)[0].__globals__  # `source_of` has found one
        for other in sorted(_globals_of(compile(text, name, "exec", dont_inherit=True)) - {name}):
            if other in known:
                self._add(other, known[other])
        self._definitions[name] = text


def _globals_of(code: CodeType) -> set[str]:
    """Return the names that code looks up outside of itself, with those of all code within."""
    instructions = list(dis.get_instructions(code))
    own = {instruction.argval for instruction in instructions if instruction.opname == "STORE_NAME"}
    used = {
        instruction.argval for instruction in instructions if instruction.opname in ("LOAD_GLOBAL", "LOAD_NAME")
    } - own
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            used |= _globals_of(constant)
    return used


def _literal(name: str, value: Any) -> str:
    """Return a constant as text; `NoSource` when no literal states it."""
    text = repr(value)
    try:
        if len(text) <= 10_000 and ast.literal_eval(text) == value:
            return text
    except (ValueError, SyntaxError, TypeError):
        pass
    raise NoSource(f"it uses {name}, a {type(value).__name__} that no literal states")


def source_of(defined: Any) -> str:
    """Return the source of a class or function, also of a notebook cell, without its indentation.

    Raises `NoSource` for a closure, a lambda, or code whose text is not kept.
    """
    name = defined.__name__
    if "<locals>" in defined.__qualname__ or not name.isidentifier():
        raise NoSource(f"{name} is defined within a function")
    for function in functions_of(defined):
        lines = linecache.getlines(function.__code__.co_filename)
        if not lines:
            continue
        text = "".join(lines)
        for node in ast.parse(text).body:
            if getattr(node, "name", None) == name and node.lineno <= function.__code__.co_firstlineno <= (
                node.end_lineno or node.lineno
            ):
                begin = min([node.lineno, *(mark.lineno for mark in node.decorator_list)])  # type: ignore[attr-defined]
                return textwrap.dedent("".join(lines[begin - 1 : node.end_lineno])).rstrip("\n")
    raise NoSource(f"the text of {name} is not kept by Python")


def functions_of(defined: Any) -> list[FunctionType]:
    """Return a function, or those that a class defines."""
    if isinstance(defined, FunctionType):
        return [inspect.unwrap(defined)]
    members = (getattr(member, "__func__", getattr(member, "fget", member)) for member in vars(defined).values())
    return [member for member in members if isinstance(member, FunctionType)]
