// The water's drag on blocks, written from docs/reference/modular-bodies.md.
//
// For the page of `mjxgait share --physics`. Each face has nine points; the force at one is along
// its normal, against its velocity along that.

import { dot, three } from "./vectors.js";

const PLACES = [-Math.sqrt(0.6), 0, Math.sqrt(0.6)];
const SHARES = [5 / 18, 8 / 18, 5 / 18];

export class Water {
  // facts: `water` of mjxgait/web/facts.py: drag in N·s/m³; blocks: geom, body, and half sizes.
  constructor({ drag, blocks }) {
    this.drag = drag;
    this.blocks = blocks.map(block => ({ ...block, points: pointsOf(block.half) }));
  }

  // Add the forces of this step. simulation: as in simulation.js.
  press(simulation) {
    const { geom_xpos, geom_xmat } = simulation.data;
    for (const { geom, body, points } of this.blocks) {
      const rot = geom_xmat.slice(9 * geom, 9 * geom + 9),
        middle = three(geom_xpos, geom);
      for (const { place, axis, side, area } of points) {
        const point = middle.map((value, i) => value + dot(three(rot, i), place));
        const normal = [0, 1, 2].map(i => side * rot[3 * i + axis]);
        const along = dot(simulation.velocityAt(body, point), normal);
        const force = normal.map(value => -this.drag * area * along * value);
        simulation.pushAt(body, point, force);
      }
    }
  }
}

// Points of a block's faces, each with the axis and side of its face, and its share of the area.
function pointsOf(half) {
  const points = [];
  for (const axis of [0, 1, 2])
    for (const side of [-1, 1])
      PLACES.forEach((u, n) =>
        PLACES.forEach((v, m) => {
          const [i, j] = [(axis + 1) % 3, (axis + 2) % 3],
            place = [0, 0, 0];
          [place[axis], place[i], place[j]] = [side * half[axis], u * half[i], v * half[j]];
          points.push({ place, axis, side, area: 4 * half[i] * half[j] * SHARES[n] * SHARES[m] });
        }),
      );
  return points;
}
