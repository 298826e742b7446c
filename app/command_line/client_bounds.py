"""Options of `trainer` and `class` that bound what clients may take, each a flag of its own."""

from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

if TYPE_CHECKING:
    from app.compression.build_process import BuildProcess
    from app.trainer.connections.bounds import Bounds

MIB = 2**20
LONGEST_MM = 10_000
"""As organ files have it at most."""
LEAST = {
    "silent_seconds": 1, "message_kib": 600, "upload_mib": 1, "build_pixels": 1,
    "export_vertices": 300, "log_length": 200,
}  # fmt: skip
"""What the trainer's own page needs: it sends files in parts of 512 KiB."""


class ClientBounds(NamedTuple):
    """Limits of what is sent, built (an organ's length among them), downloaded and logged."""

    connections: "Bounds"
    builds: "BuildProcess"
    export_vertices: int
    log_length: int


def _bound(text: str) -> Any:
    return typer.Option(help=text, rich_help_panel="Bounds of what clients may take")


def client_bounds(
    *,
    most_clients: Annotated[int, _bound("Trainees at a time.")] = 64,
    most_per_address: Annotated[int, _bound("Pages of an address; a class may share one.")] = 48,
    most_per_browser: Annotated[int, _bound("Pages of a browser that came by the link.")] = 8,
    silent_seconds: Annotated[float, _bound("Time of a page that says nothing, s.")] = 20.0,
    messages_per_second: Annotated[float, _bound("Messages of a page; more of them wait.")] = 120.0,
    message_kib: Annotated[int, _bound("Size of a message, KiB.")] = 1024,
    upload_mib: Annotated[int, _bound("Files that a page is sending, MiB together.")] = 64,
    all_upload_mib: Annotated[int, _bound("Files that all pages are sending, MiB.")] = 256,
    build_seconds: Annotated[float, _bound("Time of building an organ, s.")] = 120.0,
    build_memory: Annotated[int, _bound("Memory of building organs, MiB (Linux).")] = 3072,
    build_pixels: Annotated[
        int, _bound("Million pixels of images sent to be built; of each a 24th.")
    ] = 120,
    organ_mm: Annotated[
        float, _bound("Length of an organ, of a file or of images, mm.")
    ] = LONGEST_MM,
    export_vertices: Annotated[
        int, _bound("Vertices of a downloaded surface; its edges are as long as that takes.")
    ] = 20_000,
    log_length: Annotated[
        int, _bound("Characters of a record of the log; it has at most one a second for long.")
    ] = 4000,
) -> ClientBounds:
    """Return the limits that the options ask for."""
    given = locals()
    for name, least in LEAST.items():
        if not given[name] >= least:  # NaN neither
            raise ValueError(f"--{name.replace('_', '-')} must be at least {least}")
    if not all_upload_mib >= upload_mib:
        raise ValueError(
            f"--all-upload-mib must be at least the {upload_mib} of --upload-mib, of one page"
        )
    if not 0.0 < organ_mm <= LONGEST_MM:
        raise ValueError(f"--organ-mm must be above 0 and at most {LONGEST_MM:,}: what is a gut's")
    from app.compression.build_process import BuildProcess
    from app.compression.image_upload import UploadBounds
    from app.trainer.connections.bounds import Bounds

    connections = Bounds(
        most_clients, most_per_address, most_per_browser, messages_per_second, silent_seconds,
        message_kib * 1024, upload_mib * MIB, all_upload_mib * MIB,
    )  # fmt: skip
    sent = UploadBounds(
        file_bytes=upload_mib * MIB,
        image_pixels=build_pixels * 10**6 // 24,
        all_pixels=build_pixels * 10**6,
        organ_mm=organ_mm,
    )
    builds = BuildProcess(build_seconds, build_memory, sent)
    return ClientBounds(connections, builds, export_vertices, log_length)
