// Mouse, fingers and wheel at the scope's picture, as short texts to a widget of the server's, which
// leads: pictures may come late, and it knows where a tip is. `viewer` is `run_picture`'s.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.lead) return;
  const { add } = scope.algebra;
  const LEAST_MS = 33;       // between two messages of one movement
  const PINCH = 1 / 6;       // notches of the wheel, a dot
  const NOTCH = [100, 3, 1];           // of a wheel, in the units of a `deltaMode`: dots, lines, pages
  const WHOLE = 0.75;        // of a notch, from which on an event is one of a wheel, not of a trackpad
  const QUICK_MS = 120, QUICK = 3;     // notches that follow in less time go so many times as far
  const SPREAD = 150;        // dots that fingers on a trackpad are taken to be apart: it does not say
  const TURNS = 0.12;        // rad of the scope's cable, or of its camera's head, a notch
  const TOGETHER_MS = 300;   // within which a second finger makes a pinch of what the first began
  const POINTS = -2;         // in the place of a hand: the pointer marks what it points at
  const LOOK = 0.0022;       // rad of pan and tilt, a dot
  let lead = null;           // the widget's number, and what the pointer leads: a hand, or the scope
  let number = 0, sentAt = 0;
  let dragged = null, slid = 0, turned = 0, rolled = 0, waits = false;  // not yet sent: where a pointer is now, and notches
  let notchAt = -Infinity, fine = false;  // ms, of the last turn of the wheel, and whether that is a trackpad's
  const say = scope.say = words => { if (lead && scope.picture?.pose) viewer.send(lead.uuid, `${++number} ${words}`); };
  const fixed = scope.fixed = values => values.map(x => x.toFixed(3)).join(" ");

  // Direction of a pixel, 1 mm into the picture.
  const wayOf = ({ clientX, clientY }) => {
    const box = viewer.canvas().getBoundingClientRect(), { pose } = scope.picture;
    const high = scope.picture.high, x = (clientX - box.left) / box.width * 2 - 1, y = 1 - scope.picture.covered - (clientY - box.top) / box.height * 2;
    return add(add(pose.back.map(v => -v), pose.right, x * high * box.width / box.height), pose.up, y * high);
  };
  // Where the pointer is, as a ray from the camera.
  const rayOf = event => fixed([...scope.picture.pose.tip, ...wayOf(event)]);

  const saySoon = () => {
    if (waits) return;
    waits = true;
    setTimeout(() => {
      const drag = dragged, notches = slid, cable = TURNS * turned, head = TURNS * rolled;
      waits = false; dragged = null; slid = turned = rolled = 0; sentAt = performance.now();
      if (notches) say(`wheel ${fixed([notches])}`);
      if (cable || head) say(`scope ${fixed([0, 0, 0, cable, head])}`);
      if (drag && scope.picture?.pose) say(`drag ${rayOf(drag)}`);
    }, Math.max(0, sentAt + LEAST_MS - performance.now()));
  };

  const down = new Map();    // pointers that are pressed, and where they are
  let apart = 0, pressedAt = 0;  // dots between two fingers; and ms, when the first pointer was pressed
  let pinches = false, points = false;  // whether two fingers do, until all are lifted; and whether one marks
  const spread = () => { const [a, b] = [...down.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  const press = event => {
    if (!scope.picture?.pose || scope.free || event.target !== viewer.canvas()) return;
    event.stopPropagation();
    if (event.button === 2) { event.preventDefault(); say("act"); return; }
    viewer.canvas().setPointerCapture?.(event.pointerId);
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (down.size === 2) {
      if (!pinches && lead.hand >= 0) say(event.timeStamp - pressedAt < TOGETHER_MS ? "back" : "stop");
      pinches = true;
      apart = spread();
    }
    if (down.size > 1) return;
    pressedAt = event.timeStamp;
    points = lead.hand === POINTS && event.button === 0;
    if (lead.hand >= 0 && event.button !== 1) say(`press ${rayOf(event)}`);
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
    } else if (pinches || points) return;  // a finger that is left, and what is to be marked, move nothing
    else if (lead.hand < 0 || event.buttons === 4) say(`scope ${fixed([-LOOK * across, -LOOK * up, 0, 0, 0])}`);
    else { dragged = event; saySoon(); }
  };
  const lift = event => {
    if (!down.delete(event.pointerId) || down.size) return;
    event.stopPropagation();
    const alone = !pinches;
    pinches = false;
    if (points && alone && event.type === "pointerup") say(`point ${fixed(wayOf(event))}`);
    // After the last movement, which may still wait: what is held stops where it is.
    if (lead.hand >= 0) setTimeout(() => { if (lead && !down.size) say("stop"); }, LEAST_MS + 1);
  };
  scope.letGo = () => {
    if (down.size && lead?.hand >= 0) say("stop");
    down.clear();
    pinches = false;
  };
  // Where the button is let go out of sight of the page, in another window, nothing tells of it.
  const leave = event => { if (event.target === window) scope.letGo(); };
  const slide = notches => { slid += notches; saySoon(); };
  const turn = event => {
    if (!scope.picture || scope.free || event.target !== viewer.canvas()) return;
    event.preventDefault();
    event.stopPropagation();
    // With Shift some browsers turn it aside. A trackpad's pinch comes as a wheel with Ctrl.
    const moved = event.deltaY || (event.shiftKey ? event.deltaX : 0);
    const notches = moved / NOTCH[event.deltaMode], follows = event.timeStamp - notchAt < QUICK_MS;
    fine = Math.abs(notches) < WHOLE || (fine && follows);
    notchAt = event.timeStamp;
    const whole = fine ? notches : Math.round(notches);
    if (event.shiftKey) { turned += whole; saySoon(); }
    else if (event.altKey) { rolled += whole; saySoon(); }
    else slide(-whole * (!fine ? (follows ? QUICK : 1) : event.ctrlKey ? PINCH * SPREAD : 1));
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

  // Lead a hand, or below zero the scope, by the pointer from now on, through a widget; or mark what
  // it points at, `cross` being where keys point.
  scope.lead = (uuid, hand, cross) => {
    showCross(cross);
    if (!lead) for (const [kind, take] of LISTENED) window.addEventListener(kind, take, { capture: true, passive: false });
    lead = { uuid, hand };
    viewer.canvas().style.cursor = hand === POINTS ? "crosshair" : "";
  };
  scope.leave = () => {
    lead = null;
    if (viewer.canvas()) viewer.canvas().style.cursor = "";
    down.clear();
    pinches = false;
    for (const [kind, take] of LISTENED) window.removeEventListener(kind, take, { capture: true });
  };
})();
