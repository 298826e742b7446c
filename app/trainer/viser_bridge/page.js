// The script of the trainer's page, run once: a page that has connected again has it already.
//
// It leans on the page as viser 1.1.1 makes it: window.__viserMutable (scene, camera, canvas,
// sendMessage), its element "root", class names of its widgets (Mantine 9) and data-dock- attributes
// of its panels.
(css, closerClass, beginClass, letterKeys) => {
if (window.bluntdissect) return;
const page = window.bluntdissect = {};
const viewer = () => window.__viserMutable;
const later = (ready, run) => ready() ? run() : setTimeout(() => later(ready, run), 50);
document.title = "Blunt-dissection trainer";
// Picture and panel are the page's main part, with a heading for who reads by headings.
const main = document.getElementById("root"), heading = document.createElement("h1");
heading.className = "bd-unseen";
heading.textContent = document.title;
main.setAttribute("role", "main");
main.prepend(heading);
const style = document.createElement("style");
style.textContent = css;
document.head.append(style);

// Over viser's own panel and empty picture, until there are ours; it follows the cover by style
// alone that the page came with.
const cover = document.createElement("div");
cover.id = "bd-cover";
cover.setAttribute("role", "status");
const COVER_MS = 15000;  // for which at most a panel is waited for that has been sent
// How long it has waited, for the eye: a screen reader would read out each second.
const waited = document.createElement("p");
waited.setAttribute("aria-hidden", "true");
let counting = 0;
const countFrom = start => {
  if (!waited.isConnected) return;
  waited.textContent = `${Math.round((performance.now() - start) / 1000)} s`;
  counting = setTimeout(countFrom, 1000, start);
};
let covered = 0;
const layCover = () => {
  covered++;
  document.body.append(cover);
};
page.cover = (waits, ...lines) => {
  cover.classList.toggle("bd-waits", waits);
  cover.replaceChildren(...lines.map(line => {
    const row = document.createElement("p");
    row.textContent = line;
    return row;
  }));
  layCover();
  clearTimeout(counting);
  if (waits) {
    cover.append(waited);
    countFrom(performance.now());
  }
  document.documentElement.classList.add("bd-ready");
};
page.uncover = () => {
  const from = performance.now(), laid = covered;
  const ours = () => document.querySelector("[data-testid=readout]");
  later(() => ours() || performance.now() - from > COVER_MS, () => { if (covered === laid) cover.remove(); });
};
// Where viser has connected again it sets this, and empties panel and picture before anything comes.
let first = viewer().firstMessageBatch;
Object.defineProperty(viewer(), "firstMessageBatch", {
  get: () => first,
  set(begins) {
    first = begins;
    if (begins) layCover();
  },
});

// What a screen reader says: one place that stays, whose words change.
const announcer = document.createElement("div");
announcer.id = "bd-status";
announcer.className = "bd-unseen";
announcer.setAttribute("role", "status");
document.body.append(announcer);
page.say = words => { announcer.textContent = words; };

// What this tab keeps for itself.
page.keep = value => { try { sessionStorage.setItem("bd-kept", value); } catch {} };
const show = (name, value) => {
  try { localStorage.setItem(STORED + name, value() ?? ""); } catch {}
};
page.showKept = name => show(name, () => sessionStorage.getItem("bd-kept"));
page.showAsked = (name, key) => show(name, () => new URLSearchParams(location.search).get(key));

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

// What in the panel's HTML names a command of viser's runs it, and keeps the focus when its
// HTML is replaced.
let chosen = null;
document.addEventListener("click", event => {
  const uuid = event.target.closest?.("[data-command]")?.dataset.command;
  if (!uuid) return;
  chosen = uuid;
  viewer().sendMessage({type: "CommandTriggerMessage", uuid});
});
document.addEventListener("focusin", event => {
  if (event.target.dataset?.command !== chosen) chosen = null;
});
const keepFocus = () => {
  if (chosen && document.activeElement === document.body)
    document.querySelector(`button[data-command="${chosen}"]`)?.focus();
};

// Arrows that are keys of their own turn no view, but with Ctrl.
let arrowsTaken = false;
page.takeArrows = taken => { arrowsTaken = taken; };
document.documentElement.addEventListener("keydown", event => {
  if (arrowsTaken && event.key.startsWith("Arrow") && !event.ctrlKey) event.stopPropagation();
});

// What was clicked keeps no keys: letters and arrows lead on. What keys have come to keeps them.
const CHOSEN = "[role=tab],[role=option],input[type=radio],input[type=checkbox]";
const letGo = () => document.activeElement?.blur();
let pointed = false;
document.addEventListener("pointerdown", () => { pointed = true; }, true);
document.addEventListener("keydown", () => { pointed = false; }, true);
for (const kind of ["click", "change"]) document.addEventListener(kind, event => {
  if (!pointed || !event.target.closest?.(CHOSEN)) return;
  letGo();
  // A list takes the focus back once it has closed.
  if (event.target.closest("[role=option]")) setTimeout(letGo);
});

// A tab is opened: of the panel at the side by a key, of a phone's by a click; once it is there.
page.openTab = (label, until = performance.now() + 30000) => {
  const tab = [...document.querySelectorAll("[role=tab]")]
    .find(each => each.textContent.trim() === label);
  if (tab?.getAttribute("aria-selected") === "true") return;
  tab?.click();
  tab?.dispatchEvent(new KeyboardEvent("keydown", {key: "Enter", bubbles: true}));
  if (performance.now() < until) setTimeout(() => page.openTab(label, until), 50);
};

// Scroll the panel to one of its lines.
page.bringIn = name => {
  const line = document.querySelector(`[data-testid=${name}]`), panel = line?.closest(".mantine-ScrollArea-viewport");
  // A line that stays in sight is brought to its own place, and what is below it with it.
  if (panel && getComputedStyle(line.parentElement).position === "sticky") panel.scrollTop = 0;
  else line?.scrollIntoView({block: "nearest"});
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
  try { return localStorage.getItem(STORED + letterKeys) === "off"; }
  catch { return false; }
};
// A key that is held down moves a tip, or opens, closes or turns jaws, evenly; any other letter acts
// once a press. So a tip goes at 8 mm/s, and jaws as fast.
const JAWS_MS = 120, TIP_MS = 60;
let acted = 0;
const tooSoon = ({key, repeat, timeStamp}) => {
  const every = key.startsWith("Arrow") ? TIP_MS : /^[ocjl]$/i.test(key) ? JAWS_MS : Infinity;
  if (repeat && timeStamp - acted < every) return true;
  acted = timeStamp;
  return false;
};
document.body.addEventListener("keydown", event => {
  const own = event.target.closest?.("input,textarea,[role=slider],[role=tab],[role=option]");
  const letter = /^Key/.test(event.code) && !event.ctrlKey && !event.metaKey && !event.altKey;
  const walks = /[WASDQE]$/.test(event.code) && !own;
  if (letter && (lettersOff() || walks || tooSoon(event))) event.stopPropagation();
  const arrow = event.key.startsWith("Arrow"), led = arrowsTaken && !event.ctrlKey;
  if (arrow && (own || (led && tooSoon(event)))) event.stopPropagation();
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
    const fraction = along ? Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / along, 0), 1) : 0;
    const away = Math.hypot(x - ax - fraction * dx, y - ay - fraction * dy);
    if (away < best) { best = away; found = [a, b, fraction]; }
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
  if (/\d/.test(field.value)) return;
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
const STEPS = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1};
document.addEventListener("keydown", event => {
  const from = event.target, step = STEPS[event.key];
  if (!step || event.ctrlKey || event.metaKey || event.altKey) return;
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
  const wanted = (Math.round(10 * now) / 10 + step * (event.shiftKey ? 0.1 : 1)) * percent;
  const [low, high] = ["min", "max"].map(end => Number(thumb.getAttribute(`aria-value${end}`)));
  const field = row.querySelector(".mantine-NumberInput-input");
  write(field, Math.min(Math.max(wanted, low), high).toFixed(digits));
  from.focus();
}, true);

