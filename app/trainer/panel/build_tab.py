"""Build: an organ of one's own images, from the edges in them to the duct that is practised on."""

import html
import logging
import math
import threading
import time
from collections.abc import Callable

import numpy as np
import viser

from app.compression.edge_picture import LUMEN_COLOR, OUTER_COLOR
from app.compression.image_upload import UploadRefusedError
from app.compression.organ_workbench import Abandoned, OpenedStack, OrganWorkbench
from app.simulation.dissection import default_preset, fits
from app.simulation.preset import presets
from app.trainer.panel.controls import figure, note, number, on_click, on_input
from app.trainer.workplace import Workplace
from assets import BILE_DUCT_PHANTOM
from organ_geometry.organ import Organ
from organ_geometry.organ_builder import BuiltOrgan

__all__ = ["BuildTab"]

_TELLING = (
    "Images across an organ become its surface: its edge is found in each, and only the images are "
    "kept that the others cannot be drawn from to within a threshold."
)
THRESHOLDS = (0.05, 3.0)
"""Ends of the threshold's slider, px."""
THRESHOLD_STEP = 0.01
SUITABLE = 0.7
"""px: the slider's, until there is an organ."""
TELLS_EVERY = 0.25
"""Shortest time between two reports of progress, s."""
MOST_MM = 1000.0

log = logging.getLogger(__name__)


class BuildTab:
    """The tab in which an organ is built; it does nothing before a button is pressed.

    Parameters
    ----------
    gui
        The client's own GUI, inside the tab.
    workplace
        The client's workplace.
    """

    def __init__(self, gui: viser.GuiApi, workplace: Workplace) -> None:
        self._workplace = workplace
        self._bench = OrganWorkbench(process=workplace.build_process)
        self._status = gui.add_html(note(_TELLING, "build-status"))
        self._phantom = gui.add_button(
            "Use the built-in phantom", icon=viser.Icon.STACK_2, hint="128 images of a bile duct"
        )
        self._pixel = gui.add_number(
            "Pixel (mm)",
            0.0,
            min=0.0,
            max=MOST_MM,
            step=0.001,
            hint="Side of a pixel of your images; 0 if a spacing.json in the zip says it",
        )
        self._slice = gui.add_number(
            "Slice distance (mm)",
            0.0,
            min=0.0,
            max=MOST_MM,
            step=0.001,
            hint="From image to image; 0 if a spacing.json in the zip says it",
        )
        self._send = gui.add_upload_button(
            "Open images",
            icon=viser.Icon.UPLOAD,
            color="gray",
            mime_type=".zip,.tif,.tiff",
            hint="A zip of PNG, JPEG, TIFF or BMP images, or one TIFF of many pages",
        )
        self._again = gui.add_button(
            "Read them with these sizes", icon=viser.Icon.REFRESH, color="gray", visible=False
        )
        self._index = gui.add_slider("Image", min=0, max=1, step=1, initial_value=0, visible=False)
        self._image = gui.add_image(np.zeros((1, 1, 3), np.uint8), format="png", visible=False)
        self._caption = gui.add_html("", visible=False)
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
        self._told_at = 0.0
        self._wishes = 0
        self._lock = threading.Lock()
        on_click(self._phantom, self._use_phantom)
        on_click(self._again, self._use_upload)
        on_click(self._practise, self._practise_on_it)
        on_click(self._download, self._send_organ)
        on_input(self._index, lambda _: self._look())
        on_input(self._threshold, self._wish)

        @self._send.on_upload
        def _(_: object) -> None:
            self._use_upload()

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
                self._again.visible = False  # no sizes help
                raise

        self._make(lambda: self._open(read))

    def _wish(self, value: object) -> None:
        """Build at the threshold that the slider has come to."""
        wanted = number(value)
        if math.isfinite(wanted) and self._bench.opened is not None:
            wanted = min(max(wanted, THRESHOLDS[0]), THRESHOLDS[1])
            self._make(lambda: self._build(wanted))

    def _make(self, work: Callable[[], None]) -> None:
        """Do something that takes seconds, if nothing newer is wished for before it begins."""
        with self._lock:
            self._wishes += 1
            wish = self._wishes
        builder, kind = self._workplace.builder, (id(self), "build")
        before = builder.others_before(kind)
        self._say(_waiting(before) if before else "One moment.")

        def do() -> None:
            try:
                self._say("One moment.")
                work()
            except Abandoned:
                return
            except ValueError as error:
                said = f"<b>Not possible:</b> {html.escape(str(error))}."
                self._workplace.refuse(f"{error}.")  # beside viser's word that the file has come
            except Exception:
                log.exception("an organ could not be built")
                said = "<b>Not possible:</b> a fault of the program."
            else:
                said = ""
            if wish == self._wishes:
                self._say(said)
            self._show_result()

        builder.do(kind, do)

    def _open(self, read: Callable[[], OpenedStack]) -> None:
        opened = read()
        count = len(opened.stack)
        self._index.visible = False
        self._index.max = max(count - 1, 1)
        self._index.value = count // 2
        for handle in (self._index, self._image, self._caption):
            handle.visible = True
        self._picture()
        self._show_result()
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
        if now - self._told_at > TELLS_EVERY:
            self._told_at = now
            self._say(f"Finding edges: {done} of {total} images.")

    def _say(self, content: str) -> None:
        self._status.content = note(content or _TELLING, "build-status")

    def _look(self) -> None:
        self._workplace.background.do((id(self), "picture"), self._picture)

    def _picture(self) -> None:
        opened = self._bench.opened
        if opened is None:
            return
        value = number(self._index.value)
        last = len(opened.stack) - 1
        index = min(max(round(value), 0), last) if math.isfinite(value) else 0
        try:
            self._image.image = opened.picture(index)
        except ValueError as error:
            caption = html.escape(str(error))
        else:
            caption = _caption(opened, index)
        self._caption.content = note(caption, "build-caption")

    def _show_result(self) -> None:
        opened, built = self._bench.opened, self._bench.built
        self._threshold.visible = opened is not None
        for handle in (self._result, self._practise, self._download):
            handle.visible = built is not None
        if opened is not None and built is not None:
            self._result.content = _result_html(built, opened)

    def _practise_on_it(self) -> None:
        built = self._bench.built
        if built is not None:
            workplace = self._workplace
            workplace.attempt("Preparing your duct.", lambda: workplace.practise_on(built.organ))

    def _send_organ(self) -> None:
        built, opened = self._bench.built, self._bench.opened
        if built is not None and opened is not None:
            self._workplace.client.send_file_download(
                f"{opened.source.stem}.organ", built.organ.encoded, save_immediately=True
            )


