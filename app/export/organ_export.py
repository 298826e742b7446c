"""An organ as a file for other tools: which kinds there are, and how each is written."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path

from app.export.motion import Motion
from app.export.rigged_organ import rigged_organ
from app.export.snapshot import ORGAN, Snapshot
from app.export.vtk_series import check_series_path, snapshot_contents, write_series
from app.simulation import PIECES, Dissection, Specimen
from organ_geometry import check_target, write_atomic
from organ_geometry.mesh import COLORED_SUFFIXES, TornPiece, mesh_content, organ_skin, stress_colors
from organ_geometry.mesh import SUFFIXES as MESH_SUFFIXES

SUFFIXES = (*MESH_SUFFIXES, ".vtp", ".pvd", ".csv")
"""Suffixes of the files that can be written."""


@dataclass(frozen=True, slots=True)
class ExportResult:
    """What was written."""

    kind: str  # in words
    force: float  # of the hand at the end, N; for torn pieces, at the break
    deflection: float  # of the grasp at that force, mm; 0 for torn pieces, which have swung back
    surfaces: tuple[str, ...] = ()  # names of the closed surfaces; none in a table
    vertices: int = 0
    faces: int = 0
    animations: tuple[str, ...] = ()  # names of the motions
    files: tuple[Path, ...] = ()  # the one that was asked for first

    @classmethod
    def of(cls, kind: str, snapshot: Snapshot, files: tuple[Path, ...] = ()) -> "ExportResult":
        """Return the description of a snapshot's file."""
        surfaces = snapshot.surfaces
        return cls(
            kind,
            snapshot.force,
            snapshot.deflection,
            tuple(surface.name for surface in surfaces),
            sum(len(surface.vertices) for surface in surfaces),
            sum(len(surface.skin.faces) for surface in surfaces),
            files=files,
        )


@dataclass(frozen=True)
class OrganExport(ABC):
    """An organ in motion, to be written as a file."""

    specimen: Specimen
    _: KW_ONLY
    static: bool = False  # write a GLB without motion
    stress_colors: bool = False  # colour vertices by stress
    edge_length: float = 0.5  # wanted, of the triangles, mm

    @property
    def dissection(self) -> Dissection:
        """The organ between its clamps."""
        return self.specimen.dissection

    @property
    def threshold(self) -> float:
        """Stress at which the wall tears, MPa."""
        return self.specimen.threshold

    @property
    def moves(self) -> bool:
        """Whether a GLB of it moves."""
        return not (self.static or self.stress_colors)

    # What is moved, and how.

    @abstractmethod
    def motions(self) -> list[Motion]:
        """Return the motions, the main one first."""

    @abstractmethod
    def snapshot(self) -> Snapshot:
        """Return the moment that a static file shows."""

    @abstractmethod
    def snapshots(self) -> Iterator[tuple[float, Snapshot]]:
        """Yield the moments of a series, each with its value: force, N, or time, s."""

    @abstractmethod
    def written_table(self) -> tuple[bytes, ExportResult]:
        """Return the table as CSV."""

    @abstractmethod
    def pieces(self, edge_length: float) -> tuple[TornPiece, TornPiece] | None:
        """Return the two pieces that the organ tears into, if it does in a motion."""

    @abstractmethod
    def page_motion(self) -> Motion:
        """Return the motion that a page plays."""

    # What is said of it.

    @property
    @abstractmethod
    def note(self) -> str:
        """What moves the organ, to follow "... between the clamps" in a page."""

    @abstractmethod
    def facts(self) -> dict[str, object]:
        """Return how it was solved and what came of it, by snake_case keys with units."""

    @abstractmethod
    def summary(self, force: float | None) -> str:
        """Return in a few words how the organ stands at the end, under a force, N."""

    # Files.

    def check(self, path: Path) -> None:
        """Raise if this cannot be written to the path, before any long work."""
        self.check_kind(path)
        if path.suffix.lower() == ".pvd":
            check_series_path(path)
        else:
            check_target(path)

    def check_kind(self, path: Path) -> None:
        """Raise if this cannot be written as a file of that name."""
        suffix = path.suffix.lower()
        if suffix not in SUFFIXES:
            raise ValueError(
                f"cannot write {path}: its name must end in the kind of file, one of "
                f"{', '.join(SUFFIXES)}"
            )
        if self.stress_colors and suffix not in COLORED_SUFFIXES:
            raise ValueError(
                f"cannot write {path}: {suffix} keeps no colours of stress; take one of "
                f"{', '.join(COLORED_SUFFIXES)}"
            )

    def write(self, path: Path) -> ExportResult:
        """Write the file, whole or not at all; a bed's strands as VTP go into one beside it."""
        self.check(path)
        suffix = path.suffix.lower()
        if suffix == ".pvd":
            return write_moments(self.snapshots(), path)
        return _write(path, *self._written(suffix))

    def content(self, suffix: str) -> bytes:
        """Return what the file would hold."""
        self.check_kind(Path(f"organ{suffix}"))
        if suffix.lower() == ".pvd":
            raise ValueError("a .pvd is a series of files; write it to a folder")
        return self._written(suffix.lower())[0][""]

    def _written(self, suffix: str) -> tuple[dict[str, bytes], ExportResult]:
        """Return files' contents by the endings of their names, and their description."""
        if suffix == ".csv":
            table, result = self.written_table()
            return {"": table}, result
        if suffix == ".glb" and self.moves:
            model, result = self._rigged()
            return {"": model}, result
        return _moment(self.snapshot(), suffix, colored=self.stress_colors)

    def _rigged(self) -> tuple[bytes, ExportResult]:
        organ = self.dissection.organ
        skin = organ_skin(organ, edge_length=self.edge_length)
        motions, pieces = self.motions(), self.pieces(self.edge_length)
        content = rigged_organ(
            skin, self.dissection.driving, motions, pieces, radius=organ.mean_radius
        )
        names = tuple(motion.name for motion in motions)
        last = motions[0].readings[-1]
        return content, ExportResult(
            f"a rigged surface that can {' and '.join(names)}",
            last.force,
            last.deflection,
            (ORGAN,) if pieces is None else (ORGAN, *PIECES),
            len(skin.vertices),
            len(skin.faces),
            names,
        )


