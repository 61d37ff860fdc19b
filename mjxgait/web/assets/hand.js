// The visitor's hand: a spring, and a damper, from a point of a body to a place in the world.

import { minus, three, turned } from "./vectors.js";

export class Hand {
  // simulation: as in simulation.js.
  constructor(simulation) {
    this.simulation = simulation;
    this.pull = null;
  }

  // Hold a body at a point in the world, as firmly as suits the creature's mass.
  hold(body, point) {
    const { data, model, plain } = this.simulation,
      rot = data.xmat.slice(9 * body, 9 * body + 9);
    const away = minus(point, three(data.xpos, body));
    const mass = model.body_mass.reduce((sum, value) => sum + value, 0),
      firmness = 8;
    this.pull = {
      body,
      target: [...point],
      stiffness: mass * firmness ** 2,
      damping: mass * firmness,
      most: 2 * mass * Math.hypot(...plain.gravity),
      local: [0, 1, 2].map(
        column => rot[column] * away[0] + rot[3 + column] * away[1] + rot[6 + column] * away[2],
      ),
    };
  }

  letGo() {
    this.pull = null;
  }

  // The place in the world at which the visitor holds a body.
  point() {
    const { data } = this.simulation,
      { body, local } = this.pull,
      place = three(data.xpos, body);
    return turned(data.xmat.slice(9 * body, 9 * body + 9), local).map(
      (value, i) => place[i] + value,
    );
  }

  // Add the force of this step.
  press() {
    if (!this.pull) return;
    const { body, target, stiffness, damping, most } = this.pull,
      point = this.point();
    const velocity = this.simulation.velocityAt(body, point);
    const force = point.map(
      (value, i) => stiffness * (target[i] - value) - damping * velocity[i],
    );
    const share = Math.min(1, most / Math.max(Math.hypot(...force), 1e-9));
    this.simulation.pushAt(body, point, force.map(value => share * value));
  }
}
