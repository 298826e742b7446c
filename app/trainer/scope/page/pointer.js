// Mouse, fingers and wheel at the scope's picture: the tip goes under the pointer, at its depth, or
// the handle goes as far as the pointer; the wheel takes the instrument in and out along its shaft.
// What is led goes to a widget of the server's as short texts; `viewer` is `run_picture`'s.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.lead) return;
  const { add, sub, dot, unit } = scope.algebra;
  const LEAST_MS = 33;       // between two messages of one movement
  const WHEEL_MM = 1.5, PINCH = 0.25;  // mm along the shaft: a notch of the wheel, and a dot of a pinch
  const QUICK_MS = 120, QUICK = 3;     // notches that follow in less time go so many times as far
  const LAGS_MS = 1000;      // for which what was led last counts, and not the tip that is drawn: pictures may come late
  const POINTS = -2;         // in the place of a hand: the pointer marks what it points at
  const LOOK = 0.0022;       // rad of pan and tilt, a dot
  let lead = null;           // the widget's number, and what the pointer leads: a hand, or the scope
  let number = 0, waiting = null, sentAt = 0;
  let notchAt = -Infinity;   // ms, of the last notch
  let pushed = [0, 0, 0];    // of the handle, mm at the tip: right, up and in, not yet sent
  const say = scope.say = words => { if (lead && scope.picture?.pose) viewer.send(lead.uuid, `${++number} ${words}`); };
  const saySoon = words => {
    if (!waiting) setTimeout(() => { const last = waiting; waiting = null; sentAt = performance.now(); if (last) say(last()); },
      Math.max(0, sentAt + LEAST_MS - performance.now()));
    waiting = words;
  };
  const fixed = scope.fixed = values => values.map(x => x.toFixed(3)).join(" ");

  // Direction of a pixel, 1 mm into the picture.
  const wayOf = ({ clientX, clientY }) => {
    const box = viewer.canvas().getBoundingClientRect(), { pose } = scope.picture;
    const high = scope.picture.high, x = (clientX - box.left) / box.width * 2 - 1, y = 1 - scope.picture.covered - (clientY - box.top) / box.height * 2;
    return add(add(pose.back.map(v => -v), pose.right, x * high * box.width / box.height), pose.up, y * high);
  };
  const depthOf = place => -dot(sub(place, scope.picture.pose.tip), scope.picture.pose.back);
  const leadTo = target => { Object.assign(lead, { target, at: performance.now() }); saySoon(() => `move ${fixed(target)}`); };
  // Pushes of the handle add up until they are sent.
  const push = move => {
    pushed = add(pushed, move);
    saySoon(() => { const all = pushed; pushed = [0, 0, 0]; return `push ${fixed(all)}`; });
  };

  const down = new Map();    // pointers that are pressed, and where they are
  let apart = 0;
  const spread = () => { const [a, b] = [...down.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  const press = event => {
    if (!scope.picture?.pose || event.target !== viewer.canvas()) return;
    event.stopPropagation();
    if (lead.hand === POINTS && event.button === 0) { say(`point ${fixed(wayOf(event))}`); return; }
    if (event.button === 2) { event.preventDefault(); say("act"); return; }
    viewer.canvas().setPointerCapture?.(event.pointerId);
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (down.size === 2) { apart = spread(); return; }
    if (down.size > 2 || lead.hand < 0 || event.button === 1) return;
    const { tip, holds } = scope.picture.state.hand(lead.hand);
    lead.depth = depthOf(tip);
    const under = lead.under = add(scope.picture.pose.tip, wayOf(event), lead.depth);
    if (lead.byHandle) return;
    // What is held is led from where it is, and not pulled to the pointer.
    lead.aside = holds ? sub(tip, under) : [0, 0, 0];
    leadTo(add(under, lead.aside));
  };
  const move = event => {
    const before = down.get(event.pointerId);
    if (!before || !scope.picture?.pose) return;
    event.stopPropagation();
    const across = event.clientX - before.x, up = before.y - event.clientY;
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (down.size === 2) {
      const now = spread();
      slide(PINCH * (now - apart));
      apart = now;
    } else if (lead.hand < 0 || event.buttons === 4) say(`scope ${fixed([-LOOK * across, -LOOK * up, 0, 0])}`);
    else if (lead.under) {
      const from = lead.under, { tip, right, up: top } = scope.picture.pose;
      lead.under = add(tip, wayOf(event), lead.depth);
      const by = sub(lead.under, from);
      if (lead.byHandle) push([dot(by, right), dot(by, top), 0]);
      else leadTo(add(lead.under, lead.aside));
    }
  };
  const lift = event => {
    if (!down.delete(event.pointerId) || down.size) return;
    event.stopPropagation();
    // After the last movement, which may still wait.
    lead.at = -Infinity;  // what is held stops where it is
    if (lead.hand >= 0) setTimeout(() => { if (lead && !down.size) say("stop"); }, LEAST_MS + 1);
  };
  // Where the button is let go out of sight of the page, in another window, nothing tells of it.
  const leave = event => {
    if (event.target !== window) return;
    if (down.size && lead?.hand >= 0) say("stop");
    down.clear();
  };
  // In along the shaft, or out, mm; the scope along its own.
  const slide = mm => {
    const { picture } = scope;
    if (!picture?.pose || !mm) return;
    if (lead.hand < 0) { say(`scope ${fixed([0, 0, mm, 0])}`); return; }
    if (lead.byHandle) { push([0, 0, mm]); return; }
    const from = down.size && lead.target ? lead.target : picture.state.hand(lead.hand).tip;
    const late = performance.now() - lead.at < LAGS_MS;
    const start = waiting || down.size || late ? lead.target ?? from : from;
    const target = add(start, unit(sub(start, picture.given.trocars[lead.hand])), mm), before = lead.depth;
    lead.depth = depthOf(target);
    // A pointer that is pressed goes on from there.
    if (down.size && lead.under) {
      lead.under = add(picture.pose.tip, sub(lead.under, picture.pose.tip), lead.depth / before);
      lead.aside = sub(target, lead.under);
    }
    leadTo(target);
  };
  const turn = event => {
    if (!scope.picture || event.target !== viewer.canvas()) return;
    event.preventDefault();
    event.stopPropagation();
    if (event.ctrlKey || event.shiftKey) say(`scope ${fixed([0, 0, 0, Math.sign(event.deltaY) * 0.12])}`);
    else slide(-Math.sign(event.deltaY) * WHEEL_MM * (event.timeStamp - notchAt < QUICK_MS ? QUICK : 1));
    notchAt = event.timeStamp;
  };
  const nothing = event => { if (event.target === viewer.canvas()) event.preventDefault(); };
  const LISTENED = [["pointerdown", press], ["pointermove", move], ["pointerup", lift], ["pointercancel", lift], ["wheel", turn], ["contextmenu", nothing], ["blur", leave]];

  // Show where keys point, right and up of the picture's middle by so many of its radii, or nothing.
  const showCross = at => {
    const frame = scope.picture?.frame, old = frame?.querySelector(".bd-scope-cross");
    if (!frame || !at) { old?.remove(); return; }
    const cross = old ?? frame.appendChild(Object.assign(document.createElement("div"), { className: "bd-scope-cross" }));
    cross.style.left = `calc(50% + ${55 * at[0]}cqmin)`;
    cross.style.top = `calc(50% - ${55 * at[1]}cqmin)`;
  };

  // Write at the foot of the picture which wall is near its break, or nothing.
  scope.warn = words => {
    const frame = scope.picture?.frame, old = frame?.querySelector(".bd-scope-warning");
    if (!frame || !words) { old?.remove(); return; }
    const line = old ?? frame.appendChild(Object.assign(document.createElement("div"), { className: "bd-scope-warning" }));
    line.textContent = words;
  };

  // Lead a hand by its tip or its handle, or below zero the scope, by the pointer from now on,
  // through a widget; or mark what it points at, `cross` being where keys point.
  scope.lead = (uuid, hand, byHandle, cross) => {
    showCross(cross);
    if (!lead) for (const [kind, take] of LISTENED) window.addEventListener(kind, take, { capture: true, passive: false });
    lead = { uuid, hand, byHandle, aside: null, under: null };
    viewer.canvas().style.cursor = hand === POINTS ? "crosshair" : "";
  };
  scope.leave = () => {
    lead = null;
    if (viewer.canvas()) viewer.canvas().style.cursor = "";
    down.clear();
    for (const [kind, take] of LISTENED) window.removeEventListener(kind, take, { capture: true });
  };
})();
