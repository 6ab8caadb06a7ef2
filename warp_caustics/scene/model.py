"""The base of all scene models: frozen, no unknown keys, and every fault found in one go."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic.functional_validators import ModelWrapValidatorHandler
from pydantic_core import ErrorDetails, InitErrorDetails
from typing_extensions import Self

from warp_caustics.scene.faults import did_you_mean, fault, faults_error, input_error, listed, shown
from warp_caustics.scene.values import Expects, Said

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)  # it has no public name


class _RaisesInputError(ModelMetaclass):
    """Calls a model so that its faults become an `InputError`.

    pydantic builds nested models without calling them, so that only the outermost call speaks.
    """

    def __call__(cls, *args: Any, **values: Any) -> Any:  # noqa: N805
        try:
            return super().__call__(*args, **values)
        except ValidationError as error:
            raise input_error(error, cls.__name__) from None


class Model(BaseModel, metaclass=_RaisesInputError):
    """A table of the scene file.

    Calling a model raises `InputError` with all faults; `model_validate` raises pydantic's own exception.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    #: Keys that a later version will know, with what to use instead.
    not_yet: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def rules(cls, given: Mapping[str, Any]) -> Iterator[str]:
        """Yield the faults that lie in which keys are given together; values are not checked yet."""
        yield from ()

    @model_validator(mode="wrap")
    @classmethod
    def _all_faults(cls, values: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Add the faults of `rules` to those of the fields, so that one does not hide the other."""
        if not isinstance(values, Mapping):
            return handler(values)
        faults = [fault(text) for text in cls.rules({key: value for key, value in values.items() if value is not None})]
        try:
            model = handler(values)
        except ValidationError as error:
            faults = [cls._worded(line) for line in error.errors(include_url=False)] + faults
        if faults:
            raise faults_error(cls.__name__, faults)
        return model

    @classmethod
    def _worded(cls, line: ErrorDetails) -> InitErrorDetails:
        """Return one of pydantic's faults in our words."""
        location, got = line["loc"], line["input"]
        key = location[-1] if location else ""
        match line["type"]:
            case "extra_forbidden":
                text = cls._unknown(str(key))
            case "missing":
                text = f"missing, expected {expectation(cls.model_fields[str(key)])}"
            case "model_type" | "model_attributes_type" | "dict_type":
                text = f"expected a table, got {shown(got)}"
            case "tuple_type":
                text = f"expected a list of tables, got {shown(got)}"
            case _:
                text = line["msg"]
        return fault(text, location)

    @classmethod
    def _unknown(cls, key: str) -> str:
        if key in cls.not_yet:
            return f"not yet in this version, {cls.not_yet[key]}"
        known = tuple(cls.model_fields)
        return f"unknown key, {did_you_mean(key, known) or f'expected {listed(known)}'}"


def exactly_one(given: Mapping[str, Any], names: tuple[str, ...]) -> Iterator[str]:
    """Yield a fault unless exactly one of these keys is given."""
    present = [name for name in names if name in given]
    if len(present) > 1:
        yield f"expected exactly one of {listed(names)}, got {listed(present, 'and')}"
    elif not present:
        yield f"expected exactly one of {listed(names)}, got none"


def expectation(field: FieldInfo) -> str:
    """Return in words what a field expects."""
    said = _said((field.annotation, *field.metadata))
    return said or ("a list of tables" if get_origin(field.annotation) is tuple else "a table")


def _said(parts: tuple[Any, ...]) -> str | None:
    """Return the first words found in a type and its metadata, looking into `Annotated` and unions."""
    for part in reversed(parts):
        if isinstance(part, (Expects, Said)):
            return part.text
    for part in parts:
        if get_origin(part) is Annotated or (get_args(part) and get_origin(part) is not tuple):
            words = _said(get_args(part))
            if words:
                return words
    return None
