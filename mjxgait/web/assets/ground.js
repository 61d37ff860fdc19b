// Rough ground, written from docs/reference/ground.md, and a height field of it about the creature.
//
// For the page of `mjxgait share --physics`. It uses neither the page nor creatures. Places x, y are in
// the world; a and b lead ahead and to the left of the start; all in m.

const NEAR = 1e-4; // m; half the distance over which the slope is measured.
const THICKNESS = 1; // m of the field below its lowest point.
const NAME = "rough";

// A sine made of parabolas.
const wave = cycles => {
  const u = cycles - Math.round(cycles);
  return 8 * u * (1 - 2 * Math.abs(u));
};

export class Ground {
  // facts: `ground` of mjxgait/web/facts.py. start: `start` there.
  constructor(facts, start) {
    Object.assign(this, { facts, start, size: 0, middle: [0, 0], version: 0 });
    this.count = 2 * facts.half + 1;
    this.span = 2 * facts.most * facts.hip;
  }

  // Whether a place needs another patch: it is halfway to an edge. `middle` counts cells.
  leaves(x, y) {
    const { cell, half } = this.facts;
    return this.along(x, y).some((value, i) => Math.abs(value / cell - this.middle[i]) > half / 2);
  }

  // Put the middle of the patch at a place, rounded to whole cells.
  centre(x, y) {
    this.middle = this.along(x, y).map(value => Math.round(value / this.facts.cell));
  }

  // Places [2] ahead and to the left of the start.
  along(x, y) {
    const { place, forward, left } = this.start,
      [east, north] = [x - place[0], y - place[1]];
    return [east * forward[0] + north * forward[1], east * left[0] + north * left[1]];
  }

  height(x, y) {
    return this.rise(...this.along(x, y));
  }

  // Height of a geom's lowest point over the plane that touches the ground below that point.
  above({ radius, box, ellipsoid }, place, rot) {
    const down = rot.slice(6, 9),
      far = Math.max(Math.hypot(...down.map((d, i) => d * ellipsoid[i])), 1e-9),
      point = down.map((d, i) => -(Math.sign(d) * box[i] + (d * ellipsoid[i] ** 2) / far)),
      [x, y, z] = place.map(
        (value, i) => value + rot[3 * i] * point[0] + rot[3 * i + 1] * point[1] + rot[3 * i + 2] * point[2],
      ),
      slope = [
        (this.height(x + NEAR, y) - this.height(x - NEAR, y)) / (2 * NEAR),
        (this.height(x, y + NEAR) - this.height(x, y - NEAR)) / (2 * NEAR),
      ];
    return (z - this.height(x, y)) / Math.hypot(1, ...slope) - radius;
  }

  // Height in m, by the size in hip heights. It is level about the start.
  rise(a, b) {
    const { level, waves } = this.facts,
      away = Math.min(1, Math.max(0, ((a * a + b * b) / level ** 2 - 1) / 3)),
      full = away * away * (3 - 2 * away);
    if (!full || !this.size) return 0;
    const sum = waves.reduce(
      (total, [ahead, left, phase, size]) => total + size * wave(a * ahead + b * left + phase),
      0,
    );
    return this.size * full * sum;
  }

  // The grid's a, and its b.
  lines() {
    const { cell, half, origin } = this.facts,
      places = i => Array.from({ length: this.count }, (_, n) => (this.middle[i] + n - half) * cell);
    return [places(0).map(a => a + origin), places(1)];
  }

  // Heights of the patch, row by row from its right to its left, each from behind to ahead.
  heights() {
    const [ahead, aside] = this.lines();
    return Float64Array.from(aside.flatMap(b => ahead.map(a => this.rise(a, b))));
  }

  // The patch as points [3] in the same order.
  points() {
    const [ahead, aside] = this.lines(),
      { place, forward, left } = this.start;
    return aside.flatMap(b =>
      ahead.map(a => [
        ...[0, 1].map(i => place[i] + a * forward[i] + b * left[i]),
        this.rise(a, b),
      ]),
    );
  }

  // The creature's model with a height field in place of its floor.
  model(mujoco, { xml, floor }) {
    const { cell, half, name } = this.facts,
      side = half * cell,
      size = [side, side, this.span, THICKNESS].join(" "),
      asset = `<asset><hfield name="${NAME}" nrow="${this.count}" ncol="${this.count}" size="${size}"/></asset>`,
      spec = mujoco.parseXMLString(xml.replace(/<\/mujoco>\s*$/, `${asset}</mujoco>`));
    const element = mujoco.mjs_findElement(spec, mujoco.mjtObj.mjOBJ_GEOM, name),
      geom = mujoco.mjs_asGeom(element),
      [x, y] = this.start.forward,
      turn = Math.atan2(y, x) / 2;
    geom.type = mujoco.mjtGeom.mjGEOM_HFIELD;
    geom.hfieldname = NAME;
    geom.pos.set([0, 0, floor - this.span / 2]);
    geom.quat.set([Math.cos(turn), 0, 0, Math.sin(turn)]);
    const model = mujoco.mj_compile(spec);
    spec.delete();
    return model;
  }

  // Put the patch into a model that has the field.
  place(model) {
    const { cell, origin, geom } = this.facts,
      { place, forward, left } = this.start,
      [a, b] = [this.middle[0] * cell + origin, this.middle[1] * cell];
    model.hfield_data.set(this.heights().map(value => value / this.span + 0.5));
    for (const i of [0, 1]) model.geom_pos[3 * geom + i] = place[i] + a * forward[i] + b * left[i];
    this.version += 1;
  }
}