def _waiting(before: int) -> str:
    """Return what is said to somebody whose organ is not begun yet."""
    organs = "another organ is" if before == 1 else f"{before} other organs are"
    return f"Waiting: {organs} being built first."


def _length(value: object) -> float | None:
    """Return a length that was given, mm, or None."""
    length = number(value)
    return length if math.isfinite(length) and length > 0.0 else None


def _caption(opened: OpenedStack, index: int) -> str:
    """Return what is seen in an image, as HTML."""
    name = html.escape(opened.stack.names[index])
    section = opened.sections.get(index)
    if section is None:
        reason = html.escape(opened.problem(index) or "nothing was found")
        return f"{name}: <b>no edge</b>, {reason}"
    edges: list[tuple[tuple[int, int, int], str]] = [(OUTER_COLOR, "outer edge")]
    if section.lumen is not None:
        edges.append((LUMEN_COLOR, "lumen"))
    lines = " ".join(
        f"<span style='color:rgb{color};white-space:nowrap'>&#9644; {what}</span>"
        for color, what in edges
    )
    return f"{name}: {lines}"


def _result_html(built: BuiltOrgan, opened: OpenedStack) -> str:
    """Return the report of an organ, as HTML."""
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
    table = "".join(
        f"<tr><td style='padding:1px 10px 1px 0;opacity:.75;white-space:nowrap'>{name}</td>"
        f"<td>{value}</td></tr>"
        for name, value in rows
    )
    remarks = [*stack.notes, *built.warnings, *_unfit(organ)]
    said = "".join(f"<div style='padding-top:4px'>{html.escape(each)}.</div>" for each in remarks)
    return (
        f"<div data-testid='build-result' data-kept='{built.sections_kept}' "
        f"data-bytes='{bytes_out}' data-tolerance-mm='{built.tolerance_mm:.9g}' "
        f"style='padding:4px 12px 8px;font-size:13px'><table>{table}</table>{said}</div>"
    )


def _lengths(length: float, pixel: float) -> str:
    return f"{length / pixel:.3f} px, {length:.4f} mm"


def _unfit(organ: Organ) -> list[str]:
    """Return what is to be said of the presets that an organ is too short for."""
    short = [preset.title for preset in presets().values() if not fits(organ, preset)]
    if not short:
        return []
    return [
        f"the organ is too short to be clamped as {', '.join(short)}; practised on, it is "
        f"{default_preset(organ).title} or another that takes its own sections"
    ]
