"""Build: an organ from the user's own images, from their edges to the duct that is trained on."""

import html
import logging
import math
import re
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import viser

from app.compression.edge_picture import LUMEN_COLOR, OUTER_COLOR
from app.compression.image_upload import UploadRefusedError
from app.compression.organ_workbench import (
    Abandoned,
    OpenedStack,
    OrganChoice,
    OrganWorkbench,
)
from app.compression.report import DOUBTFUL
from app.simulation import default_preset, fits, presets
from app.trainer.client.page_state import PageState
from app.trainer.panel.controls import figure, note, number, on_click, on_input, rows_html
from app.trainer.panel.dialog import dialog
from app.trainer.panel.picked_pixel import picked_pixel, picture_html
from assets import BILE_DUCT_PHANTOM
from organ_geometry import BuiltOrgan, Organ

_TELLING = (
    "Images across an organ become its surface: its edge is found in each, and only the images are "
    "kept that the others cannot be drawn from to within a threshold."
)
# Smallest and largest threshold on the slider, px.
THRESHOLDS = (0.05, 3.0)
THRESHOLD_STEP = 0.01
# px, the slider's threshold until there is an organ.
SUITABLE = 0.7
# s, shortest time between two reports of progress.
TELLS_EVERY = 0.25
# s after the last change of the fields until the organ is looked for.
PAUSE = 0.6
MOST_MM = 1000.0
_GREY = "none: grey levels"
_SENT = ".zip,.tif,.tiff,.dcm,.dicom,.ima,.nii,.gz,.nrrd,.mha"

log = logging.getLogger(__name__)


