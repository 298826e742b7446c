// A gamepad with the standard layout at the scope's picture: the left stick moves the tip, or the
// scope, in the picture, the right one into it and turns it; the cross rolls the camera's head, and
// buttons do what keys do. It speaks to the server as the pointer does.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.gamepad) return;
  const EVERY_MS = 33, MM_S = 30, RAD_S = 1.2, OPENS_MM_S = 12;  // at full deflection
  const IDLE = 0.15;         // of a stick's range, within which it rests
  const PRESSED = { 0: "act", 1: "hand", 2: "instrument", 3: "view", 12: "ring" };
  let held = [], moved = false;
  const beyond = x => Math.sign(x) * Math.max(0, Math.abs(x) - IDLE) / (1 - IDLE);

  scope.gamepad = () => {
    const pad = document.hidden ? undefined : [...navigator.getGamepads()].find(each => each?.connected && each.mapping === "standard");
    const [right, down, turn, nearer] = (pad?.axes ?? []).map(beyond), step = MM_S * EVERY_MS / 1000;
    const moves = Boolean(right || down || nearer);
    if (moves) scope.say(`nudge ${scope.fixed([step * right, -step * down, -step * nearer])}`);
    else if (moved) scope.say("rest");
    moved = moves;
    if (!pad) return;
    if (turn) scope.say(`turn ${scope.fixed([RAD_S * EVERY_MS / 1000 * turn])}`);
    const now = pad.buttons.map(each => each.pressed);
    for (const [button, word] of Object.entries(PRESSED)) if (now[button] && !held[button]) scope.say(word);
    const rolls = (now[15] ? 1 : 0) - (now[14] ? 1 : 0);
    if (rolls) scope.say(`scope ${scope.fixed([0, 0, 0, 0, rolls * RAD_S * EVERY_MS / 1000])}`);
    const opens = (now[5] ? 1 : 0) - (now[4] ? 1 : 0);
    if (opens) scope.say(`open ${scope.fixed([opens * OPENS_MM_S * EVERY_MS / 1000])}`);
    held = now;
  };
  setInterval(scope.gamepad, EVERY_MS);
})();
