"""Draw the site's diagrams as SVG, the architecture from the imports that the code has.

The critical view is drawn over a still that `examples/scope_stills.py` took.

python examples/diagrams.py docs/images
"""

import base64
import sys
from collections.abc import Iterable
from pathlib import Path

import grimp

PACKAGES = ("app", "organ_geometry", "physics", "assets", "kernel_cache")
GIVES = {
    "app.command_line": "options, reports, exit status",
    "app.trainer": "pages, scenes, panels, server",
    "app.classroom": "classes, courses, results",
    "app.export": "files for other tools",
    "app.haptics": "devices at 1 kHz",
    "app.rl": "environments, data sets",
    "app.study": "many ducts, fits",
    "app.validation": "tables, predictions",
    "app.compression": "organs from images",
    "app.anatomy": "several tubes, patients",
    "app.peel": "scenes from TOML",
    "app.simulation": "sessions, runs, errors",
    "organ_geometry": "images to organs to meshes",
    "physics": "beams, strands, rupture",
    "assets": "presets, beds, phantom",
    "kernel_cache": "compiled code",
}
STILL = Path(__file__).parents[1] / "docs" / "images" / "scope-window.webp"
STILL_SIZE = 760, 520
"""Px. What the critical view points at are places in this picture: another still needs others."""
INK, LINE, FILL, TEXT = "#1f2d3d", "#7a8ca0", "#e8f1f2", 'font-family="sans-serif"'


class Drawing:
    """An SVG of a size in px."""

    def __init__(self, width: int, height: int, title: str) -> None:
        self._lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'width="{width}" height="{height}" role="img">',
            f"<title>{title}</title>",
            '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
            'markerHeight="7" orient="auto">'
            f'<path d="M0 0L8 4L0 8z" fill="{INK}"/></marker></defs>',
            f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        ]

    def box(self, x: float, y: float, w: float, h: float, fill: str = FILL) -> None:
        """Draw a rounded box."""
        self._lines.append(
            f'<rect x="{x}" y="{y}" width="{w}" height="{h}" rx="6" fill="{fill}" stroke="{INK}"/>'
        )

    def text(
        self, x: float, y: float, words: str, *, size: int = 13, anchor: str = "middle",
        bold: bool = False, colour: str = INK,
    ) -> None:  # fmt: skip
        """Write words at a point."""
        weight = ' font-weight="bold"' if bold else ""
        self._lines.append(
            f'<text x="{x}" y="{y}" {TEXT} font-size="{size}" text-anchor="{anchor}"{weight} '
            f'fill="{colour}">{words}</text>'
        )

    def path(
        self, d: str, *, colour: str = INK, width: float = 1.5, arrow: bool = False,
        dashed: bool = False, fill: str = "none",
    ) -> None:  # fmt: skip
        """Draw a path."""
        tip = ' marker-end="url(#tip)"' if arrow else ""
        dashes = ' stroke-dasharray="5 4"' if dashed else ""
        self._lines.append(
            f'<path d="{d}" fill="{fill}" stroke="{colour}" stroke-width="{width}"{dashes}{tip}/>'
        )

    def picture(self, path: Path, width: int, height: int) -> None:
        """Lay a WebP picture into the top left corner; the SVG holds all of it."""
        content = base64.b64encode(path.read_bytes()).decode()
        self._lines.append(
            f'<image width="{width}" height="{height}" href="data:image/webp;base64,{content}"/>'
        )

    def save(self, path: Path) -> None:
        """Write the file."""
        path.write_text("\n".join([*self._lines, "</svg>", ""]))


def room(module: str) -> str:
    """Return the package of the figure that a module is in."""
    names = module.split(".")
    return ".".join(names[:2]) if names[0] == "app" and len(names) > 1 else names[0]


def imports() -> dict[str, set[str]]:
    """Return which of the figure's packages import which."""
    graph = grimp.build_graph(*PACKAGES)
    found: dict[str, set[str]] = {name: set() for name in GIVES if name in map(room, graph.modules)}
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            here, there = room(module), room(other)
            if here != there and here in found and there in found:
                found[here].add(there)
    return found


