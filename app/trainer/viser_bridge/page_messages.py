"""The messages that a page may send, narrower than viser's own declarations of them."""

import dataclasses
import typing
from typing import Annotated, Any

import msgspec

from app.trainer.viser_bridge.private_api import PAGE_MESSAGES


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
