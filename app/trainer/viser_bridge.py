"""All that reaches past viser's public face: its private names, and the page's style and script.

viser has no call for what is here. Each part says what viser lacks, and `test_viser_bridge` has a
test for each that names what broke when another viser is installed. The style and the script lean
on the page as viser 1.1.1 makes it: class names of its widgets (Mantine 9), `data-dock-` attributes
of its panels, and `window.__viserMutable` with the scene, the camera and the connection.
"""

import asyncio
import json
import secrets
from collections.abc import Iterable
from typing import Any

import viser
from viser import _messages  # pyright: ignore[reportPrivateUsage]
from viser._icons import svg_from_icon  # pyright: ignore[reportPrivateUsage]

__all__ = [
    "announce",
    "close_silent",
    "closer_html",
    "command_number",
    "keep_in_sight",
    "kept_by_tab",
    "letter_keys_on",
    "offer_home",
    "open_tab",
    "prepare_page",
    "read_icons",
    "refuse_tunnels",
    "run_in_page",
    "set_arrow_step",
    "set_letter_keys",
    "steady_light",
    "tab_keeps",
    "write_caption",
]

ANSWER_SECONDS = 4.0
"""How long a browser may take to say what it keeps: one that draws in software is busy at first."""


def refuse_tunnels(server: viser.ViserServer) -> None:
    """Let no client ask viser for a public tunnel to this server, as any could."""
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType]


def close_silent(server: viser.ViserServer, suspects: set[int]) -> set[int]:
    """Close the connections that were silent the last time and still are: they are no pages."""
    websockets = server._websock_server  # pyright: ignore[reportPrivateUsage]
    loop = server.get_event_loop()
    connections = dict(websockets._live_connections)  # pyright: ignore[reportPrivateUsage]
    silent = connections.keys() - server.get_clients().keys()
    for number in silent & suspects:
        asyncio.run_coroutine_threadsafe(connections[number].close(), loop)
    return silent - suspects


def read_icons(icons: Iterable[viser.IconName]) -> None:
    """Read icons before they are needed: viser reads a list of six thousand for each new one."""
    for icon in icons:
        svg_from_icon(icon)


def prepare_page(client: viser.ClientHandle) -> None:
    """Give a page its style, and the script that the other calls lean on; before them."""
    _run(client, _SCRIPT)


def announce(client: viser.ClientHandle, words: str) -> None:
    """Let a screen reader say something when it has said what it is saying."""
    _call(client, "say", words)


def offer_home(
    client: viser.ClientHandle, command: viser.CommandHandle, label: str, hint: str
) -> None:
    """Put a button over the picture that does what a command does."""
    _call(client, "offerHome", command._impl.uuid, label, hint)  # pyright: ignore[reportPrivateUsage]


def open_tab(client: viser.ClientHandle, label: str) -> None:
    """Open the tab of the panel that has a label; as soon as it is there."""
    _call(client, "openTab", label)


def set_arrow_step(
    client: viser.ClientHandle, slider: viser.GuiSliderHandle[float], percent: float
) -> None:
    """Let an arrow key move a slider by a percent of a scale of one's own, with Shift by a tenth.

    Parameters
    ----------
    client
        The client.
    slider
        Its slider.
    percent
        A hundredth of the scale, in the slider's unit.
    """
    uuid = slider._impl.uuid  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType]
    _call(client, "setArrowStep", uuid, percent, slider.precision)


def keep_in_sight(
    client: viser.ClientHandle,
    *,
    place: tuple[float, float, float],
    target: tuple[float, float, float],
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    nearest: float,
    lowest: float,
) -> None:
    """Put a client's camera where it belongs, and bound where it can be taken from there."""
    _call(client, "keepInSight", place, target, low, high, nearest, lowest)


def kept_by_tab(client: viser.ClientHandle) -> str | None:
    """Return what a browser's tab keeps for itself; None where it keeps nothing, or says nothing.

    viser reads the browser's storage only, which all of its tabs share: the script lays the tab's
    own beside it for a moment, under a name that no other page knows.

    Parameters
    ----------
    client
        The client.

    Returns
    -------
    str | None
        What `tab_keeps` has given it.
    """
    name = f"tab-{secrets.token_hex(8)}"
    _call(client, "showKept", name)
    try:
        return client.local_storage.get_item(name, ANSWER_SECONDS) or None
    except (RuntimeError, TimeoutError):
        return None
    finally:
        client.local_storage.remove_item(name)