def floors(found: dict[str, set[str]]) -> list[list[str]]:
    """Return the packages from the top floor down: each stands above all that it imports."""
    level: dict[str, int] = {}

    def height(name: str, above: tuple[str, ...] = ()) -> int:
        if name not in level:
            level[name] = 1 + max(
                (
                    height(other, (*above, name))
                    for other in sorted(found[name])
                    if other not in (*above, name)  # an import that closes a circle
                ),
                default=-1,
            )
        return level[name]

    for name in found:
        height(name)
    top = max(level.values())
    return [[name for name in found if level[name] == floor] for floor in range(top, -1, -1)]


def architecture(path: Path) -> None:
    """Draw the packages in floors; an import goes down, to the package it names."""
    found = imports()
    rows = floors(found)
    wide, high, gap = 186, 46, 44
    width = max(len(row) for row in rows) * (wide + 18) + 18
    drawing = Drawing(width, len(rows) * (high + gap) + 10, "Packages, each above what it imports")
    place: dict[str, tuple[float, float]] = {}
    for floor, row in enumerate(rows):
        for i, name in enumerate(row):
            left = (width - len(row) * (wide + 18)) / 2 + 9
            place[name] = left + i * (wide + 18), 12 + floor * (high + gap)
    for name, others in found.items():
        for other in reached_only_directly(found, name, others):
            (x, y), (u, v) = place[name], place[other]
            middle = 0.5 * (y + high + v)
            drawing.path(
                f"M{x + wide / 2} {y + high}C{x + wide / 2} {middle} {u + wide / 2} {middle} "
                f"{u + wide / 2} {v}",
                colour=LINE, arrow=True,
            )  # fmt: skip
    for name, (x, y) in place.items():
        drawing.box(x, y, wide, high)
        drawing.text(x + wide / 2, y + 19, name.replace("app.", "app/"), bold=True)
        drawing.text(x + wide / 2, y + 36, GIVES[name], size=12)
    drawing.save(path)


def reached_only_directly(
    found: dict[str, set[str]], name: str, others: Iterable[str]
) -> list[str]:
    """Return those that a package imports and that none of its other imports leads to."""

    def below(start: str) -> set[str]:
        out: set[str] = set()
        waiting = list(found[start])
        while waiting:
            each = waiting.pop()
            if each not in out:
                out.add(each)
                waiting += found[each]
        return out

    others = set(others)
    return sorted(each for each in others if not any(each in below(o) for o in others - {each}))


def frames(path: Path) -> None:
    """Draw the beam's frame, the clamps, the grasp and its force."""
    drawing = Drawing(720, 300, "A duct between its clamps, and the beam's frame")
    for x in (110, 610):
        drawing.path(f"M{x} 150V230", width=5)
        for i in range(6):
            step = -12 if x < 300 else 12
            drawing.path(f"M{x} {152 + 15 * i}l{step} 10", colour=LINE)
    drawing.path("M110 190H610", colour=LINE, dashed=True)
    drawing.path(
        "M110 190C230 190 270 110 360 110C450 110 490 190 610 190", width=9, colour="#c7a17a"
    )
    drawing.path("M360 110V30", arrow=True, width=2.5)
    drawing.text(372, 40, "F, force of the hand (N)", anchor="start")
    drawing.path("M330 190V116", arrow=True, colour=LINE)
    drawing.text(338, 160, "deflection (mm)", anchor="start", size=12)
    drawing.path("M110 255H356", arrow=True, colour=LINE)
    drawing.text(233, 273, "a: station of the grasp, along the axis (mm)", size=12)
    drawing.path("M110 288H604", arrow=True, colour=LINE)
    drawing.text(560, 283, "S = a + b: span", anchor="end", size=12)
    drawing.path("M40 110V50", arrow=True)
    drawing.path("M40 110H100", arrow=True)
    drawing.path("M40 110L16 134", arrow=True)
    for x, y, words in ((40, 42, "z, away from the bed"), (104, 128, "x"), (10, 150, "y")):
        drawing.text(x, y, words, size=12, anchor="start" if x > 20 else "middle")
    drawing.text(92, 250, "first clamp", size=12, anchor="end")
    drawing.text(628, 250, "second clamp", size=12, anchor="start")
    drawing.text(360, 216, "freed: these strands have parted", size=12)
    for i in range(24):
        x = 124 + 21 * i
        u = abs(x - 360) / 250
        top = 190 - 80 * (1 - u) ** 2 * (1 + 2 * u)
        if 250 < x < 470:
            drawing.path(f"M{x} {top + 6}l3 9M{x} 240l-2 -9", colour=LINE, width=1)
        else:
            drawing.path(f"M{x} {top + 5}L{x} 240", colour=LINE, width=1)
    drawing.save(path)


