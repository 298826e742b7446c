"""`bluntdissect class`: a class with its teacher and trainees, and what is kept of it."""

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.command_line.answer import AsJson
from app.command_line.serving import Serving, draw_link, serve, serving
from app.command_line.shared_options import options_of

if TYPE_CHECKING:
    from app.classroom.course import Benchmark, Course
    from app.classroom.store import ClassStore
    from app.trainer.server.trainer import Trainer

program = typer.Typer(help="A class: a teacher's page, trainees by a link, results that are kept.")

MOST_NAMED = 10
"""Files of an earlier export that are named."""

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
        print("Keep the first link to yourself.", flush=True)
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
        with closing(ClassStore(path)) as store:
            people, runs = len(store.people()), len(store.runs())
            print(
                f"{store.title}: {people} people, {runs} runs, since {store.made_at[:10]}: {path}"
            )


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

    with closing(_store(title)) as store:
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


@program.command("course")
def course(
    title: Title,
    file: Annotated[Path | None, typer.Argument(help="A course's file (TOML).")] = None,
    default: Annotated[
        bool, typer.Option("--default", help="The course that comes with the program.")
    ] = False,
    off: Annotated[bool, typer.Option("--off", help="No course any more.")] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the class's course to a file.")
    ] = None,
) -> None:
    """Set the course of a class, or say which it has; what people did in it is kept.

    Example: bluntdissect class course "Surgery 3A" --default
    """
    from app.bounded_file import read_bounded
    from app.classroom.class_course import ClassCourse
    from app.classroom.course import LONGEST_FILE, default_course
    from organ_geometry import write_atomic

    if (file is not None) + default + off > 1:
        raise ValueError("a course's file, --default and --off do not go together")
    content = default_course() if default else None
    if file is not None:
        try:
            content = read_bounded(file, 4 * LONGEST_FILE, "course").decode()
        except UnicodeDecodeError:
            raise ValueError(f"{file} is no course: it is not text") from None
    with closing(_store(title)) as store:
        book = ClassCourse(store)
        if content is not None or off:
            book.choose(content)
        if output is not None:
            if store.course is None:
                raise ValueError(f"{store.title} has no course")
            write_atomic(output, store.course.encode())
        if book.course is None:
            print(f"{store.title} has no course.")
            return
        print(f"{store.title} has the course {book.course.title!r}:")
        for each in book.course.level:
            after = f", after {', '.join(each.needs)}" if each.needs else ""
            print(f"  {each.id}: {each.title}, {each.passes} passes in a row{after}")
        for each in book.course.benchmark:
            origin = f"{each.origin}{_asked(book.course, each)}"
            print(f"  benchmark of {each.metric} in {each.level}: {each.mark:g} ({origin})")


@program.command("benchmark")
def benchmark(
    title: Title,
    people: Annotated[
        list[str] | None,
        typer.Option("--expert", help="Somebody whose passes set it; give it for each of them."),
    ] = None,
    scripted: Annotated[
        bool, typer.Option("--scripted", help="By scripted hands; it takes some minutes.")
    ] = False,
    organ: Annotated[
        Path | None, typer.Option(help="The class's organ, for scripted hands; else the shipped.")
    ] = None,
) -> None:
    """Set the benchmarks of a class's course from the runs of chosen people, or of scripted hands.

    Example: bluntdissect class benchmark "Surgery 3A" --expert Ann --expert Ben --expert Cas
    """
    from app.classroom.benchmarks import LEAST_JUDGED, expert_benchmarks, scripted_benchmarks
    from app.classroom.class_course import ClassCourse
    from app.classroom.course import with_benchmarks
    from app.classroom.results import shown_names
    from app.command_line.load import organ_from

    if bool(people) == scripted:
        raise ValueError("name people by --expert, or give --scripted")
    with closing(_store(title)) as store:
        book = ClassCourse(store)
        if book.course is None or store.course is None:
            raise ValueError(f"{store.title} has no course; set one with bluntdissect class course")
        if people:
            known = {name: who for who, name in shown_names(store.people()).items()}
            for name in people:
                if name not in known:
                    raise ValueError(f"there is nobody called {name!r} in {store.title}")
            tries = book.tries()
            found = expert_benchmarks(book.course, {name: tries[known[name]] for name in people})
        else:
            found, passed = scripted_benchmarks(book.course, organ_from(organ))
            for level, (count, of) in passed.items():
                print(f"Scripted hands passed level {level} in {count} of {of} runs.")
        book.choose(with_benchmarks(store.course, found))
        for each in found:
            origin = f"{each.origin}{_asked(book.course, each)}"
            print(f"{each.level}, {each.metric}: {each.mark:g} ({origin})")
        if any(each.source == "experts" and each.n < LEAST_JUDGED for each in found):
            print(f"Of fewer than {LEAST_JUDGED} experts none can be found to be far off.")