def tab_keeps(client: viser.ClientHandle, value: str) -> None:
    """Let a browser's tab keep a text until it is closed, through every reload."""
    _call(client, "keep", value)


def letter_keys_on(client: viser.ClientHandle) -> bool:
    """Return whether single letters are keys in this browser, as they are until it is said."""
    try:
        return client.local_storage.get_item(_LETTER_KEYS, ANSWER_SECONDS) != "off"
    except (RuntimeError, TimeoutError):
        return True


def set_letter_keys(client: viser.ClientHandle, on: bool) -> None:
    """Let single letters be keys in this browser, or not; it is kept there."""
    client.local_storage.set_item(_LETTER_KEYS, "on" if on else "off")


def closer_html() -> str:
    """Return the mark that makes the next button of a dialog the one that closes it."""
    return f"<div class='{_CLOSER}'></div>"


def _call(client: viser.ClientHandle, name: str, *arguments: Any) -> None:
    given = ", ".join(json.dumps(each) for each in arguments)
    _run(client, f"window.bluntdissect?.{name}({given})")


def write_caption(server: viser.ViserServer, words: str) -> None:
    """Write into the line of a recording's page that is named `caption`.

    viser's own labels are drawn: no screen reader reads them, and what stands over the picture
    hides them.
    """
    run_in_page(
        server.scene, f"document.getElementById('caption').textContent = {json.dumps(words)}"
    )


def steady_light(page: str) -> str:
    """Return a page of a recording that keeps the recording's light whenever it starts over."""
    head, rest = page.split("</head>", 1)
    return f"{head}<script>{_STEADY_LIGHT}</script></head>{rest}"


def _run(client: viser.ClientHandle, source: str) -> None:
    _queue(client.gui, source)


def run_in_page(scene: viser.SceneApi, source: str) -> None:
    """Run a script in the page of a client's scene."""
    _queue(scene, source)


def command_number(command: viser.CommandHandle) -> str:
    """Return what the page knows a command by."""
    return command._impl.uuid  # pyright: ignore[reportPrivateUsage]


def _queue(channel: viser.SceneApi | viser.GuiApi, source: str) -> None:
    channel._websock_interface.queue_message(  # pyright: ignore[reportPrivateUsage]
        _messages.RunJavascriptMessage(source=source)
    )