def organ_file(path: Path) -> None:
    """Draw what an organ file holds, in its order."""
    drawing = Drawing(960, 236, "An organ file: frame, axis, key sections")
    layers = (
        (100, "0x89 0xE3", "magic, version"),
        (100, "CRC-16", "over the rest"),
        (160, "settings", "lumen, tolerance, steps"),
        (180, "axis", "two ends, bends of a spline"),
        (180, "key sections", "which stations are kept"),
        (212, "16 shape numbers each", "outer boundary, then lumen"),
    )
    x = 14.0
    for i, (width, title, words) in enumerate(layers):
        drawing.box(x, 34, width, 62, FILL if i > 1 else "#f6e7cf")
        drawing.text(x + width / 2, 60, title, bold=True)
        drawing.text(x + width / 2, 80, words, size=12)
        x += width
    drawing.text(114, 24, "4 bytes", size=12)
    drawing.path("M214 112V118H946V112", colour=LINE)
    drawing.text(
        580,
        136,
        "whole numbers, packed by an adaptive range coder: 38 bytes for the phantom",
        size=12,
    )
    drawing.path("M60 186C260 146 560 226 900 172", width=2.5, colour="#c7a17a")
    for u, (cx, cy, rx, ry) in enumerate(
        (
            (60, 186, 9, 24),
            (240, 172, 10, 27),
            (480, 186, 8, 22),
            (700, 195, 10, 25),
            (900, 172, 9, 23),
        )
    ):
        drawing.path(
            f"M{cx} {cy - ry}A{rx} {ry} 0 1 1 {cx} {cy + ry}A{rx} {ry} 0 1 1 {cx} {cy - ry}",
            fill="#f9f1e6",
        )
        if u in (0, 4):
            drawing.text(cx, cy + ry + 14, "end", size=11)
    drawing.text(360, 170, "axis", size=12)
    drawing.text(560, 226, "key section: two half-curves of degree 6", size=12)
    drawing.save(path)


def critical_view(path: Path) -> None:
    """Name the structures and the three parts of the critical view, over the program's picture."""
    width, height = STILL_SIZE
    drawing = Drawing(width, height + 88, "The critical view of safety, through the laparoscope")
    drawing.picture(STILL, width, height)
    for words, x, y, anchor, start, to in (
        ("gallbladder", 14, 40, "start", (44, 46), (185, 105)),
        ("3", 250, 56, "middle", (254, 62), (322, 168)),
        ("cystic duct", 14, 470, "start", (44, 456), (428, 268)),
        ("2", 36, 250, "middle", (44, 250), (452, 262)),
        ("cystic artery", 746, 60, "end", (646, 56), (424, 236)),
        ("right hepatic artery", 746, 122, "end", (596, 118), (470, 222)),
        ("common duct", 746, 470, "end", (700, 456), (540, 300)),
    ):
        drawing.path(f"M{start[0]} {start[1]}L{to[0]} {to[1]}", colour="#ffffff", width=1.2)
        drawing.path(
            f"M{to[0] - 2} {to[1]}a2 2 0 1 0 4 0a2 2 0 1 0 -4 0", colour="#ffffff", width=2
        )
        drawing.text(x, y, words, anchor=anchor, bold=True, colour="#ffffff")
    for i, words in enumerate(
        (
            "1  Only cystic duct and artery enter the gallbladder, free all round.",
            "2  The triangle between cystic duct, common duct and liver is cleared of fat.",
            "3  The lower third of the gallbladder is freed from the cystic plate.",
        )
    ):
        drawing.text(14, height + 26 + 24 * i, words, anchor="start", size=14)
    drawing.save(path)


def main(folder: str) -> None:
    """Write all diagrams into a folder."""
    to = Path(folder)
    architecture(to / "architecture.svg")
    frames(to / "frames.svg")
    organ_file(to / "organ-file.svg")
    critical_view(to / "critical-view.svg")


if __name__ == "__main__":
    main(sys.argv[1])
