// The networks of creatures that evolve their bodies, written from docs/reference/modular-bodies.md.
//
// For the page of `mjxgait share --physics`. It uses neither the page nor MuJoCo. Letters: J hinges,
// N neurons. A wire comes from a column: nothing, the constant 1, the hinges' angles, contact and
// light of all parts, the neurons' values.

const TICKS = 2;
// Largest size of a neuron's value and memory, and of its inputs.
const MOST = 10,
  LOUDEST = 100;
const clip = (value, most) => Math.min(most, Math.max(-most, value));
const fraction = value => value - Math.floor(value);
const log = a => Math.log(Math.max(Math.abs(a), 1e-3));
const phase = (b, memory, dt) => fraction(memory + dt * b);
const smooth = (a, b, c, memory, dt) => memory + (a - memory) * (1 - Math.exp(-5 * dt));
const integrate = (a, b, c, memory, dt) => memory + dt * a;
const keep = (a, b, c, memory) => (b > 0 ? a : memory);

// Values from three inputs, the memory, and the time of a tick in s.
const FUNCTIONS = {
  sum: (a, b, c) => a + b + c,
  product: (a, b, c) => a * b * c,
  divide: (a, b) => (Math.abs(b) < 1e-3 ? 0 : a / b),
  "sum-threshold": (a, b, c) => (a + b > c ? 1 : 0),
  "greater-than": (a, b) => (a > b ? 1 : 0),
  "sign-of": a => Math.sign(a),
  min: (a, b) => Math.min(a, b),
  max: (a, b) => Math.max(a, b),
  abs: a => Math.abs(a),
  if: (a, b, c) => (a > 0 ? b : c),
  interpolate: (a, b, c) => a + (b - a) * Math.min(1, Math.max(0, c)),
  sin: a => Math.sin(a),
  cos: a => Math.cos(a),
  atan: a => Math.atan(a),
  log: a => log(a),
  expt: (a, b) => Math.exp(Math.min(Math.log(MOST), Math.max(-MOST, b * log(a)))),
  sigmoid: a => 1 / (1 + Math.exp(-a)),
  integrate,
  differentiate: (a, b, c, memory, dt) => (a - memory) / dt,
  smooth,
  memory: keep,
  "oscillate-wave": (a, b, c, memory, dt) => Math.sin(2 * Math.PI * (phase(b, memory, dt) + a)),
  "oscillate-saw": (a, b, c, memory, dt) => 2 * fraction(phase(b, memory, dt) + a) - 1,
};
// Memory after a tick; all other neurons keep none.
const KEPT = {
  integrate,
  differentiate: a => a,
  smooth,
  memory: keep,
  "oscillate-wave": (a, b, c, memory, dt) => phase(b, memory, dt),
  "oscillate-saw": (a, b, c, memory, dt) => phase(b, memory, dt),
};

export class Brain {
  // facts: `controller` of mjxgait/web/facts.py: kinds [N], column and weight [N, 3], tick in s;
  // driver, gain and strength [J]; lit [J, 3] and steer [J, 2, 3], or steer null.
  constructor(facts) {
    Object.assign(this, facts);
  }

  init() {
    const zeros = () => this.kinds.map(() => 0);
    return { values: zeros(), memory: zeros() };
  }

  // Return the torque [J] in N·m and the memory. senses: observations by name.
  act({ values, memory }, { joint_pos, contact, light }) {
    const sensed = [0, 1, ...joint_pos, ...contact, ...light.flat()];
    for (let tick = 0; tick < TICKS; tick++)
      ({ values, memory } = this.fire([...sensed, ...values], memory));
    const columns = [...sensed, ...values];
    const target = this.driver.map((column, j) => {
      const wanted = this.steered(j, this.gain[j] * columns[column], sensed);
      return this.strength[j] * clip(wanted, 1);
    });
    return { target, memory: { values, memory } };
  }

  // All neurons at once: values and memory after a tick.
  fire(columns, memory) {
    const values = [],
      kept = [];
    this.kinds.forEach((kind, n) => {
      const inputs = this.column[n].map((column, i) =>
        clip(columns[column] * this.weight[n][i], LOUDEST),
      );
      const given = [...inputs, memory[n], this.tick];
      values.push(clip(FUNCTIONS[kind](...given), MOST));
      kept.push(clip(KEPT[kind] ? KEPT[kind](...given) : memory[n], MOST));
    });
    return { values, memory: kept };
  }

  // A hinge's drive, changed by the light where the genome has weights for it.
  steered(j, wanted, sensed) {
    if (!this.steer) return wanted;
    const light = this.lit[j].map(column => sensed[column]);
    const [added, scaled] = this.steer[j].map(weights =>
      weights.reduce((sum, weight, axis) => sum + weight * light[axis], 0),
    );
    return wanted * (1 + scaled) + added;
  }
}