class BuildTab:
    """The tab in which an organ is built; it does nothing before a button is pressed."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state = state
        process = state.workers.build_process
        self._bench = OrganWorkbench(process.bounds, process)
        self._status = gui.add_html(note(_TELLING, "build-status"))
        self._phantom = gui.add_button(
            "Use the built-in phantom", icon=viser.Icon.STACK_2, hint="128 images of a bile duct"
        )

        def length(label: str, what: str) -> viser.GuiNumberHandle[float]:
            hint = f"{what}; 0 if they or a spacing.json in the zip say it"
            return gui.add_number(label, 0.0, min=0.0, max=MOST_MM, step=0.001, hint=hint)

        self._pixel = length("Pixel (mm)", "Side of a pixel of your images")
        self._slice = length("Slice distance (mm)", "From image to image")
        self._send = gui.add_upload_button(
            "Open images",
            icon=viser.Icon.UPLOAD,
            color="gray",
            mime_type=_SENT,
            hint="A zip of PNG, JPEG, TIFF, BMP or DICOM images, or one TIFF, DICOM, NIfTI, NRRD "
            "or MetaImage file",
        )
        self._again = gui.add_button(
            "Read them with these sizes", icon=viser.Icon.REFRESH, color="gray", visible=False
        )
        labels: Sequence[str] = [_GREY]
        self._label = gui.add_dropdown(
            "Label", labels, visible=False, hint="Which of the labels in the images is the organ"
        )
        self._index = gui.add_slider("Image", min=0, max=1, step=1, initial_value=0, visible=False)
        self._image = gui.add_html("", visible=False)
        self._caption = gui.add_html("", visible=False)
        self._point = gui.add_text(
            "Point",
            "",
            visible=False,
            hint="A pixel of the organ: click it in the image, or type column,row,image, from 0",
        )
        self._folder = gui.add_folder("Look only here", expand_by_default=False, visible=False)
        with self._folder:
            self._images = gui.add_text("Images", "", hint="The first and the last, from 0")
            self._columns = gui.add_text("Columns", "", hint="Of the region's left and right side")
            self._rows = gui.add_text("Rows", "", hint="Of the region's upper and lower side")
            self._reslice = gui.add_checkbox(
                "Cut again across a curve",
                True,
                hint="Images that do not suit a curved organ are cut again across it",
            )
            self._everywhere = gui.add_button(
                "Look everywhere", icon=viser.Icon.MAXIMIZE, color="gray"
            )
        self._threshold = gui.add_slider(
            "Threshold (px)",
            min=THRESHOLDS[0],
            max=THRESHOLDS[1],
            step=THRESHOLD_STEP,
            initial_value=SUITABLE,
            visible=False,
            hint="Largest RMS distance of any section's edge points to the organ",
        )
        self._result = gui.add_html("", visible=False)
        self._practise = gui.add_button("Practise on it", icon=viser.Icon.HAND_GRAB, visible=False)
        self._download = gui.add_button(
            "Download .organ", icon=viser.Icon.DOWNLOAD, color="gray", visible=False
        )
        self._reported_at = 0.0
        self._requests = 0
        self._lock = threading.Lock()
        on_click(self._phantom, self._use_phantom)
        on_click(self._again, self._use_upload)
        on_click(self._everywhere, self._look_everywhere)
        on_click(self._practise, self._practise_on_it)
        on_click(self._download, self._send_organ)
        on_input(self._index, lambda _: self._look())
        on_input(self._threshold, self._request)
        for handle in (self._label, self._point, self._reslice, *self._region):
            on_input(handle, lambda _: self._point_at())

        @self._send.on_upload
        def _(_: object) -> None:
            self._use_upload()

    @property
    def _region(self) -> tuple[viser.GuiInputHandle[str], ...]:
        """The fields of the region of interest: first and last column, row and image."""
        return self._columns, self._rows, self._images

    def close(self) -> None:
        """Remove what the client has sent."""
        self._bench.close()

    def _use_phantom(self) -> None:
        self._make(
            lambda: self._open(lambda: self._bench.open_folder(BILE_DUCT_PHANTOM, self._tell))
        )

    def _use_upload(self) -> None:
        sent = self._send.value
        pixel, distance = _length(self._pixel.value), _length(self._slice.value)

        def read() -> OpenedStack:
            self._again.visible = True
            try:
                return self._bench.open_upload(
                    sent.name, sent.content, pixel_mm=pixel, slice_mm=distance, progress=self._tell
                )
            except UploadRefusedError:
                self._again.visible = False  # other sizes would not help
                raise

        self._make(lambda: self._open(read))

    def _request(self, value: object) -> None:
        """Build at the threshold that the slider was set to."""
        wanted = number(value)
        if math.isfinite(wanted) and self._bench.opened is not None:
            wanted = min(max(wanted, THRESHOLDS[0]), THRESHOLDS[1])
            self._make(lambda: self._build(wanted))

    def _point_at(self) -> None:
        """Look for another organ, once the fields have not changed for a moment."""
        opened = self._bench.opened
        if opened is not None:
            self._make(lambda: self._choose(opened), after=PAUSE)

    def _look_everywhere(self) -> None:
        opened = self._bench.opened
        if opened is not None:
            self._offer(replace(opened, choice=OrganChoice(label=opened.choice.label)))
            self._make(lambda: self._choose(opened))

    def _make(self, work: Callable[[], None], *, after: float = 0.0) -> None:
        """Queue work that takes seconds, in place of any of this client's that has not begun."""
        with self._lock:
            self._requests += 1
            request = self._requests
        builder, kind = self._state.workers.builder, (id(self), "build")

        def do() -> None:
            message = ""
            try:
                self._say("One moment.")
                work()
            except Abandoned:
                return
            except ValueError as error:
                message = f"<b>Not possible:</b> {html.escape(str(error))}."
                # Beside viser's own notice that the file has arrived.
                self._state.refuse(f"{error}.")
            except Exception:
                log.exception("an organ could not be built")
                message = "<b>Not possible:</b> a fault of the program."
            if request == self._requests:
                self._say(message)
            self._show_result()

        def begin() -> None:
            if request == self._requests:
                before = builder.tasks_ahead_of(kind)
                self._say(_waiting(before) if before else "One moment.")
                self._state.when_free(builder, kind, do)

        if after:
            pause = threading.Timer(after, begin)
            pause.daemon = True
            pause.start()
        else:
            begin()

    def _open(self, read: Callable[[], OpenedStack]) -> None:
        opened = read()
        count = len(opened.shown)
        self._index.visible = False
        self._index.max = max(count - 1, 1)
        self._index.value = count // 2
        self._label.options = (_GREY, *(str(label) for label in opened.labels))
        self._offer(opened)
        for handle in (self._index, self._image, self._caption):
            handle.visible = True
        self._build_first(opened)

    def _choose(self, before: OpenedStack) -> None:
        """Find the organ that the fields describe."""
        opened = self._bench.choose(self._choice(before), self._tell)
        last = len(opened.shown) - 1
        if last != self._index.max:
            self._index.value = min(self._index.value, last)
            self._index.max = max(last, 1)
        self._offer(opened)
        self._build_first(opened)

    def _choice(self, opened: OpenedStack) -> OrganChoice:
        """Return the organ that the fields describe."""
        text = str(self._point.value)
        seed = picked_pixel(text)
        if seed is None and text.strip():
            raise ValueError(
                f"the point must be column,row,image, as 120,95,30, from 0, and not {text!r}"
            )
        label = str(self._label.value)
        rows, columns = opened.whole.shape
        counts = columns, rows, len(opened.whole)
        (x0, x1), (y0, y1), (first, last) = (
            _between(str(handle.label), str(handle.value), count)
            for handle, count in zip(self._region, counts, strict=True)
        )
        whole = (x0, y0, first) == (0, 0, 0) and (x1 + 1, y1 + 1, last + 1) == counts
        return OrganChoice(
            seed=seed,
            region=None if whole else (x0, y0, x1, y1, first, last),
            label=next((each for each in opened.labels if str(each) == label), None),
            reslice=bool(self._reslice.value),
        )

    def _offer(self, opened: OpenedStack) -> None:
        """Show in the fields which organ was chosen."""
        choice, (rows, columns) = opened.choice, opened.whole.shape
        x0, y0, x1, y1, first, last = choice.region or (
            (0, 0, columns - 1, rows - 1, 0, len(opened.whole) - 1)
        )
        for handle, ends in zip(self._region, ((x0, x1), (y0, y1), (first, last)), strict=True):
            handle.value = f"{ends[0]}-{ends[1]}"
        self._point.value = "" if choice.seed is None else ",".join(map(str, choice.seed))
        self._label.value = _GREY if choice.label is None else str(choice.label)
        self._reslice.value = choice.reslice
        self._label.visible = bool(opened.labels)
        self._point.visible = not opened.resliced
        self._folder.visible = True

    def _build_first(self, opened: OpenedStack) -> None:
        """Show the images, and build the organ at the threshold that suits it."""
        self._picture()
        self._show_result()
        if opened.traced is None:
            return
        self._say("Building the organ.")
        built = self._bench.build(None, self._tell)
        self._threshold.value = min(
            max(round(built.tolerance_mm / opened.stack.mean_pixel, 2), THRESHOLDS[0]),
            THRESHOLDS[1],
        )

    def _build(self, wanted: float) -> None:
        self._say(f"Building the organ at {wanted:.2f} px.")
        self._bench.build(wanted)

    def _tell(self, done: int, total: int) -> None:
        now = time.monotonic()
        if now - self._reported_at > TELLS_EVERY:
            self._reported_at = now
            self._say(f"Finding edges: {done} of {total} images.")

    def _say(self, content: str) -> None:
        self._status.content = note(content or self._telling(), "build-status")

    def _telling(self) -> str:
        """Return the text shown while nothing is being done."""
        opened = self._bench.opened
        if opened is not None and opened.traced is None:
            return (
                f"<b>The images hold {len(opened.labels)} labels.</b> Choose the organ's, or click "
                f"on it in the image."
            )
        return _TELLING

    def _look(self) -> None:
        state = self._state
        state.when_free(state.workers.awaited, (id(self), "picture"), self._picture)

    def _picture(self) -> None:
        opened = self._bench.opened
        if opened is None:
            return
        value = number(self._index.value)
        last = len(opened.shown) - 1
        index = min(max(round(value), 0), last) if math.isfinite(value) else 0
        try:
            picture = opened.picture(index)
        except ValueError as error:
            caption = html.escape(str(error))
        else:
            caption = _caption(opened, index)
            self._image.content = picture_html(
                picture,
                f"Image {index}, with the edges that were found",
                opened.shown.shape,
                None if opened.resliced else index,
            )
        self._caption.content = note(caption, "build-caption")

    def _show_result(self) -> None:
        opened, built = self._bench.opened, self._bench.built
        self._threshold.visible = opened is not None and opened.traced is not None
        for handle in (self._result, self._practise, self._download):
            handle.visible = built is not None
        if opened is not None and built is not None:
            self._result.content = _result_html(built, opened)
            self._practise.color = "gray" if built.doubts else None

    def _practise_on_it(self) -> None:
        built = self._bench.built
        if built is None:
            return
        if built.doubts:
            self._ask_before(built)
        else:
            self._practise_on(built)

    def _practise_on(self, built: BuiltOrgan) -> None:
        state = self._state
        state.attempt("Preparing your duct.", lambda: state.practise_on(built.organ))

    def _ask_before(self, built: BuiltOrgan) -> None:
        """Ask before training on an organ that is probably not the one that was meant."""
        gui = self._state.client.gui
        with dialog(gui, "Is this the organ that you mean?") as close:
            gui.add_html(_doubts_html(built))
            no = gui.add_button("Back to the images", icon=viser.Icon.ARROW_LEFT)
            yes = gui.add_button("Practise on it all the same", color="gray")

        def agree() -> None:
            close()
            self._practise_on(built)

        on_click(no, close)
        on_click(yes, agree)

    def _send_organ(self) -> None:
        built, opened = self._bench.built, self._bench.opened
        if built is not None and opened is not None:
            self._state.send_file(f"{opened.source.stem}.organ", built.organ.encoded)


