"""`bluntdissect class`: a class with its teacher and trainees, and what is kept of it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from app.command_line.client_bounds import client_bounds, options_of
from app.command_line.image_options import chosen
from app.command_line.load import PRESET_HELP, organ_from
from app.command_line.trainer import (
    NET,
    Certificate,
    Key,
    LogFormatName,
    Look,
    Metrics,
    OrganFile,
    Port,
    TrustProxy,
    draw_link,
    ready_for_signals,
    serve,
    tls_context,
)

if TYPE_CHECKING:
    from app.classroom.store import ClassStore
    from app.trainer.server.log import LogFormat
    from app.trainer.server.trainer import Trainer
    from app.trainer.stage.lighting import LookChoice

__all__ = ["program"]

LOOKS = ("auto", "full", "plain")

program = typer.Typer(help="A class: a teacher's page, trainees by a link, results that are kept.")

Title = Annotated[str, typer.Argument(help="Title of the class, or its file.", metavar="CLASS")]


def _check(host: str, port: int, look: str, **_: object) -> None:
    if look not in LOOKS:
        raise ValueError(f"--look must be auto, full or plain, not {look}")
    if not 0 <= port <= 65535:
        raise ValueError(f"--port must be from 0 to 65535, not {port}")
    if not host:
        raise ValueError("--host must be an address")


@options_of(client_bounds)
def _open(
    store: "ClassStore",
    *,
    host: Annotated[
        str, typer.Option(help="Address to serve; 0.0.0.0 lets other machines in by the links.")
    ] = "127.0.0.1",
    port: Port = 8080,
    organ: OrganFile = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"Material and beam of the duct: {PRESET_HELP}",
            show_default="of the shipped duct the first, of any other organ assumed-duct",
        ),
    ] = None,
    look: Look = "auto",
    certificate: Certificate = None,
    key: Key = None,
    public_url: Annotated[
        str | None,
        typer.Option(help="Where a reverse proxy serves the class.", rich_help_panel=NET),
    ] = None,
    trust_proxy: TrustProxy = None,
    metrics: Metrics = False,
    log_format: LogFormatName = "text",
    **bounds: Any,
) -> None:
    """Serve a class until it is told to stop."""
    if trust_proxy is not None and public_url is None:
        raise ValueError("--trust-proxy needs --public-url, the address that the proxy serves")
    log: LogFormat = chosen("--log-format", log_format, ("text", "json"))
    tls = tls_context(certificate, key)
    ready_for_signals()
    # A class sits behind one router.
    bounds["most_per_address"] = max(bounds["most_per_address"], bounds["most_clients"] + 2)
    within = client_bounds(**bounds)
    from app.simulation import chosen_preset
    from app.trainer.connections.guard import is_loopback

    tissue = organ_from(organ, within.builds.bounds.organ_mm)
    material = None if preset is None else chosen_preset(preset)
    chosen_look = cast("LookChoice", look)

    def start() -> "Trainer":
        from app.trainer.classroom.lesson import Lesson
        from app.trainer.server.log import set_up_log
        from app.trainer.server.trainer import Trainer

        set_up_log(log, within.log_length)
        return Trainer(
            tissue, material, host=host, port=port, look=chosen_look, bounds=within.connections,
            build_process=within.builds, export_vertices=within.export_vertices, metrics=metrics,
            tls=tls, public_url=public_url, trusted_proxy=trust_proxy,
            lesson=Lesson(store, tissue, material),
        )  # fmt: skip

    def say(running: "Trainer") -> None:
        print(f"Teacher: {running.teacher_link}", flush=True)
        print(f"Trainees: {running.link}", flush=True)
        if not (running.link.startswith("https") or is_loopback(host)):
            print("Nothing is encrypted on its way.", flush=True)
        print("Keep the first link to yourself. The second as a code:", flush=True)
        draw_link(running.link)
        print(f"{store.title} is kept in {store.path}", flush=True)

    serve(start, say)


@program.command("new")
@options_of(_open, "store")
def new(title: Title, **options: Any) -> None:
    """Make a class and open it; it prints a link for the teacher and one for the trainees.

    Example: bluntdissect class new "Surgery 3A" --host 0.0.0.0
    """
    from app.classroom.store import ClassStore, class_path

    _check(**options)
    store = ClassStore.new(class_path(title), Path(title).stem if _is_file(title) else title)
    try:
        _open(store, **options)
    except (ValueError, OSError):  # it has never been open
        store.delete()
        raise


@program.command("open")
@options_of(_open, "store")
def open_class(
    title: Title,
    new_links: Annotated[
        bool, typer.Option("--new-links", help="Make new links; the old ones no longer open it.")
    ] = False,
    **options: Any,
) -> None:
    """Open a class again: with the same port its links and its people are the same.

    Example: bluntdissect class open "Surgery 3A" --host 0.0.0.0
    """
    _check(**options)
    store = _store(title)
    if new_links:
        store.renew_links()
    _open(store, **options)


@program.command("list")
def list_classes() -> None:
    """List the classes of this user, and where they are kept."""
    from app.classroom.store import ClassStore, class_files

    paths = class_files()
    if not paths:
        print('There is no class yet. Make one: bluntdissect class new "Surgery 3A"')
    for path in paths:
        store = ClassStore(path)
        try:
            people, runs = len(store.people()), len(store.runs())
            print(
                f"{store.title}: {people} people, {runs} runs, since {store.made_at[:10]}: {path}"
            )
        finally:
            store.close()


@program.command("export")
def export(
    title: Title,
    folder: Annotated[Path, typer.Option("--output", "-o", help="Folder to write to.")],
) -> None:
    """Write all results of a class: CSV, JSON, a report to print, and every run file.

    Example: bluntdissect class export "Surgery 3A" -o results
    """
    from app.classroom.report import report_page
    from app.classroom.results import results, results_csv, results_json
    from organ_geometry import make_folder, write_atomic

    store = _store(title)
    try:
        make_folder(folder, f"cannot write {folder}")
        found = results(store)
        write_atomic(folder / "results.csv", results_csv(found))
        write_atomic(folder / "results.json", results_json(store))
        write_atomic(folder / "report.html", report_page(store).encode())
        if found:
            make_folder(folder / "runs", f"cannot write {folder / 'runs'}")
        for each in found:
            run = store.run(each.run.id)
            if run is not None:
                write_atomic(folder / "runs" / f"{run.id}.json", run.file)
        print(f"{len(found)} runs of {len(store.people())} people are in {folder}.")
    finally:
        store.close()


@program.command("backup")
def backup(title: Title, file: Annotated[Path, typer.Argument(help="New file.")]) -> None:
    """Copy a class to a file, also while it is open; the file opens like the class.

    Example: bluntdissect class backup "Surgery 3A" surgery.sqlite
    """
    store = _store(title)
    try:
        store.back_up(file)
    finally:
        store.close()
    print(f"{file} has the whole class, and its links: keep it as safe as the class.")


@program.command("delete")
def delete(
    title: Title,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
) -> None:
    """Delete a class with all names and results. Backups and exports are yours to delete.

    Example: bluntdissect class delete "Surgery 3A" --yes
    """
    store = _store(title)
    try:
        if not yes:
            people, runs = len(store.people()), len(store.runs())
            typer.confirm(f"Delete {store.title}, {people} people and {runs} runs?", abort=True)
    except BaseException:
        store.close()
        raise
    store.delete()
    print(f"{store.title} is deleted.")


def _is_file(title: str) -> bool:
    return title.endswith(".sqlite")


def _store(title: str) -> "ClassStore":
    from app.classroom.store import ClassStore, class_path

    return ClassStore(class_path(title))