// Help by the key of all programs.
window.addEventListener("keydown", event => {
  if (event.key !== "?" || lettersOff() || event.target.closest?.("input,textarea")) return;
  if (document.querySelector("[role=dialog]")) return;
  [...document.querySelectorAll("button")].find(each => each.textContent.trim() === "Help")?.click();
});

// The focus of a dialog that begins something is on what begins it.
const begun = new WeakSet();
const offer = () => {
  const button = document.querySelector(`:has(> .${beginClass}) + * button`);
  if (!button || begun.has(button)) return;
  begun.add(button);
  button.dataset.autofocus = "";  // for viser's own look for what to focus, which comes before or after
  button.focus();
};

// Dialogs close by Escape and by a click beside them, as by the button in their corner.
const closer = dialog => dialog?.querySelector(`:has(> .${closerClass}) + * button`);
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

const NOTICE_MS = 20000;  // for which viser's note of a page that draws in software is shown

// How fast a page draws the surfaces, or the scope's picture: some pictures are timed, drawn as fast as it can.
page.watchPace = (least, uuid, remedy) => {
  nameRemedy(remedy, 60);
  if (uuid) setTimeout(() => measurePace(rate => {
    if (rate < least) viewer().sendMessage({type: "CommandTriggerMessage", uuid});
  }), 3000);
};
// Where viser says that the page draws in software, say what helps.
const nameRemedy = (remedy, left) => {
  for (const text of document.querySelectorAll(".mantine-Notification-description"))
    if (text.textContent.includes("software mode") && !text.textContent.includes(remedy)) {
      text.append(` ${remedy}`);
      const close = text.closest(".mantine-Notification-root")?.querySelector("button");
      setTimeout(() => close?.click(), NOTICE_MS);
      return;
    }
  if (left) setTimeout(() => nameRemedy(remedy, left - 1), 500);
};
const measurePace = done => {
  const scene = viewer()?.scene, times = [];
  const drawn = window.bluntdissectSurfaces?.surfaces.size || window.bluntdissectScope?.picture?.drawn > 2;
  if (!scene || !drawn || document.hidden) {
    setTimeout(() => measurePace(done), 1000);
    return;
  }
  const before = scene.onAfterRender;
  let going = true;
  const stop = () => {
    if (!going) return;
    going = false;
    scene.onAfterRender = before;
    if (document.hidden) { setTimeout(() => measurePace(done), 1000); return; }
    const seconds = (times[times.length - 1] - times[0]) / 1000;
    done(times.length > 1 ? (times.length - 1) / seconds : 0);
  };
  scene.onAfterRender = (renderer, ...rest) => {
    before.call(scene, renderer, ...rest);
    const gl = renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));  // until it is done
    times.push(performance.now());
    if (times.length > 12) setTimeout(stop);
  };
  const ask = () => { if (going) { viewer().requestRender(); requestAnimationFrame(ask); } };
  ask();
  setTimeout(stop, 4000);
};

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
    for (const svg of document.querySelectorAll(`.tabler-icon-${icon}`))
      name(svg.closest("button"), words);
  for (const cross of document.querySelectorAll(".mantine-CloseButton-root")) name(cross, "Close");
  for (const bar of document.querySelectorAll("[role=progressbar]")) name(bar, "Progress");
  for (const image of document.querySelectorAll("img:not([alt])")) image.alt = "";
  for (const plot of Object.values(window.__viserTestpoints?.uplots ?? {})) {
    const [across, up] = plot.chart?.axes ?? [];
    if (!up?.label || !across?.label) continue;
    plot.chart.root.setAttribute("role", "img");
    name(plot.chart.root, `Plot of ${up.label} over ${across.label}`);
  }
  const canvas = viewer()?.canvas;
  canvas?.setAttribute("role", "img");
  name(canvas, "The duct between its clamps, and the instruments at it");
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
  setTimeout(() => { due = false; tend(); offer(); keepFocus(); }, 100);
}).observe(document.body, {childList: true, subtree: true, attributeFilter: ["aria-disabled"]});
tend();
}