@program.command("xapi")
def xapi(
    title: Title,
    url: Annotated[
        str | None, typer.Argument(help="Of a learning record store: https://lrs.example.org/xapi.")
    ] = None,
    key: Annotated[str, typer.Option(help="The key's name that the store gave.")] = "",
    version: Annotated[str, typer.Option(help="Of xAPI: 1.0.3 or 2.0.0.")] = "1.0.3",
    off: Annotated[bool, typer.Option("--off", help="Send nothing any more.")] = False,
) -> None:
    """Send results to a learning record store while the class is open; the secret is asked for.

    Example: bluntdissect class xapi "Surgery 3A" https://lrs.example.org/xapi --key trainer
    """
    from app.classroom.class_course import ClassCourse
    from app.classroom.xapi_sender import LearningRecordStore, connect, disconnect

    if url is not None and off:
        raise ValueError("an address and --off do not go together")
    with closing(_store(title)) as store:
        if url is not None:
            LearningRecordStore.of(url, version)
            secret = typer.prompt("Secret", hide_input=True)
            connect(store, ClassCourse(store), url, version, key, secret)
        elif off:
            disconnect(store)
        waiting, sent, refused, reason = store.statement_counts()
        if store.learning_record_store is None:
            print(f"{store.title} sends nothing.")
        else:
            print(f"{store.title} sends its results: {store.learning_record_store}")
        counts = f"{waiting} statements wait, {sent} were sent, {refused} were refused."
        print(f"{counts} {reason}".rstrip())


@program.command("research-export")
def research_export(
    title: Title,
    folder: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write to, with --people.")
    ] = None,
    people: Annotated[
        Path | None,
        typer.Option(help="List of people (CSV) with consent (yes or no) and group, filled in."),
    ] = None,
    ask: Annotated[
        Path | None, typer.Option(help="Write that list with the class's names, to be filled in.")
    ] = None,
    key: Annotated[
        Path | None,
        typer.Option(
            help="File of the key to pseudonyms, made if there is none; else none is kept."
        ),
    ] = None,
    parquet: Annotated[bool, typer.Option("--parquet", help="Tables as Parquet too.")] = False,
) -> None:
    """Write a class as data for research, without names: of those who have consented.

    Example: bluntdissect class research-export "Surgery 3A" --people people.csv -o study
    """
    from app.classroom.research import consent_list, pseudonym_key, read_consents, write_research
    from organ_geometry import write_atomic

    if (ask is None) == (people is None) or (people is None) != (folder is None):
        raise ValueError("give --ask people.csv first; then --people people.csv and -o")
    with closing(_store(title)) as store:
        if ask is not None:
            write_atomic(ask, consent_list(store))
            print(f"{ask} has the names. Fill in consent (yes or no) and group.")
        if people is not None and folder is not None:
            groups = read_consents(people, store)
            done = write_research(store, groups, folder, pseudonym_key(key), parquet=parquet)
            print(f"{done.attempts} attempts of {done.people} people are in {folder}.")
            print(f"Left out: {done.left_out} without consent.")
            if done.left_out:
                print(
                    "Who has withdrawn is still in earlier exports. Delete those you keep; files "
                    "that were handed out cannot be recalled from here."
                )
            if done.older:
                named = ", ".join(done.older[:MOST_NAMED])
                more = f" and {len(done.older) - MOST_NAMED} more" * (len(done.older) > MOST_NAMED)
                print(f"In {folder} are files of an earlier export: {named}{more}.")
            if done.small:
                print(f"Not named, as fewer than five people are in them: {', '.join(done.small)}.")


@program.command("evidence")
def evidence(
    folder: Annotated[Path, typer.Argument(help="Of class research-export.")],
    novices: Annotated[str, typer.Option(help="Name of the group of novices.")] = "novice",
    experts: Annotated[str, typer.Option(help="Name of the group of experts.")] = "expert",
    tries: Annotated[int, typer.Option(min=1, help="First attempts of a task that count.")] = 3,
    retest: Annotated[
        tuple[int, int], typer.Option(min=1, help="Days after the first try, from and to.")
    ] = (7, 14),
    as_json: AsJson = False,
) -> None:
    """Work out what a study of validity reports: groups told apart, retest, pass mark, learning.

    Example: bluntdissect class evidence study --novices novice --experts expert
    """
    import msgspec

    from app.classroom.evidence import Plan, evidence_lines, evidence_of

    found = evidence_of(folder, Plan(novices, experts, tries, *retest))
    if as_json:
        print(msgspec.json.encode(found).decode())  # nan is null
    else:
        print("\n".join(evidence_lines(found)))


@program.command("backup")
def backup(title: Title, file: Annotated[Path, typer.Argument(help="New file.")]) -> None:
    """Copy a class to a file, also while it is open; the file opens like the class.

    Example: bluntdissect class backup "Surgery 3A" surgery.sqlite
    """
    with closing(_store(title)) as store:
        store.back_up(file)
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


def _asked(course: "Course", benchmark: "Benchmark") -> str:
    """Return how a level asks for its benchmark, unless it does so as it is."""
    factor = course.level_of(benchmark.level).benchmarks.get(benchmark.metric)
    if factor is None:
        return ", not asked for"
    return "" if factor == 1.0 else f", of which the level asks for {factor:g} times"


def _is_file(title: str) -> bool:
    return title.endswith(".sqlite")


def _store(title: str) -> "ClassStore":
    from app.classroom.store import ClassStore, class_path

    return ClassStore(class_path(title))
