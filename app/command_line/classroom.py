"""`bluntdissect class`: a class with its teacher and trainees, and what is kept of it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.command_line.serving import Serving, draw_link, serve, serving
from app.command_line.shared_options import options_of

if TYPE_CHECKING:
    from app.classroom.store import ClassStore
    from app.trainer.server.trainer import Trainer

__all__ = ["program"]

program = typer.Typer(help="A class: a teacher's page, trainees by a link, results that are kept.")

Title = Annotated[str, typer.Argument(help="Title of the class, or its file.", metavar="CLASS")]


def _serving(options: dict[str, Any]) -> Serving:
    # A class sits behind one router.
    least = options["most_clients"] + 2
    return serving(**options | {"most_per_address": max(options["most_per_address"], least)})


def _open(store: "ClassStore", served: Serving) -> None:
    """Serve a class until it is told to stop."""
    from app.trainer.connections.guard import is_loopback

    def start() -> "Trainer":
        from app.trainer.classroom.lesson import Lesson

        return served.start(lesson=Lesson(store, served.organ, served.preset))

    def say(running: "Trainer") -> None:
        print(f"Teacher: {running.teacher_link}", flush=True)
        print(f"Trainees: {running.link}", flush=True)
        if not (running.link.startswith("https") or is_loopback(served.host)):
            print("Nothing is encrypted on its way.", flush=True)
        print("Keep the first link to yourself. The second as a code:", flush=True)
        draw_link(running.link)
        print(f"{store.title} is kept in {store.path}", flush=True)

    serve(start, say)


@program.command("new")
@options_of(serving)
def new(title: Title, **options: Any) -> None:
    """Make a class and open it; it prints a link for the teacher and one for the trainees.

    Example: bluntdissect class new "Surgery 3A" --host 0.0.0.0
    """
    from app.classroom.store import ClassStore, class_path

    served = _serving(options)
    store = ClassStore.new(class_path(title), Path(title).stem if _is_file(title) else title)
    try:
        _open(store, served)
    except (ValueError, OSError):  # it has never been open
        store.delete()
        raise


@program.command("open")
@options_of(serving)
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
    served = _serving(options)
    store = _store(title)
    if new_links:
        store.renew_links()
    _open(store, served)


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
