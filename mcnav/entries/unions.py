"""Tables of several forms: told apart by a key that one of them alone has, or by the text of a key."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, ClassVar, Final, Literal, get_args, get_origin

from pydantic import (
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
)
from pydantic_core.core_schema import (
    CoreSchema,
    no_info_wrap_validator_function,
    with_info_plain_validator_function,
    with_info_wrap_validator_function,
)

from mcnav.entries.mistakes import Mistake, refuse, told
from mcnav.entries.quantities import UNIT, JsonSchema, Table, json_schema_of
from mcnav.entries.values import display
from mcnav.errors import LONGEST_VALUE, suggestion
from mcnav.physics.units import printable

BY_KEY: Final = "x-by-key"
"""Key of a JSON schema that stands for tables told apart by their first keys; see `mcnav.entries.quantities.UNIT`."""

BY_TYPE: Final = "x-by-type"
"""Key of a JSON schema that stands for tables told apart by the text of a key: this key."""

EITHER: Final = "x-either"
"""Key of a JSON schema that stands for tables of which another part of the file decides which one it is."""

OR_FIRST: Final = "x-or-first"
"""Key of a JSON schema that stands for tables, and for a quantity in place of one of them."""

BY_FORM: Final = "x-by-form"
"""Key of a JSON schema that stands for types told apart by the form of the entry."""

TEXT: Final = "x-text"
"""Pattern of a text that stands for a table."""


def key_of(table: type[Table]) -> str:
    """Return the key by which a table is told from others: its first."""
    return next(iter(table.model_fields))


@dataclass(frozen=True)
class ByKey:
    """Annotation of a union of tables, each with a first key of its own.

    Attributes
    ----------
    expected : str
        What the keys are, for messages: *it is one of*.
    form : str
        Message about an entry that is no table.
    text : str, optional
        Pattern of texts that stand for a table; whoever reads the entry treats them before.
    """

    expected: str
    form: str = ""
    text: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        tables: Mapping[str, type[Table]] = {key_of(table): table for table in get_args(source)}

        def read(entry: object, _: object) -> Table:
            if not isinstance(entry, Mapping):
                raise told(self.form or f"got {display(entry)}; expected a table")
            return tables[self._key(entry, list(tables))].model_validate(entry)

        return no_info_wrap_validator_function(read, handler(source))

    def _key(self, entry: Mapping[str, object], keys: list[str]) -> str:
        """Return the one key of several that an entry has."""
        given = [key for key in keys if key in entry]
        if len(given) == 1:
            return given[0]
        if given:
            raise told(f"got {' and '.join(given)}; {self.expected} {', '.join(keys)}")
        hints = [hint for key in entry if "did you mean" in (hint := suggestion(key, keys))]
        near = hints[0] if hints else f"; {self.expected} {', '.join(keys)}"
        came = f": got {printable(', '.join(entry), LONGEST_VALUE)}" if entry else ""
        raise told(f"has no kind{came}{near}")

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**handler(schema), BY_KEY: True, **({TEXT: self.text} if self.text else {})}


class Family(Table):
    """A table of a `ByType` for all texts that begin with a prefix; each has a table of its own.

    Attributes
    ----------
    prefix : str
    """

    prefix: ClassVar[str]

    @classmethod
    def member(cls, text: str) -> type[Table]:
        """Return the table of a text; `ValidationError` when there is none."""
        return cls


@dataclass(frozen=True)
class ByType:
    """Annotation of a union of tables, told apart by the text of a key.

    The key is a ``Literal`` in each, but for a `Family`; a table with a default for it needs none.
    """

    key: str = "type"

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        of_union: tuple[type[Table], ...] = get_args(source)
        families = {member.prefix: member for member in of_union if issubclass(member, Family)}
        tables: Mapping[str, type[Table]] = {
            get_args(member.model_fields[self.key].annotation)[0]: member
            for member in of_union
            if member not in families.values()
        }
        names = [*tables, *(f"{prefix}NAME" for prefix in families)]
        usual = next((table for table in tables.values() if not table.model_fields[self.key].is_required()), None)

        def table(name: object) -> type[Table]:
            if isinstance(name, str):
                if name in tables:
                    return tables[name]
                for prefix, family in families.items():
                    if name.startswith(prefix):
                        return family.member(name)
            raise refuse([Mistake(f"got {display(name)}{suggestion(str(name), names)}", (self.key,))])

        def read(entry: object, _: object, info: ValidationInfo) -> Table:
            if not isinstance(entry, Mapping):
                raise told(f"got {display(entry)}; expected a table with a {self.key}")
            if self.key not in entry and usual is None:
                raise refuse([Mistake(f"is missing; it is one of {', '.join(names)}", (self.key,))])
            known = usual if usual is not None and self.key not in entry else table(entry[self.key])
            return known.model_validate(entry, context=info.context)

        return with_info_wrap_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**handler(schema), BY_TYPE: self.key}


@dataclass(frozen=True)
class ByTypeIn:
    """Annotation of one of many tables, told apart by the text of their ``type``, each made when it is asked for."""

    tables: Mapping[str, type[Table]]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(entry: object, info: ValidationInfo) -> Table:
            if not isinstance(entry, Mapping):
                raise told(f"got {display(entry)}; expected a table with a type")
            if "type" not in entry:
                raise refuse([Mistake(f"is missing; it is one of {', '.join(self.tables)}", ("type",))])
            name = entry["type"]
            if not isinstance(name, str) or name not in self.tables:
                raise refuse([Mistake(f"got {display(name)}{suggestion(str(name), list(self.tables))}", ("type",))])
            return self.tables[name].model_validate(entry, context=info.context)

        return with_info_plain_validator_function(read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**json_schema_of(reduce(operator.or_, self.tables.values()), handler), BY_TYPE: "type"}


@dataclass(frozen=True)
class OrFirst:
    """Annotation of tables for one of which its ``key`` alone may stand, a quantity of type ``form``."""

    table: type[Table]
    key: str
    form: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        alone: TypeAdapter[Any] = TypeAdapter(self.form)

        def read(entry: object, tables: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
            if isinstance(entry, Mapping):
                return tables(entry)
            return self.table.model_construct(**{self.key: alone.validate_python(entry, context=info.context)})

        return with_info_wrap_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {OR_FIRST: handler(schema), UNIT: TypeAdapter(self.form).json_schema()[UNIT]}


@dataclass(frozen=True)
class ByForm:
    """Annotation of a union of types told apart by the form of the entry: a table, some texts, or else the last."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        forms = [(kind, TypeAdapter[Any](kind)) for kind in get_args(source)]

        def read(entry: object, _: object, info: ValidationInfo) -> Any:
            form = next((form for kind, form in forms[:-1] if _has_form(entry, kind)), forms[-1][1])
            return form.validate_python(entry, strict=True, context=info.context)

        return with_info_wrap_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**handler(schema), BY_FORM: True}


def _has_form(entry: object, of: Any) -> bool:
    """Return whether an entry has the form of a table, or is one of some texts."""
    if get_origin(of) is Literal:
        return isinstance(entry, str) and entry in get_args(of)
    return isinstance(entry, Mapping)


@dataclass(frozen=True)
class Either:
    """Annotation of a union of tables for editors: which one it is, another part of the file decides."""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**handler(schema), EITHER: True}