_CLOSER = "bd-closer"
_LETTER_KEYS = "letter-keys"
_PANEL = ":has([data-testid=readout])"
_FIELD = ".mantine-NumberInput-root"
_STYLE = f"""
/* Notifications go below the dialogs, so that they do not cover these. */
.mantine-Notifications-root{{z-index:90!important}}
/* A number field beside a disabled slider is disabled too. */
:has(>.mantine-Slider-root [data-disabled]) {_FIELD}{{pointer-events:none;opacity:.5}}
/* Words that can be read, and what can be hit: 24 px at least. */
:root[data-mantine-color-scheme=dark]{{--mantine-color-dimmed:#b8babf}}
.mantine-Slider-thumb::after{{content:"";position:absolute;inset:-8px -9px}}
.mantine-NumberInput-input{{min-height:24px!important;height:24px!important}}
.mantine-Checkbox-root{{--checkbox-size:24px!important}}
.mantine-ActionIcon-root,.mantine-CloseButton-root,[data-dock-region-collapse]
{{min-width:24px;min-height:24px}}
summary{{min-height:24px;align-items:center}}
.mantine-NumberInput-controls{{display:none}}
/* What scrolls leaves room for the scroll bar. */
.mantine-ScrollArea-content{_PANEL}{{padding-right:8px}}
/* viser's own settings and scene tree are no trainee's. */
.mantine-ActionIcon-root:has(.tabler-icon-adjustments){{display:none!important}}
/* Tabs stay in one row, which scrolls where it is too long. */
[role=tablist]{{flex-wrap:nowrap!important;overflow-x:auto!important;scrollbar-width:thin;
touch-action:pan-x!important}}
[role=tablist]>[role=tab]{{flex:1 0 auto;justify-content:center;min-width:24px;
padding:0 .55em!important;opacity:1!important}}
[role=tablist]>[role=tab][data-dock-tab][aria-selected=true]{{color:#5eead4!important;
box-shadow:inset 0 -2px 0 0 #5eead4!important}}
/* A dialog's closing button stands in its corner, and stays there while it is scrolled. */
.mantine-Modal-body :has(>.{_CLOSER})+*{{position:sticky;top:60px;z-index:1001;height:0;
margin:0!important;padding:0!important}}
.mantine-Modal-body :has(>.{_CLOSER})+* button{{position:absolute;right:2px;top:-52px;width:34px;
height:34px!important;padding:0;background:transparent;color:inherit}}
.mantine-Modal-body :has(>.{_CLOSER})+* .mantine-Button-section{{margin:0 auto}}
.mantine-Modal-body :has(>.{_CLOSER})+* .mantine-Button-inner{{display:flex;width:100%}}
.mantine-Modal-body :has(>.{_CLOSER})+* .mantine-Button-label,.bd-unseen
{{position:absolute!important;width:1px;height:1px;overflow:hidden;clip-path:inset(50%);
white-space:nowrap}}
.mantine-Modal-content:has([data-testid=measures]){{flex-basis:620px}}
.mantine-Modal-content{{--modal-y-offset:2dvh;max-height:96dvh!important}}
/* Over the picture. */
#bd-home{{position:absolute;right:12px;bottom:12px;z-index:2;min-height:32px;padding:4px 12px;
border:1px solid rgba(255,255,255,.35);border-radius:6px;background:rgba(20,21,24,.82);
color:#f1f3f5;font:500 13px/1.3 system-ui,sans-serif;cursor:pointer}}
#bd-home:hover{{background:#2b2d31}}
#bd-home:focus-visible{{outline:2px solid #5eead4;outline-offset:2px}}
@media (max-width:576px){{
/* The Model tab says it too; here the force would leave the screen. */
[data-testid='strength']{{display:none}}
#bd-home{{top:8px;right:8px;bottom:auto}}
.bd-wide{{display:none}}
.mantine-Paper-root{_PANEL},.mantine-Paper-root [style*='width: 20em']{_PANEL}
{{width:100%!important}}
.mantine-Paper-root [data-testid=heat-legend]{{position:fixed;top:48px;left:6px;width:170px;
padding:5px 8px!important;border-radius:6px;background:rgba(26,27,30,.8);font-size:11px!important}}
.mantine-Notifications-root{{top:4px!important;left:6px!important;width:calc(100% - 12px)!important;
max-width:none!important}}
}}
@media (prefers-reduced-motion:reduce){{
*,::before,::after{{animation-duration:.01ms!important;animation-iteration-count:1!important;
transition-duration:.01ms!important;scroll-behavior:auto!important}}
}}
"""