def _between(what: str, text: str, count: int) -> tuple[int, int]:
    if not text.strip():
        return 0, count - 1
    ends = re.fullmatch(r"\s*(\d{1,6})\s*[-,]\s*(\d{1,6})\s*", text, re.ASCII)
    if ends is None:
        raise ValueError(f"{what} must be the first and the last, as 0-{count - 1}, not {text!r}")
    return int(ends[1]), int(ends[2])


def _waiting(before: int) -> str:
    """Return the text shown while other clients' organs are built first."""
    organs = "another organ is" if before == 1 else f"{before} other organs are"
    return f"Waiting: {organs} being built first."


def _length(value: object) -> float | None:
    """Return the length in a field, mm, or None."""
    length = number(value)
    return length if math.isfinite(length) and length > 0.0 else None


def _caption(opened: OpenedStack, index: int) -> str:
    name = html.escape(opened.shown.names[index])
    section = opened.section(index)
    pointing = "" if opened.resliced else ". Another organ is meant? Click on it."
    if section is None:
        reason = html.escape(opened.problem(index) or "nothing was found")
        return f"{name}: <b>no edge</b>, {reason}{pointing}"
    edges: list[tuple[tuple[int, int, int], str]] = [(OUTER_COLOR, "outer edge")]
    if section.lumen is not None:
        edges.append((LUMEN_COLOR, "lumen"))
    lines = " ".join(
        f"<span style='color:rgb{color};white-space:nowrap'>&#9644; {what}</span>"
        for color, what in edges
    )
    return f"{name}: {lines}{pointing}"


