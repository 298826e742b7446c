"""Preset files: one preset of one's own, in the format of the presets that ship."""

from pathlib import Path

import msgspec

from app.simulation.preset import Preset, preset_named, presets

__all__ = ["chosen_preset", "preset_toml", "read_preset"]

SUFFIX = ".toml"
MOST_BYTES = 100_000

_HEADER = """\
# A preset of bluntdissect: give it as --preset FILE, or open it under Model in the trainer.
# mm, N and MPa; what each line means stands at the top of assets/presets.toml.

"""


class _PresetFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    preset: list[Preset]


def preset_toml(preset: Preset) -> bytes:
    """Return a preset as a file: TOML with one `[[preset]]`, its numbers to the last bit."""
    lines = {name: each for name, each in msgspec.to_builtins(preset).items() if each is not None}
    return _HEADER.encode() + msgspec.toml.encode({"preset": [lines]})


def read_preset(content: bytes, name: str) -> Preset:
    """Return the preset in a file."""
    if len(content) > MOST_BYTES:
        raise ValueError(f"{name} is no preset: it has more than {MOST_BYTES:,} bytes")
    try:
        found = msgspec.toml.decode(content, type=_PresetFile).preset
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        where = str(error).replace("`$.preset[0].", "`").replace(" - at `$.preset[0]`", "")
        raise ValueError(f"{name} is no preset: {where}") from None
    if len(found) != 1:
        raise ValueError(f"{name} must have one [[preset]], it has {len(found)}")
    return found[0]


def chosen_preset(text: str) -> Preset:
    """Return the preset that somebody names: one that ships, or a file's."""
    if text in presets():
        return preset_named(text)
    if Path(text).suffix.lower() != SUFFIX:
        raise ValueError(
            f"unknown preset {text!r}; there are: {', '.join(presets())}, or a file, *{SUFFIX}"
        )
    try:
        with Path(text).open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise ValueError(f"cannot read {text}: {(error.strerror or str(error)).lower()}") from error
    return read_preset(content, text)
