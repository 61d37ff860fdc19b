// The key-pose controller of one creature, written from docs/reference/controller.md.
//
// A third implementation beside JAX and NumPy, for the page of `mjxgait share --physics`. It uses
// neither the page nor MuJoCo. Letters: K key poses, C poses of the cycle, J joints, F feet. Angles are
// in rad.

import { clip } from "./vectors.js";

const half = value => clip(value, -0.5, 0.5);

// A cycle of the clock has 2^32 parts.
const PARTS = 2 ** 32,
  COARSE = 2 ** 16;

export class KeyPoses {
  // facts: `controller` of mjxgait/web/facts.py.
  constructor(facts) {
    this.facts = facts;
    const { poses, mirror } = facts;
    const mirrored = pose => mirror.sign.map((sign, j) => sign * pose[mirror.partner[j]]);
    this.cycle = mirror ? [...poses, ...poses.map(mirrored)] : poses;
    this.length = this.cycle.length * facts.interpolation;
    // The quotient of two float32 numbers is rounded to float32.
    const { period } = facts.tuning;
    this.turn =
      Math.floor(Math.fround(Math.fround(facts.step) / Math.fround(period)) * PARTS) % PARTS;
  }

  // Memory at the start. position: in the cycle. clock: parts of it that have passed. steps: taken.
  init() {
    return { position: 0, clock: 0, steps: 0 };
  }

  // Return the target [J] of this step and the memory for the next.
  // senses: observations by name. pace: positions per step, 1 as evolved.
  act(memory, senses, pace = 1) {
    const target = this.corrected(this.planned(memory.position), senses, memory.steps);
    return { target, memory: this.advance(memory, target, senses.joint_pos, pace) };
  }

  planned(position) {
    const { interpolation } = this.facts,
      a = Math.floor(position / interpolation);
    const f = (position - a * interpolation) / interpolation;
    const here = this.cycle[a],
      next = this.cycle[(a + 1) % this.cycle.length];
    return here.map((angle, j) => (1 - f) * angle + f * next[j]);
  }

  corrected(planned, senses, steps) {
    const { joints, weights, tuning: gain, steering, step } = this.facts;
    const away = this.deviation(senses);
    const u = steering * half(gain.steer * away);
    const p = half(gain.pitch * senses.pitch + gain.pitch_rate * senses.pitch_rate);
    const r = half(gain.roll * senses.roll + gain.roll_rate * senses.roll_rate);
    const begun = weights.stepping
      ? Math.min(1, ((steps + 1) * step) / Math.max(gain.begin, step))
      : 1;
    const added = weights.stepping ? this.stepping(senses, away) : null;
    return planned.map((angle, j) => {
      const moved = begun * (angle - joints.stand[j]) * (1 + u * weights.steer_stride[j]);
      const target =
        joints.stand[j] +
        moved +
        u * weights.steer_bend[j] +
        p * weights.balance_pitch[j] +
        r * weights.balance_roll[j] +
        (added ? added[j] : 0);
      return clip(target, joints.low[j], joints.high[j]);
    });
  }

  // Heading plus lateral offset: how far the creature points away from its path.
  deviation(senses) {
    return senses.heading + senses.aside / (2 * this.facts.body_length);
  }

  // Steps under a fall: the change [J] of the target.
  stepping(senses, away) {
    const {
      hip_height: hip,
      tuning: gain,
      weights: { stepping },
      foot_places,
    } = this.facts;
    const swing = senses.foot_height.map(height => clip(height / (0.02 * hip), 0, 1));
    const stance = swing.map(share => 1 - share);
    const carried = Math.max(
      1,
      stance.reduce((sum, share) => sum + share, 0),
    );
    const [overAhead, overLeft] = [0, 1].map(
      axis =>
        -stance.reduce(
          (sum, share, f) => sum + share * (senses.foot_place[f][axis] - foot_places[f][axis]),
          0,
        ) /
        carried /
        hip,
    );
    const [fastAhead, fastLeft] = senses.nose_vel.map(speed => speed / Math.sqrt(9.81 * hip));
    const x = half(gain.step * overAhead + gain.step_rate * fastAhead);
    const y = half(gain.side * overLeft + gain.side_rate * fastLeft);
    const p = half(gain.hold * senses.pitch + gain.hold_rate * senses.pitch_rate);
    const r = half(gain.sway * senses.roll + gain.sway_rate * senses.roll_rate);
    const t = half(gain.turn * away);
    return stepping.legs.map(
      (leg, j) =>
        stepping.ahead[j] * (swing[leg] * x - stance[leg] * p) +
        stepping.aside[j] * (swing[leg] * y + stance[leg] * r) +
        stepping.turn[j] * (stance[leg] - swing[leg]) * t,
    );
  }

  advance(memory, target, joint_pos, pace) {
    const { advance, tuning } = this.facts,
      steps = memory.steps + 1;
    if (advance === "clock") {
      const clock = (memory.clock + Math.floor(this.turn * pace)) % PARTS;
      const place = Math.floor(clock / COARSE);
      return {
        position: Math.floor(((place + 1) * this.length) / COARSE) % this.length,
        clock,
        steps,
      };
    }
    const squares = target.reduce((sum, angle, j) => sum + (angle - joint_pos[j]) ** 2, 0);
    const near = Math.sqrt(squares / target.length) < tuning.threshold;
    return {
      position: near ? (memory.position + pace) % this.length : memory.position,
      clock: 0,
      steps,
    };
  }
}