def _result_html(built: BuiltOrgan, opened: OpenedStack) -> str:
    pixel, stack, organ = opened.stack.mean_pixel, opened.stack, built.organ
    bytes_out = len(organ.encoded)
    rows = (
        ("Promise", _lengths(built.tolerance_mm, pixel)),
        (
            "Sections",
            f"{built.sections_in} in, {built.sections_found} found, {built.sections_kept} kept",
        ),
        ("RMS error", _lengths(built.rms_error_mm, pixel)),
        ("Largest error", _lengths(built.max_error_mm, pixel)),
        (
            "Bytes",
            f"{stack.bytes_in:,} in, {bytes_out:,} out, ratio {stack.bytes_in / bytes_out:,.0f}",
        ),
        (
            "Organ",
            f"{'hollow' if organ.hollow else 'solid'}, {figure(organ.length)} mm long, mean "
            f"radius {figure(organ.mean_radius)} mm",
        ),
    )
    table = rows_html(rows, "padding:1px 10px 1px 0;opacity:.75;white-space:nowrap", "")
    remarks = [*stack.notes, *(each for each in built.warnings if each not in built.doubts)]
    remarks += _unfit(organ)
    message = "".join(
        f"<div style='padding-top:4px'>{html.escape(each)}.</div>" for each in remarks
    )
    doubts = _doubts_html(built) if built.doubts else ""
    return (
        f"<div data-testid='build-result' data-kept='{built.sections_kept}' "
        f"data-bytes='{bytes_out}' data-tolerance-mm='{built.tolerance_mm:.9g}' "
        f"data-doubts='{len(built.doubts)}' style='padding:4px 0 8px;font-size:13px'>{doubts}"
        f"<div style='padding:0 12px'><table>{table}</table>{message}</div></div>"
    )


def _doubts_html(built: BuiltOrgan) -> str:
    listed = "".join(f"<li>{html.escape(each)}</li>" for each in built.doubts)
    return (
        f"<div data-testid='build-doubts' style='margin:2px 12px 8px;padding:6px 10px;"
        f"border-left:4px solid rgb{OUTER_COLOR};background:rgba(230,159,0,.14);font-size:13px;"
        f"line-height:1.4'><b>{DOUBTFUL.capitalize()}:</b>"
        f"<ul style='margin:4px 0;padding-left:18px'>{listed}</ul>Click on the organ in the image, "
        f"or set the images and the region under <i>Look only here</i>.</div>"
    )


def _lengths(length: float, pixel: float) -> str:
    return f"{length / pixel:.3f} px, {length:.4f} mm"


def _unfit(organ: Organ) -> list[str]:
    """Return why some presets do not suit an organ."""
    unfit = [preset.title for preset in presets().values() if not fits(organ, preset)]
    if not unfit:
        return []
    return [
        f"the organ is too short or too thick to be clamped as {', '.join(unfit)}; practised on, "
        f"it is {default_preset(organ).title} or another that takes its own sections"
    ]