def write_moment(snapshot: Snapshot, path: Path) -> ExportResult:
    """Write one moment as closed surfaces; a VTP has stresses, and strands in a file beside it."""
    return _write(path, *_moment(snapshot, path.suffix.lower()))


def write_moments(snapshots: Iterable[tuple[float, Snapshot]], path: Path) -> ExportResult:
    """Write a series of moments, each with its value, as a PVD and the files that it lists."""
    shown: deque[Snapshot] = deque(maxlen=1)  # the last one, when all are written
    times: list[float] = []

    def moments() -> Iterator[tuple[float, dict[str, bytes]]]:
        for time, snapshot in snapshots:
            shown.append(snapshot)
            times.append(time)
            yield time, snapshot_contents(snapshot)

    files = write_series(moments(), path)
    strands = " and their strands" if shown[0].strands is not None else ""
    kind = f"a series of {len(times)} moments of closed surfaces{strands}"
    return ExportResult.of(kind, shown[0], tuple(files))


def _moment(
    snapshot: Snapshot, suffix: str, *, colored: bool = False
) -> tuple[dict[str, bytes], ExportResult]:
    """Return files' contents by the endings of their names, and their description."""
    count = len(snapshot.surfaces)
    kind = "one closed surface" if count == 1 else f"{count} closed surfaces"
    if suffix == ".vtp":
        contents = snapshot_contents(snapshot)
        kind += " and strands" if snapshot.strands is not None else ""
    else:
        shown = snapshot.stresses if colored else ()
        colors = [stress_colors(stress.distance_to_break) for stress in shown]
        contents = {"": mesh_content(snapshot.surfaces, suffix, colors)}
    return contents, ExportResult.of(kind, snapshot)


def _write(path: Path, contents: dict[str, bytes], result: ExportResult) -> ExportResult:
    """Write files, whole or not at all, by the endings of their names."""
    files = {path.with_name(f"{path.stem}{end}{path.suffix}"): contents[end] for end in contents}
    for file in files:
        check_target(file)
    for file, content in files.items():
        write_atomic(file, content)
    return replace(result, files=tuple(files))
