// What a controller observes of a simulation, by the names in docs/reference/controller.md.
//
// It changes nothing. Units: m, m/s, rad. Letters: J joints, F feet.

import { clip, cross, dot, minus, three, turned, wrapped } from "./vectors.js";

// m; a foot nearer to the floor counts as in contact.
const CONTACT_GAP = 0.002;

// All observations of the creature. simulation: as in simulation.js.
export function senses(simulation) {
  const { data, facts, turn } = simulation,
    { trunk, axes, start, root_dof } = facts,
    { qpos, qvel } = data;
  const rot = data.xmat.slice(9 * trunk, 9 * trunk + 9),
    place = three(data.xpos, trunk);
  const [forward, left] = [turned(rot, axes.forward), turned(rot, axes.left)];
  const spin = turned(rot, qvel.slice(root_dof + 3, root_dof + 6));
  const heading = Math.atan2(dot(forward, start.left), dot(forward, start.forward));
  const free = turn === null;
  return {
    joint_pos: facts.joints.qpos.map(adr => qpos[adr]),
    ...plainSenses(simulation, place),
    heading: free ? heading : wrapped(heading - simulation.heading),
    ...(free ? {} : { aside: 0 }),
    pitch: -Math.asin(clip(forward[2], -1, 1)),
    roll: Math.asin(clip(left[2], -1, 1)),
    pitch_rate: dot(spin, left),
    roll_rate: dot(spin, forward),
    ...noseSenses(simulation, forward, place, qvel.slice(root_dof, root_dof + 3)),
  };
}

// Observations of the opponent in a contest.
export function opponentSenses(simulation) {
  const { joints, parts, own_pairs } = simulation.facts.opponent;
  return {
    joint_pos: joints.qpos.map(adr => simulation.data.qpos[adr]),
    contact: contacts(simulation, parts, parts.map(part => simulation.height(part)), own_pairs),
    light: parts.map(({ geom }) => towardsLight(simulation, geom)),
  };
}

// Observations of time, joints, place and velocity.
function plainSenses(simulation, place) {
  const { data, facts, time } = simulation,
    { start, root_dof, goal, bar } = facts;
  const moved = minus(place, start.place),
    velocity = data.qvel.slice(root_dof, root_dof + 3);
  const forward = dot(moved, start.forward);
  return {
    time,
    beat: 2 * (time - Math.floor(time)) - 1,
    joint_vel: facts.joints.dofs.map(dof => data.qvel[dof]),
    trunk_height: place[2] - simulation.floorAt(place),
    forward,
    aside: dot(moved, start.left),
    forward_vel: dot(velocity, start.forward),
    up_vel: velocity[2],
    goal_distance: goal - forward,
    bar_distance: bar - forward,
  };
}

// Observations along the nose and to its left; those of feet only if the controller reads them.
function noseSenses(simulation, forward, place, velocity) {
  const length = Math.max(Math.hypot(forward[0], forward[1]), 1e-6);
  const nose = [forward[0] / length, forward[1] / length, 0],
    beside = cross([0, 0, 1], nose);
  return {
    nose_vel: [dot(velocity, nose), dot(velocity, beside)],
    ...(simulation.facts.feet.seen ? footSenses(simulation, place, nose, beside) : {}),
  };
}

function footSenses(simulation, place, nose, beside) {
  const { feet } = simulation.facts,
    { geom_xpos } = simulation.data;
  const middle = geoms =>
    [0, 1, 2].map(
      axis => geoms.reduce((sum, { geom }) => sum + geom_xpos[3 * geom + axis], 0) / geoms.length,
    );
  const foot_height = feet.parts.map(geoms =>
    simulation.water ? Infinity : Math.min(...geoms.map(one => simulation.height(one))),
  );
  return {
    light: feet.parts.flat().map(({ geom }) => towardsLight(simulation, geom)),
    foot_height,
    contact: contacts(simulation, feet.parts.flat(), foot_height, simulation.facts.own_pairs),
    foot_place: feet.parts.map(geoms => {
      const away = minus(middle(geoms), place);
      return [dot(away, nose), dot(away, beside)];
    }),
  };
}

// 1 for each block on the floor or near another one, else 0. pairs: of blocks that feel each other.
function contacts({ data }, parts, heights, pairs) {
  const gaps = [...heights];
  for (const [i, j] of pairs) {
    const apart = Math.max(beyond(data, parts[i], parts[j]), beyond(data, parts[j], parts[i]));
    gaps[i] = Math.min(gaps[i], apart);
    gaps[j] = Math.min(gaps[j], apart);
  }
  return gaps.map(gap => (gap < CONTACT_GAP ? 1 : 0));
}

// Distance of a second box from a first along the first one's normals; negative within all three.
function beyond(data, one, other) {
  const between = minus(three(data.geom_xpos, one.geom), three(data.geom_xpos, other.geom)),
    [own, its] = [one, other].map(({ geom }) => columns(data.geom_xmat, geom));
  const away = own.map((axis, k) => {
    const reach = its.reduce((sum, edge, m) => sum + Math.abs(dot(axis, edge)) * other.box[m], 0);
    return Math.abs(dot(axis, between)) - one.box[k] - reach;
  });
  return Math.max(...away);
}

const columns = (xmat, geom) =>
  [0, 1, 2].map(column => [0, 3, 6].map(row => xmat[9 * geom + row + column]));

// Direction [3] of the light in a geom's own axes; zero in the dark. In a contest it is the cube.
function towardsLight(simulation, geom) {
  const { data, facts } = simulation,
    { opponent } = facts,
    place = opponent ? three(data.geom_xpos, opponent.cube) : simulation.lightPlace();
  if (!place) return [0, 0, 0];
  const there = minus(place, three(data.geom_xpos, geom)),
    far = Math.max(Math.hypot(...there), 1e-9),
    rot = data.geom_xmat.slice(9 * geom, 9 * geom + 9);
  return [0, 1, 2].map(
    column => dot([rot[column], rot[3 + column], rot[6 + column]], there) / far,
  );
}
