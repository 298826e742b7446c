"""The messages that a page may send, narrower than viser's own declarations of them."""

import dataclasses
import typing
from collections.abc import Callable
from operator import attrgetter
from typing import Annotated, Any

import msgspec

from app.trainer.viser_bridge.private_api import PAGE_MESSAGES

__all__ = ["page_message_decoder", "viser_message"]


def page_message_decoder() -> msgspec.msgpack.Decoder[Any]:
    """Return a decoder of what a page may send; any other kind, field or type raises."""
    # viser's own declarations, narrower: it takes other fields and types, and fails on them later.
    structs = [
        msgspec.defstruct(
            kind.__name__,
            [
                (field.name, _narrow(hints[field.name]), *_default(field))
                for field in sorted(dataclasses.fields(kind), key=lambda each: len(_default(each)))
            ],
            tag=kind.__name__,
            forbid_unknown_fields=True,
        )
        for kind in PAGE_MESSAGES
        for hints in (typing.get_type_hints(kind),)
    ]
    return msgspec.msgpack.Decoder(typing.Union[tuple(structs)])  # noqa: UP007


def viser_message(decoded: msgspec.Struct) -> Any:
    """Return what was decoded as viser's own message, as viser would have made it."""
    kind, fields, changed = _KINDS[type(decoded).__name__]
    values = [getattr(decoded, name) for name in fields]
    for place, change in changed:
        values[place] = change(values[place])
    return kind(*values)


def _whole(number: float) -> float:
    return int(number) if number.is_integer() else number


def _changes(hint: Any) -> Callable[[Any], Any] | None:
    """Return what makes viser's value of a field's decoded one, if that is another."""
    if hint is int:
        return int
    if hint == typing.Optional[int]:  # noqa: UP045
        return lambda value: None if value is None else _whole(value)
    if typing.get_origin(hint) is dict:
        value_of = attrgetter("value")
        return lambda updates: {"value": value_of(updates)}
    return tuple if typing.get_args(hint)[1:] == (...,) else None


def _kind(kind: type[Any]) -> tuple[type[Any], list[str], list[tuple[int, Callable[[Any], Any]]]]:
    hints = typing.get_type_hints(kind)
    names = [field.name for field in dataclasses.fields(kind)]
    changes = [(place, _changes(hints[name])) for place, name in enumerate(names)]
    return kind, names, [(place, change) for place, change in changes if change is not None]


_KINDS = {kind.__name__: _kind(kind) for kind in PAGE_MESSAGES}


# Not NaN, which no comparison holds of; and JavaScript has one type for whole and other numbers.
_Number = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]
_Text = Annotated[str, msgspec.Meta(max_length=100_000)]


class _Value(msgspec.Struct, forbid_unknown_fields=True):
    """All that a page may set of a widget; viser would set any attribute of its handle."""

    # Whoever takes a number from a widget takes care of one that is none.
    value: (
        bool
        | int
        | float
        | _Text
        | Annotated[list[int | float], msgspec.Meta(max_length=16)]
        | None
    )


def _narrow(hint: Any) -> Any:
    """Return a field's type without numbers and texts out of all bounds."""
    if hint in (int, float):
        return _Number
    if hint is str:
        return _Text
    if typing.get_origin(hint) is dict:
        return _Value
    if typing.get_origin(hint) is typing.Literal or not (inner := typing.get_args(hint)):
        return hint
    if inner[-1] is ...:
        return Annotated[list[_narrow(inner[0])], msgspec.Meta(max_length=16)]
    return hint.copy_with(tuple(_narrow(each) for each in inner))


def _default(field: "dataclasses.Field[Any]") -> tuple[Any, ...]:
    return () if field.default is dataclasses.MISSING else (field.default,)
