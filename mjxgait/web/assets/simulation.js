// One creature in MuJoCo's WebAssembly build, under a controller, with what a visitor may change.
//
// It uses neither the page nor kinds of controllers. Falls are written from
// docs/reference/certificate.md. Units: m, kg, s, N, rad; the world's z axis points up.

import { Hand } from "./hand.js";
import { Motors } from "./motors.js";
import { opponentSenses, senses } from "./senses.js";
import { cross, dot, minus, three } from "./vectors.js";

const BLOWN_UP = 1e4;
export class Simulation {
  // facts: of mjxgait/web/facts.py. controller: has `init` and `act`, as in key_poses.js. water: has
  // `press`, as in water.js; null on land. opponent: the controller of `facts.opponent`; null without.
  // ground: of ground.js, level at first; null in water.
  constructor(mujoco, facts, controller, { water = null, opponent = null, ground = null } = {}) {
    Object.assign(this, { mujoco, facts, controller, water, opponent, ground });
    this.plane = this.simulated(mujoco.MjModel.from_xml_string(facts.xml));
    Object.assign(this, this.plane, { changed: { mass: 1, friction: 1, slope: [0, 0] } });
    const { body_mass, body_inertia, geom_friction, opt } = this.model;
    this.plain = {
      mass: [...body_mass],
      inertia: [...body_inertia],
      friction: [...geom_friction],
      gravity: [...opt.gravity],
    };
    this.pace = 1;
    this.turn = facts.turn;
    this.light = facts.light;
    this.motors = new Motors(facts, this.model);
    this.hand = new Hand(this);
    this.reset();
  }

  // A model with the solver's settings, and the data that are simulated with it.
  simulated(model) {
    const { mujoco, facts } = this;
    for (const [name, value] of Object.entries(facts.options)) model.opt[name] = value;
    return { model, data: new mujoco.MjData(model), scratch: new mujoco.MjData(model) };
  }

  // Start again from the standing pose; mass, friction, slope and floor stay.
  reset() {
    const { mujoco, model, data, facts } = this;
    mujoco.mj_resetData(model, data);
    if (this.ground?.size) this.layGround(facts.start.place);
    data.qpos.set(facts.stand_qpos);
    Object.assign(this, { steps: 0, fell: Infinity, heading: 0 });
    this.hand.letGo();
    this.forces = new Float64Array(model.nv);
    this.memory = this.controller.init();
    this.target = null;
    this.theirs = this.opponent && { memory: this.opponent.init(), target: [] };
    this.renew();
  }

  get time() {
    return this.steps * this.facts.step;
  }

  // Bring what belongs to the current state up to date.
  renew() {
    this.mujoco.mj_step1(this.model, this.data);
  }

  // Factors on every body's mass and inertia, and on sliding friction.
  setMass(factor) {
    this.changed.mass = factor;
    const { body_mass, body_inertia } = this.model,
      { mass, inertia } = this.plain;
    body_mass.set(mass.map(value => factor * value));
    body_inertia.set(inertia.map(value => factor * value));
    this.mujoco.mj_setConst(this.model, this.scratch);
    this.renew();
  }

  setFriction(factor) {
    this.changed.friction = factor;
    this.model.geom_friction.set(
      this.plain.friction.map((value, i) => (i % 3 ? value : factor * value)),
    );
    this.renew();
  }

  // Slope of the floor in rad along the world's x and y. Gravity tilts instead of the floor.
  setSlope(x, y) {
    this.changed.slope = [x, y];
    const angle = Math.hypot(x, y),
      { gravity } = this.plain,
      size = Math.hypot(...gravity);
    const uphill = angle > 0 ? [x / angle, y / angle] : [0, 0];
    const change = [
      -Math.sin(angle) * uphill[0],
      -Math.sin(angle) * uphill[1],
      1 - Math.cos(angle),
    ];
    this.model.opt.gravity.set(gravity.map((value, i) => value + size * change[i]));
    this.renew();
  }

  // Make the floor rough, at most `size` hip heights above and below level; 0 is the plane again. A
  // creature that the new floor would bury is lifted.
  setRough(size) {
    const { ground, facts, data } = this,
      lowest = () => Math.min(...facts.solid.map(part => this.height(part))),
      before = Math.min(lowest(), 0);
    ground.size = size;
    if (size) this.rough ??= this.roughWorld();
    const next = size ? this.rough : this.plane,
      qpos = [...data.qpos],
      rise = Math.max(before - lowest(), 0);
    for (const address of facts.roots) qpos[address + 2] += rise;
    next.data.qpos.set(qpos);
    next.data.qvel.set(data.qvel);
    next.data.qacc_warmstart.set(data.qacc_warmstart);
    Object.assign(this, next);
    if (size) this.layGround(qpos.slice(facts.roots[0]));
    this.setMass(this.changed.mass);
    this.setFriction(this.changed.friction);
    this.setSlope(...this.changed.slope);
  }

