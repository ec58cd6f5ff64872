"""Fields of a campaign file as pydantic models: quantities with their units, and tables whose keys must be known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import FunctionType
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    StringConstraints,
    TypeAdapter,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    model_validator,
)
from pydantic_core.core_schema import (
    CoreSchema,
    any_schema,
    no_info_before_validator_function,
    no_info_plain_validator_function,
    no_info_wrap_validator_function,
)

from mcnav.entries.mistakes import Mistake, explain_keys, refuse, told
from mcnav.entries.rules import Rule
from mcnav.entries.values import display
from mcnav.errors import suggestion
from mcnav.physics.units import quantity

JsonSchema = dict[str, Any]

UNIT: Final = "x-unit"
"""Key of a JSON schema that stands for a quantity: its SI unit; `mcnav.config.json_schema` writes it out."""


@dataclass(frozen=True)
class QuantityIn:
    """Annotation of a field that holds a quantity with its unit, which is read into an SI unit."""

    unit: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_before_validator_function(lambda value: quantity(value, self.unit), handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**handler(schema), UNIT: self.unit}


Length = Annotated[float, QuantityIn("m")]


Duration = Annotated[float, QuantityIn("s")]


Speed = Annotated[float, QuantityIn("m/s")]


Acceleration = Annotated[float, QuantityIn("m/s^2")]


AreaPerMass = Annotated[float, QuantityIn("m^2/kg")]


TimePerLength = Annotated[float, QuantityIn("s/m")]


PerLength = Annotated[float, QuantityIn("1/m")]


Angle = Annotated[float, QuantityIn("rad")]


AngularRate = Annotated[float, QuantityIn("rad/s")]


GravitationalParameter = Annotated[float, QuantityIn("m^3/s^2")]


Number = Annotated[float, QuantityIn("1")]


Probability = Annotated[Number, Field(gt=0.0, lt=1.0)]


Written = Annotated[Any, WithJsonSchema({UNIT: ""})]
"""A quantity whose unit another part of the file decides; it is read later."""


Text = Annotated[
    str,
    StringConstraints(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*[^\x00-\x20\x7f][^\x00-\x1f\x7f]*$"),
]


class Table(BaseModel):
    """A table whose keys must be known and whose values must have the right type.

    Attributes
    ----------
    rules : tuple of Rule
        What its keys must fulfil together.
    expected : str
        What it should be, for messages about its form; by default any table.
    refused : mapping of str to str
        Why some keys, which other tables like it have, are not known.
    called : str
        What it is called in messages about keys that are unknown or missing; by default nothing.
    told_by : str
        The key by which it is told from other tables, if messages about others should not list it.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)
    rules: ClassVar[tuple[Rule, ...]] = ()
    expected: ClassVar[str] = ""
    refused: ClassVar[Mapping[str, str]] = {}
    called: ClassVar[str] = ""
    told_by: ClassVar[str] = ""

    @model_validator(mode="wrap")
    @classmethod
    def _read(cls, entry: Any, read: ModelWrapValidatorHandler[Self]) -> Self:
        if cls.expected and not isinstance(entry, (dict, cls)):
            raise told(f"got {entry!r}; {cls.expected}")
        try:
            table = read(entry)
        except ValidationError as invalid:
            known = {name: field.is_required() for name, field in cls.model_fields.items() if name != cls.told_by}
            raise explain_keys(invalid, known, cls.refused, cls.called) from None
        given = {name for name in table.model_fields_set if getattr(table, name) is not None}
        nothing = [Mistake("got None; leave it out", (name,)) for name in sorted(table.model_fields_set - given)]
        broken = [] if nothing else [rule.broken(given, cls.expected) for rule in cls.rules]
        if mistakes := [*nothing, *(mistake for mistake in broken if mistake is not None)]:
            raise refuse(mistakes)
        return table

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        node = handler.resolve_ref_schema(handler(schema))
        for rule in cls.rules:
            required = [*node.get("required", ()), *rule.schema.get("required", ())]  # type: ignore[misc]
            node |= {**rule.schema, **({"required": required} if required else {})}
        return node


@dataclass(frozen=True)
class OneOf:
    """Annotation of a text that is one of several names; ``hint`` ends the message about another."""

    names: tuple[str, ...]
    hint: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(entry: object) -> object:
            if isinstance(entry, str) and entry in self.names:
                return entry
            raise told(f"got {display(entry)}{suggestion(str(entry), list(self.names))}{self.hint}")

        return no_info_plain_validator_function(read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {"enum": list(self.names)}


NAME_OF: Final = "x-name-of"
"""Key of a JSON schema that stands for names that the scenario decides: what they are names of."""


@dataclass(frozen=True)
class NameOf:
    """Annotation of a text that names an error source, or an output, of the campaign's scenario."""

    what: Literal["source", "output"]

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**handler(schema), NAME_OF: self.what}


SourceName = Annotated[str, NameOf("source")]
OutputName = Annotated[str, NameOf("output")]


@dataclass(frozen=True)
class Suggested:
    """Annotation of a text for which editors suggest some names, and which may be another of a pattern."""

    names: tuple[str, ...]
    pattern: str

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        told = {key: value for key, value in handler(schema).items() if key != "type"}
        return {**told, "anyOf": [{"enum": list(self.names)}, {"type": "string", "pattern": self.pattern}]}


@dataclass(frozen=True)
class Distinct:
    """Annotation of a list for editors: no entry comes twice, and some are there."""

    needed: tuple[str, ...] = ()

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        contained: JsonSchema = {}  # a chain and no ``allOf``, which not every editor follows
        for name in reversed(self.needed):
            contained = {"contains": {"enum": [name]}, **({"if": True, "then": contained} if contained else {})}
        return {**handler(schema), "uniqueItems": True, **contained}


@dataclass(frozen=True)
class Pair:
    """Annotation of a list of two; ``expected`` is the message about another entry."""

    expected: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(entry: object, pair: ValidatorFunctionWrapHandler) -> Any:
            if not isinstance(entry, list) or len(entry) != 2:
                raise told(self.expected)
            return pair(entry)

        return no_info_wrap_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        return {**handler(schema), "minItems": 2, "maxItems": 2}


def json_schema_of(form: Any, handler: GetJsonSchemaHandler) -> JsonSchema:
    """Return the JSON schema of another type in place of that of an annotated one."""
    core = TypeAdapter(form).core_schema
    return handler(no_info_before_validator_function(lambda entry: entry, core))  # by which the type's own is called


@dataclass(frozen=True)
class Later:
    """Annotation of an entry that is read later, as a model or type; its schema is that of the type.

    A function of no arguments in place of a type returns it when a schema is asked for.
    """

    form: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return any_schema()

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        form = self.form() if isinstance(self.form, FunctionType) else self.form
        return json_schema_of(form, handler)
