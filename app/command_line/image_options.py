"""Text options for which images to read and where in them the organ is."""

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from organ_geometry import Region, Seed

Choice = TypeVar("Choice", bound=str)


def chosen(option: str, text: str, offered: "tuple[Choice, ...]") -> "Choice":
    """Return a choice, if it is one of those offered."""
    for one in offered:
        if one == text:
            return one
    raise ValueError(f"{option} must be {', '.join(offered[:-1])} or {offered[-1]}, not {text}")


def pixel_pair(text: str | None) -> tuple[float, float] | None:
    """Return "0.1" as (0.1, 0.1) and "0.1,0.2" as (0.1, 0.2)."""
    if text is None:
        return None
    sizes = _numbers(text)
    if len(sizes) not in (1, 2):
        raise ValueError(
            f"--pixel-size must be one number or two, mm, as 0.1 or 0.1,0.2, not {text}"
        )
    return sizes[0], sizes[-1]


def window_levels(text: str | None) -> tuple[float, float] | None:
    """Return "-150,500" as (-150, 500)."""
    if text is None:
        return None
    levels = _numbers(text)
    if len(levels) != 2:
        raise ValueError(
            f"--window must be the lowest and the highest value kept, as -150,500, not {text}"
        )
    return levels[0], levels[1]


def seed_point(text: str | None) -> "Seed | None":
    """Return "120,95" as (120, 95), and "120,95,30" likewise."""
    if text is None:
        return None
    point = _numbers(text)
    if len(point) == 2:
        return point[0], point[1]
    if len(point) == 3 and point[2].is_integer():
        return point[0], point[1], int(point[2])
    raise ValueError(
        f"--seed must be a pixel of the organ, column,row as 120,95 in the first image or "
        f"column,row,image as 120,95,30, not {text}"
    )


def region(text: str | None) -> "Region | None":
    """Return "0,0,9,9" as (0, 0, 9, 9), and six numbers likewise."""
    if text is None:
        return None
    try:
        numbers = [int(field) for field in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == 4:
        return numbers[0], numbers[1], numbers[2], numbers[3]
    if len(numbers) == 6:
        return numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]
    raise ValueError(
        f"--roi must be four or six whole numbers, x0,y0,x1,y1 or x0,y0,x1,y1,first,last, "
        f"not {text}"
    )


def _numbers(text: str) -> list[float]:
    """Return the numbers between the commas, none if one of them is no number."""
    try:
        return [float(field) for field in text.split(",")]
    except ValueError:
        return []