_SCRIPT = (
    """
if (!window.bluntdissect) {
const page = window.bluntdissect = {};
const viewer = () => window.__viserMutable;
const later = (ready, run) => ready() ? run() : setTimeout(() => later(ready, run), 50);
document.title = "Blunt-dissection trainer";
const style = document.createElement("style");
style.textContent = @style;
document.head.append(style);

// What a screen reader says: one place that stays, whose words change.
const said = document.createElement("div");
said.id = "bd-said";
said.className = "bd-unseen";
said.setAttribute("role", "status");
document.body.append(said);
page.say = words => { said.textContent = words; };

// What this tab keeps for itself.
page.keep = value => { try { sessionStorage.setItem("bd-kept", value); } catch (error) {} };
page.showKept = name => {
  try { localStorage.setItem(STORED + name, sessionStorage.getItem("bd-kept") ?? ""); }
  catch (error) {}
};

// A button over the picture; a command of viser's is what it does.
const home = document.createElement("button");
home.id = "bd-home";
home.type = "button";
page.offerHome = (uuid, label, hint) => {
  home.textContent = label;
  home.title = hint;
  home.onclick = () => viewer().sendMessage({type: "CommandTriggerMessage", uuid});
  later(() => viewer()?.canvas2d, () => viewer().canvas2d.parentElement.append(home));
};

// A tab is opened: of the panel at the side by a key, of a phone's by a click; once it is there.
page.openTab = (label, until = performance.now() + 5000) => {
  const tab = [...document.querySelectorAll("[role=tab]")]
    .find(each => each.textContent.trim() === label);
  if (tab?.getAttribute("aria-selected") === "true") return;
  tab?.click();
  tab?.dispatchEvent(new KeyboardEvent("keydown", {key: "Enter", bubbles: true}));
  if (performance.now() < until) setTimeout(() => page.openTab(label, until), 50);
};

// The camera: neither lost nor below the floor, and without the line that viser draws to a hand.
const STEEPEST = 1.35, FLATTEST = 0.15;
let bounds = null, guarded = null;
page.keepInSight = (place, target, low, high, nearest, lowest) => {
  bounds = {place, target, low, high, nearest, lowest};
  later(() => viewer()?.cameraControl && viewer().scene && viewer().nodeRefFromName[""], bound);
};
const bound = () => {
  const {cameraControl: camera, scene, nodeRefFromName} = viewer();
  const world = nodeRefFromName[""].matrixWorld, point = camera.camera.position.clone();
  const inWorld = at => point.clone().set(...at).applyMatrix4(world);
  const corners = [bounds.low, bounds.high].map(inWorld);
  camera.setBoundary({min: corners[0].clone().min(corners[1]), max: corners[0].max(corners[1])});
  camera.minDistance = bounds.nearest;
  camera.minPolarAngle = FLATTEST;
  if (matchMedia("(prefers-reduced-motion: reduce)").matches) camera.smoothTime = 0;
  camera.setLookAt(...inWorld(bounds.place), ...inWorld(bounds.target), false);
  for (const child of scene.children)
    if (child.line && child.cone) child.line.visible = child.cone.visible = false;
  if (guarded === camera.camera) return;
  guarded = camera.camera;
  const keep = () => {
    const up = camera.camera.up, lookedAt = camera.getTarget(point).dot(up);
    const rise = (bounds.lowest - lookedAt) / camera.distance;
    camera.maxPolarAngle = Math.min(STEEPEST, Math.acos(Math.min(Math.max(rise, -1), 0.999)));
    if (camera.polarAngle > camera.maxPolarAngle) camera.rotatePolarTo(camera.maxPolarAngle, false);
  };
  camera.addEventListener("update", keep);
  keep();
};
// viser's keys for walking with the camera are in nobody's way, nor its arrows in a widget's; and
// who wants none has no single letter for a key.
const STORED = "viser-user:";
const lettersOff = () => {
  try { return localStorage.getItem(STORED + "@letterKeys") === "off"; }
  catch (error) { return false; }
};
document.body.addEventListener("keydown", event => {
  const own = event.target.closest?.("input,textarea,[role=slider],[role=tab],[role=option]");
  const letter = /^Key/.test(event.code) && !event.ctrlKey && !event.metaKey && !event.altKey;
  if (letter && (lettersOff() || (/[WASDQE]$/.test(event.code) && !own))) event.stopPropagation();
  if (own && event.key.startsWith("Arrow")) event.stopPropagation();
});

// A hand takes what is near: a finger is wide, and a mouse is not always aimed well.
const REACH = {touch: 30, pen: 22, mouse: 18};  // px from the tube, which lies inside the duct
let reach = REACH.mouse;
const widened = new WeakSet();
const widen = event => {
  reach = REACH[event.pointerType] ?? REACH.mouse;
  for (const [name, node] of Object.entries(viewer()?.nodeRefFromName ?? {}))
    if (node && /[/]grip(_[0-9])?$/.test(name)) node.traverse(mesh => {
      if (!mesh.isMesh || widened.has(mesh) || !mesh.geometry?.index) return;
      widened.add(mesh);
      const exact = mesh.raycast;
      mesh.raycast = function (caster, hits) {
        const before = hits.length;
        exact.call(this, caster, hits);
        if (hits.length === before) takeNear(this, caster, hits);
      };
    });
};
window.addEventListener("pointermove", widen, true);
window.addEventListener("pointerdown", widen, true);
const takeNear = (mesh, {ray, camera}, hits) => {
  // The edge of the mesh that is nearest in the picture: inside of it the ray would have hit.
  const canvas = viewer().canvas, half = [canvas.clientWidth / 2, canvas.clientHeight / 2];
  const place = mesh.geometry.attributes.position, index = mesh.geometry.index.array;
  const pointer = ray.origin.clone().addScaledVector(ray.direction, 100).project(camera);
  const x = pointer.x * half[0], y = pointer.y * half[1];
  const seen = [], world = [];
  for (let i = 0; i < place.count; i++) {
    const at = pointer.clone().fromBufferAttribute(place, i).applyMatrix4(mesh.matrixWorld);
    world.push(at);
    const shown = at.clone().project(camera);
    seen.push([shown.x * half[0], shown.y * half[1], shown.z]);
  }
  let best = reach, found = null;
  for (let i = 0; i < index.length; i++) {
    const a = index[i], b = index[i % 3 === 2 ? i - 2 : i + 1];
    const [ax, ay, az] = seen[a], [bx, by, bz] = seen[b];
    if (az > 1 || bz > 1) continue;
    const dx = bx - ax, dy = by - ay, along = dx * dx + dy * dy;
    const part = along ? Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / along, 0), 1) : 0;
    const away = Math.hypot(x - ax - part * dx, y - ay - part * dy);
    if (away < best) { best = away; found = [a, b, part]; }
  }
  if (!found) return;
  const edge = world[found[0]].clone().lerp(world[found[1]], found[2]);
  const point = ray.closestPointToPoint(edge, pointer);
  // Behind all that is hit exactly, the nearest in the picture first.
  hits.push({distance: 1e6 + best, point, object: mesh});
};

// Number fields. viser's clamp to their range when they are left, keep what is no number as an
// empty field, and take the caret's place from the last key. A new text that comes without a key,
// as from a clipboard, would be put where an Enter long ago has left the caret, and be refused.
const typed = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
const write = (field, text) => {
  typed.set.call(field, text);
  field.dispatchEvent(new Event("input", {bubbles: true}));
};
let shown = "";
const inFields = (kind, take) => document.addEventListener(kind, event => {
  const field = event.target;
  if (field instanceof HTMLInputElement && field.matches(".mantine-NumberInput-input"))
    take(field, event);
}, true);
inFields("focusin", field => {
  shown = field.value;
  const row = field.closest(".mantine-NumberInput-root").parentElement;
  if (row.querySelector(".mantine-Slider-root [data-disabled]")) field.blur();
});
inFields("keydown", (field, event) => {
  if (event.key !== "Enter") return;
  event.stopPropagation();
  field.blur();
});
inFields("focusout", field => {
  if (/\\d/.test(field.value)) return;
  const before = shown;
  setTimeout(() => {
    const next = document.activeElement;
    write(field, before);
    field.blur();  // it takes the focus with its new value
    if (next !== field) next.focus();
  });
});

// Arrows on a slider and in its field: a percent of its own scale, a tenth of one with Shift.
const percents = {};
page.setArrowStep = (uuid, percent, digits) => { percents[uuid] = [percent, digits]; };
const WAYS = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1};
document.addEventListener("keydown", event => {
  const from = event.target, way = WAYS[event.key];
  if (!way || event.ctrlKey || event.metaKey || event.altKey) return;
  const inField = from.matches?.(".mantine-NumberInput-input");
  if (inField ? !event.key.match(/Up|Down/) : from.getAttribute?.("role") !== "slider") return;
  const row = from.closest(".mantine-Flex-root");
  const slider = row?.querySelector(".mantine-Slider-root");
  const [percent, digits] = percents[slider?.id] ?? [];
  const thumb = slider?.querySelector("[role=slider]");
  if (!percent || thumb.getAttribute("aria-disabled") === "true") return;
  event.preventDefault();
  event.stopPropagation();
  const now = Number(thumb.getAttribute("aria-valuenow")) / percent;
  const wanted = (Math.round(10 * now) / 10 + way * (event.shiftKey ? 0.1 : 1)) * percent;
  const [low, high] = ["min", "max"].map(end => Number(thumb.getAttribute("aria-value" + end)));
  const field = row.querySelector(".mantine-NumberInput-input");
  write(field, Math.min(Math.max(wanted, low), high).toFixed(digits));
  from.focus();
}, true);

// Dialogs close by Escape and by a click beside them, as by the button in their corner.
const closer = dialog => dialog?.querySelector(":has(> .@closer) + * button");
window.addEventListener("keydown", event => {
  const lists = [...document.querySelectorAll("[role=listbox]")];
  if (event.key !== "Escape" || lists.some(list => list.checkVisibility())) return;
  closer([...document.querySelectorAll("[role=dialog]")].at(-1))?.click();
}, true);
const besideOf = ({target}) =>
  target.closest?.("[role=dialog]") ? null : target.closest?.(".mantine-Modal-root");
let pressed = null;
document.addEventListener("pointerdown", event => { pressed = besideOf(event); }, true);
document.addEventListener("click", event => {
  if (pressed && besideOf(event) === pressed)
    closer(pressed.querySelector("[role=dialog]"))?.click();
}, true);

// Names for what viser leaves without one.
const name = (element, words) => {
  if (element && words && element.getAttribute("aria-label") !== words)
    element.setAttribute("aria-label", words);
};
const NAMED = {"list-search": "All commands", maximize: "Enlarge", adjustments: "Settings"};
const tend = () => {
  for (const label of document.querySelectorAll("label[for]")) {
    const widget = document.getElementById(label.htmlFor), words = label.textContent;
    if (!widget?.matches(".mantine-Slider-root")) continue;
    const thumb = widget.querySelector("[role=slider]");
    const field = widget.parentElement.querySelector(".mantine-NumberInput-input");
    name(thumb, words);
    name(field, words);
    field?.setAttribute("aria-disabled", thumb.getAttribute("aria-disabled"));
  }
  for (const [icon, words] of Object.entries(NAMED))
    for (const svg of document.querySelectorAll(".tabler-icon-" + icon))
      name(svg.closest("button"), words);
  for (const cross of document.querySelectorAll(".mantine-CloseButton-root")) name(cross, "Close");
  for (const bar of document.querySelectorAll("[role=progressbar]")) name(bar, "Progress");
  for (const image of document.querySelectorAll("img:not([alt])")) image.alt = "";
  for (const plot of Object.values(window.__viserTestpoints?.uplots ?? {})) {
    const [across, up] = plot.chart?.axes ?? [];
    plot.chart?.root.setAttribute("role", "img");
    name(plot.chart?.root, `Plot of ${up?.label} over ${across?.label}`);
  }
  const canvas = viewer()?.canvas;
  canvas?.setAttribute("role", "img");
  name(canvas, "The duct between its clamps, and the hook that pulls it");
};

// viser's images do not say where they were clicked: the pixel goes into the next text field.
document.addEventListener("click", event => {
  const image = event.target;
  if (!(image instanceof HTMLImageElement) || !image.dataset.columns) return;
  const box = image.getBoundingClientRect();
  const pixel = (place, start, length, count) =>
    Math.min(Math.max(Math.floor((place - start) / length * count), 0), count - 1);
  const x = pixel(event.clientX, box.left, box.width, Number(image.dataset.columns));
  const y = pixel(event.clientY, box.top, box.height, Number(image.dataset.rows));
  const field = [...document.querySelectorAll("input.mantine-TextInput-input")].find(
    each => image.compareDocumentPosition(each) & Node.DOCUMENT_POSITION_FOLLOWING);
  if (!field) return;
  const value = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
  value.set.call(field, `${x},${y},${image.dataset.image}`);
  field.dispatchEvent(new Event("input", {bubbles: true}));
});

let due = false;
new MutationObserver(() => {
  if (due) return;
  due = true;
  setTimeout(() => { due = false; tend(); }, 100);
}).observe(document.body, {childList: true, subtree: true, attributeFilter: ["aria-disabled"]});
tend();
}
""".replace("@style", json.dumps(_STYLE))
    .replace("@closer", _CLOSER)
    .replace("@letterKeys", _LETTER_KEYS)
)
"""Run once in a page; a page that has connected again has it already."""

_STEADY_LIGHT = """
(function start() {
  const scene = window.__viserMutable?.scene;
  if (!scene) return requestAnimationFrame(start);
  let fog = null;
  const before = scene.onBeforeRender;
  scene.onBeforeRender = (...given) => {
    before.apply(scene, given);
    scene.environment = null;
    scene.fog = fog = scene.fog ?? fog;
    scene.traverse((node) => { if (node.isDirectionalLight) node.visible = false; });
  };
})();
"""
