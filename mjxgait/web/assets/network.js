// The neural network of one creature, written from docs/reference/network.md.
//
// For the page of `mjxgait share --physics`. It uses neither the page nor MuJoCo. Letters: I inputs,
// J joints.

const LEVEL = ["trunk_height", "up_vel", "pitch", "pitch_rate"];
const TIPPED = ["roll", "roll_rate", "heading", "aside"];

export class Network {
  // facts: `controller` of mjxgait/web/facts.py: layers with weight and bias; stand, low and high [J].
  constructor(facts) {
    Object.assign(this, facts);
  }

  // There is no memory.
  init() {
    return null;
  }

  // Return the target [J] in rad. senses: observations by name.
  act(memory, senses) {
    const inputs = this.inputs(senses),
      plain = this.through(inputs.flat());
    const out = this.mirror ? this.symmetric(plain, inputs) : plain;
    const target = out.map((value, j) => {
      const reach = (this.high[j] - this.low[j]) / 2;
      return Math.min(
        this.high[j],
        Math.max(this.low[j], this.stand[j] + reach * Math.tanh(value)),
      );
    });
    return { target, memory };
  }

  // Inputs in groups that a mirror treats alike.
  inputs(senses) {
    const turn = (2 * Math.PI * senses.time) / this.period;
    return [
      senses.joint_pos.map((angle, j) => angle - this.stand[j]),
      senses.joint_vel,
      senses.nose_vel,
      LEVEL.map(name => senses[name]),
      TIPPED.map(name => senses[name]),
      [Math.sin(turn), Math.cos(turn)],
    ];
  }

  // The mean of the outputs [J] and of those of the mirror image, half a period later.
  symmetric(out, [bent, speeds, [ahead, left], level, tipped, clock]) {
    const minus = values => values.map(value => -value);
    const there = [
      this.image(bent),
      this.image(speeds),
      [ahead, -left],
      level,
      minus(tipped),
      minus(clock),
    ];
    const other = this.image(this.through(there.flat()));
    return out.map((value, j) => (value + other[j]) / 2);
  }

  image(values) {
    const { sign, partner } = this.mirror;
    return sign.map((factor, j) => factor * values[partner[j]]);
  }

  // Outputs [J] for inputs [I].
  through(inputs) {
    return this.layers.reduce((values, { weight, bias }, i) => {
      const sums = bias.map((start, unit) =>
        values.reduce((sum, value, input) => sum + value * weight[input][unit], start),
      );
      return i + 1 < this.layers.length ? sums.map(Math.tanh) : sums;
    }, inputs);
  }
}