  // The creature on a height field, which goes along with it.
  roughWorld() {
    const { mujoco, facts, ground } = this,
      world = this.simulated(ground.model(mujoco, facts));
    // This search for contacts takes the field to be where the compiler put it.
    world.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE.value;
    return world;
  }

  // Put the patch of rough floor about a place.
  layGround([x, y]) {
    this.ground.centre(x, y);
    this.ground.place(this.model);
  }

  // Change the trunk's horizontal velocity at once, m/s along the world's x and y.
  push(x, y) {
    const { data, facts } = this;
    data.qvel[facts.root_dof] += x;
    data.qvel[facts.root_dof + 1] += y;
    this.renew();
  }

  // One control step.
  step() {
    const { mujoco, model, data, facts } = this;
    if (this.steps % facts.every === 0)
      Object.assign(this, this.controller.act(this.memory, senses(this), this.pace));
    const torque = this.motors.torque(this.target, data, this.forces),
      applied = data.qfrc_applied;
    facts.joints.dofs.forEach((dof, j) => {
      applied[dof] = torque[j];
    });
    if (this.opponent) this.oppose();
    data.xfrc_applied.fill(0);
    this.water?.press(this);
    this.hand.press();
    mujoco.mj_step2(model, data);
    this.forces.set(data.qfrc_constraint);
    const [x, y] = three(data.xpos, facts.trunk);
    if (this.ground?.size && this.ground.leaves(x, y)) this.layGround([x, y]);
    mujoco.mj_step1(model, data);
    this.steps += 1;
    if (this.turn !== null) this.heading += this.turn * facts.step;
    if (this.fell === Infinity && this.isDown()) this.fell = this.time;
  }

  // Let the opponent of a contest act on its own hinges.
  oppose() {
    const { qfrc_applied } = this.data;
    if (this.steps % this.facts.every === 0)
      this.theirs = this.opponent.act(this.theirs.memory, opponentSenses(this));
    this.facts.opponent.joints.dofs.forEach((dof, j) => {
      qfrc_applied[dof] = this.theirs.target[j];
    });
  }

  // The light's place [3] in the world; null in the dark.
  lightPlace() {
    return this.light && this.light.map((value, i) => this.facts.start.place[i] + value);
  }

  // Distance in m of the trunk from the light; null in the dark.
  lightDistance() {
    const place = three(this.data.xpos, this.facts.trunk);
    return this.light && Math.hypot(...minus(this.lightPlace(), place));
  }

  // Turn the light about the creature, to the left by an angle in rad.
  turnLight(angle) {
    if (!this.light) return;
    const place = three(this.data.xpos, this.facts.trunk),
      [x, y] = minus(this.lightPlace(), place),
      [cos, sin] = [Math.cos(angle), Math.sin(angle)],
      moved = [cos * x - sin * y - x, sin * x + cos * y - y, 0];
    this.light = this.light.map((value, i) => value + moved[i]);
  }

  // Height of the rough floor at a place; 0 on the plane.
  floorAt([x, y]) {
    return this.ground?.size ? this.ground.height(x, y) : 0;
  }

  // Height of a geom's lowest point above the floor: the sum of a sphere, a box and an ellipsoid.
  height(part) {
    const { geom, radius, box, ellipsoid } = part,
      { geom_xpos, geom_xmat } = this.data,
      down = three(geom_xmat, 3 * geom + 2);
    if (this.ground?.size)
      return this.ground.above(part, three(geom_xpos, geom), geom_xmat.slice(9 * geom, 9 * geom + 9));
    const reach =
      radius + dot(down.map(Math.abs), box) + Math.hypot(...down.map((d, i) => d * ellipsoid[i]));
    return geom_xpos[3 * geom + 2] - reach - this.facts.floor;
  }

  // Velocity [3] of a body at a point in the world. MuJoCo gives it at the centre of its tree.
  velocityAt(body, point) {
    const { data, model } = this,
      rooted = minus(point, three(data.subtree_com, model.body_rootid[body])),
      carried = cross(three(data.cvel, 2 * body), rooted);
    return three(data.cvel, 2 * body + 1).map((value, i) => value + carried[i]);
  }

  // Add a force [3] on a body at a point in the world to those of this step.
  pushAt(body, point, force) {
    const { data } = this,
      moment = cross(minus(point, three(data.xipos, body)), force);
    [...force, ...moment].forEach((value, i) => {
      data.xfrc_applied[6 * body + i] += value;
    });
  }

  // Whether the creature is down, by the certificate's first criterion.
  isDown() {
    const { data, facts } = this,
      { trunk, axes, fall, stand_height, forbidden } = facts;
    const up = dot(three(data.xmat, 3 * trunk + 2), axes.up),
      place = three(data.xpos, trunk),
      high = (place[2] - this.floorAt(place)) / stand_height;
    const sane = data.qvel.every(value => Math.abs(value) < BLOWN_UP);
    const fine = sane && up > fall.min_up && high > fall.height[0] && high < fall.height[1];
    return !fine || (fall.touch && forbidden.some(part => !(this.height(part) > 0)));
  }
}
