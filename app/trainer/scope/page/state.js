// The frames of packing.py: nodes with their frames, both ends of every strand, how taut it is.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.State) return;
  const { clamp, mix, sub, dot, cross, unit, numbers } = scope.algebra;
  const HEADER = 85, CLIPS = 8, TEARS = 4, NODE = 6, SLACKEST = -0.5, STEPS = 1000;
  const POSE = ["pan", "tilt", "depth", "cable", "head", "angle"];
  const PART_MS = 350;  // that a strand takes to draw back

  class State {
    // `given` as view.py sends it; `texture` makes one of numbers.
    constructor(given, texture) {
      this.tubes = given.tubes;
      this.strands = numbers(given.strands);
      this.count = this.strands.length / 9;
      let first = 0;
      for (const tube of this.tubes) {
        tube.first = first;
        tube.count = tube.nodes ? tube.nodes.length : tube.still.length;
        first += tube.count;
      }
      this.wide = first;
      this.rows = new Float32Array(4 * first * 2);  // places and radii, then the cross-sections' up
      this.nodeTexture = texture(this.rows, first, 2);
      const rows = Math.ceil(2 * this.count / 128);
      this.ends = new Float32Array(4 * 128 * rows);
      this.endTexture = texture(this.ends, 128, rows);
      this.parted = new Uint8Array(this.count);
      this.partedAt = new Float64Array(this.count).fill(-1e9);
      this.head = new Float32Array(HEADER);
      this.frames = 0;
      for (const tube of this.tubes) if (tube.still) {
        tube.still.forEach((node, i) => { this.rows.set(node, 4 * (tube.first + i)); });
        this.#raise(tube, () => [0, 0, 1]);
      }
    }

    // Read a frame; strands that have parted since the last one draw back from now on.
    take(frame, nodes, now) {
      this.head = frame.subarray(0, HEADER);
      const body = frame.subarray(HEADER, HEADER + NODE * nodes);
      for (const tube of this.tubes) if (tube.nodes) {
        tube.nodes.forEach((n, i) => {
          this.rows.set([body[NODE * n], body[NODE * n + 1], body[NODE * n + 2], tube.radius[i]], 4 * (tube.first + i));
        });
        this.#raise(tube, i => {
          // Where it joins another tube the node has that one's frame: its neighbour's is near.
          const own = i === 0 && tube.joined[0] ? 1 : i === tube.count - 1 && tube.joined[1] ? i - 1 : i;
          return turned(body, tube.nodes[own], 0, 0, 1);
        });
      }
      this.nodeTexture.needsUpdate = true;
      const packed = frame.subarray(HEADER + NODE * nodes), { strands, ends } = this;
      for (let i = 0; i < this.count; i++) {
        const both = packed[i >> 1], code = i & 1 ? both % 2048 : Math.floor(both / 2048), q = 9 * i, o = 8 * i;
        if (!code && !this.parted[i]) this.partedAt[i] = this.frames ? now : -1e9;
        this.parted[i] = code ? 0 : 1;
        // How taut it was when it parted is kept: so it sags.
        if (code) ends[o + 3] = (code - 1) / STEPS * 1.5 + SLACKEST;
        this.#end(body, strands[q], q + 1, o);
        if (strands[q + 4] < 0) for (let k = 0; k < 3; k++) ends[o + 4 + k] = strands[q + 5 + k];
        else this.#end(body, strands[q + 4], q + 5, o + 4);
      }
      this.frames++;
    }

    // Let parted strands draw back; return whether any still does.
    shrink(now) {
      let going = false;
      for (let i = 0; i < this.count; i++) {
        const progress = this.parted[i] ? clamp((now - this.partedAt[i]) / PART_MS, 0, 1) : 0;
        this.ends[8 * i + 7] = progress;
        going ||= progress > 0 && progress < 1;
      }
      this.endTexture.needsUpdate = true;
      return going;
    }

    get pose() { return Object.fromEntries(POSE.map((name, i) => [name, this.head[i]])); }
    hand(i) {
      const at = 8 + 8 * i, h = this.head;
      return { tip: [h[at], h[at + 1], h[at + 2]], opening: h[at + 3], roll: h[at + 4], instrument: h[at + 5], holds: h[at + 6] > 0 };
    }
    get soil() { return this.head[84]; }  // of the lens, 0 to 1
    get pools() { return { blood: this.head[6], bile: this.head[7] }; }  // mm^3
    get wells() {
      return [0, 1, 2, 3].map(i => {
        const at = 24 + 5 * i, h = this.head;
        return { place: [h[at], h[at + 1], h[at + 2]], rate: h[at + 3], kind: [null, "blood", "bile"][h[at + 4]] };
      }).filter(each => each.kind);
    }
    pairs(at, most) {
      const h = this.head;
      return Array.from({ length: most }, (_, i) => [h[at + 2 * i] - 1, h[at + 2 * i + 1]]).filter(([tube]) => tube >= 0);
    }
    get clips() { return this.pairs(44, CLIPS); }
    get torn() { return this.pairs(60, TEARS); }
    // Walls torn part of the way: tube, place along it in elements, angle round it, depth.
    get nicks() {
      const h = this.head;
      return [68, 72, 76, 80].map(at => [h[at] - 1, h[at + 1], h[at + 2], h[at + 3]]).filter(([tube]) => tube >= 0);
    }

    // (4) place and radius of a tube, s elements along it.
    at(tube, s) {
      const i = clamp(Math.floor(s), 0, tube.count - 2), f = s - i, a = 4 * (tube.first + i);
      return [0, 1, 2, 3].map(k => mix(this.rows[a + k], this.rows[a + 4 + k], f));
    }
    along(tube, s) {
      const i = clamp(Math.floor(s), 0, tube.count - 2), a = 4 * (tube.first + i);
      return unit([0, 1, 2].map(k => this.rows[a + 4 + k] - this.rows[a + k]));
    }

    #raise(tube, upOf) {
      const { rows } = this, place = i => { const a = 4 * (tube.first + clamp(i, 0, tube.count - 1)); return [rows[a], rows[a + 1], rows[a + 2]]; };
      for (let i = 0; i < tube.count; i++) {
        const along = unit(sub(place(i + 1), place(i - 1))), up = upOf(i);
        let across = sub(up, along.map(x => x * dot(up, along)));
        if (Math.hypot(...across) < 0.2) across = cross(along, [0, 1, 0]);
        rows.set(unit(across), 4 * (this.wide + tube.first + i));
      }
    }

    #end(body, node, at, o) {
      const { strands, ends } = this, arm = turned(body, node, strands[at], strands[at + 1], strands[at + 2]);
      for (let k = 0; k < 3; k++) ends[o + k] = body[NODE * node + k] + arm[k];
    }
  }

  // A vector turned as a node is, by the vector part of its quaternion.
  const turned = (body, node, x, y, z) => {
    const a = NODE * node + 3, p = body[a], q = body[a + 1], r = body[a + 2];
    const w = Math.sqrt(Math.max(0, 1 - p * p - q * q - r * r));
    const u = 2 * (q * z - r * y), v = 2 * (r * x - p * z), t = 2 * (p * y - q * x);
    return [x + w * u + q * t - r * v, y + w * v + r * u - p * t, z + w * t + p * v - q * u];
  };
  scope.State = State;
})();
