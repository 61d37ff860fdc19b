// One creature in MuJoCo's WebAssembly build, under a controller, with what a visitor may change.
//
// It knows neither pages nor kinds of controllers. Observations, stable PD and falls are written
// from docs/reference/controller.md and docs/reference/certificate.md. Units: m, kg, s, N, rad; the
// world's z axis points up. Letters: J joints, F feet, nv degrees of freedom.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const minus = (a, b) => a.map((value, i) => value - b[i]);
const clip = (value, low, high) => Math.min(high, Math.max(low, value));
const wrapped = angle => angle - 2 * Math.PI * Math.floor((angle + Math.PI) / (2 * Math.PI));
const three = (array, i) => [array[3 * i], array[3 * i + 1], array[3 * i + 2]];
// A rotation [9], row by row, times a vector [3].
const turned = (rot, v) => [0, 1, 2].map(row => dot(three(rot, row), v));

const BLOWN_UP = 1e4;
// m; a foot nearer to the floor counts as in contact.
const CONTACT_GAP = 0.002;

export class Simulation {
  // facts: of mjxgait/web/facts.py. controller: has `init` and `act`, as in key_poses.js. water: has
  // `press`, as in water.js; null on land. opponent: the controller of `facts.opponent`; null without.
  // ground: of ground.js, level at first; null in water.
  constructor(mujoco, facts, controller, { water = null, opponent = null, ground = null } = {}) {
    Object.assign(this, { mujoco, facts, controller, water, opponent, ground });
    this.plane = this.simulated(mujoco.MjModel.from_xml_string(facts.xml));
    Object.assign(this, this.plane, { changed: { mass: 1, friction: 1, slope: [0, 0] } });
    const { body_mass, body_inertia, geom_friction, opt, M_rownnz, M_colind } = this.model;
    this.plain = {
      mass: [...body_mass],
      inertia: [...body_inertia],
      friction: [...geom_friction],
      gravity: [...opt.gravity],
    };
    this.entries = [];
    for (const row of M_rownnz.keys())
      for (let n = 0; n < M_rownnz[row]; n++)
        this.entries.push([row, M_colind[this.entries.length]]);
    this.pace = 1;
    this.turn = facts.turn;
    this.light = facts.light;
    this.pull = null;
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
    Object.assign(this, { steps: 0, fell: Infinity, heading: 0, pull: null });
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
    const { ground, mujoco, facts, data } = this,
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
      Object.assign(this, this.controller.act(this.memory, this.senses(), this.pace));
    const torque = this.torque(this.target),
      applied = data.qfrc_applied;
    facts.joints.dofs.forEach((dof, j) => {
      applied[dof] = torque[j];
    });
    if (this.opponent) this.oppose();
    data.xfrc_applied.fill(0);
    this.water?.press(this);
    this.applyPull();
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
    const { qpos, qfrc_applied } = this.data,
      { joints, parts } = this.facts.opponent;
    if (this.steps % this.facts.every === 0)
      this.theirs = this.opponent.act(this.theirs.memory, {
        joint_pos: joints.qpos.map(adr => qpos[adr]),
        contact: parts.map(part => (this.height(part) < CONTACT_GAP ? 1 : 0)),
        light: parts.map(({ geom }) => this.towardsLight(geom)),
      });
    joints.dofs.forEach((dof, j) => {
      qfrc_applied[dof] = this.theirs.target[j];
    });
  }

  // Observations of the controller, by their names in the documentation.
  senses() {
    const { data, facts } = this,
      { trunk, axes, start, root_dof } = facts,
      { qpos, qvel } = data;
    const rot = data.xmat.slice(9 * trunk, 9 * trunk + 9),
      place = three(data.xpos, trunk);
    const [forward, left] = [turned(rot, axes.forward), turned(rot, axes.left)];
    const spin = turned(rot, qvel.slice(root_dof + 3, root_dof + 6));
    const heading = Math.atan2(dot(forward, start.left), dot(forward, start.forward));
    const free = this.turn === null;
    return {
      joint_pos: facts.joints.qpos.map(adr => qpos[adr]),
      ...this.plainSenses(place),
      heading: free ? heading : wrapped(heading - this.heading),
      ...(free ? {} : { aside: 0 }),
      pitch: -Math.asin(clip(forward[2], -1, 1)),
      roll: Math.asin(clip(left[2], -1, 1)),
      pitch_rate: dot(spin, left),
      roll_rate: dot(spin, forward),
      ...this.noseSenses(forward, place, qvel.slice(root_dof, root_dof + 3)),
    };
  }

  // Observations of time, joints, place and velocity.
  plainSenses(place) {
    const { data, facts, time } = this,
      { start, root_dof, goal, bar } = facts;
    const moved = minus(place, start.place),
      velocity = data.qvel.slice(root_dof, root_dof + 3);
    const forward = dot(moved, start.forward);
    return {
      time,
      beat: 2 * (time - Math.floor(time)) - 1,
      joint_vel: facts.joints.dofs.map(dof => data.qvel[dof]),
      trunk_height: place[2] - this.floorAt(place),
      forward,
      aside: dot(moved, start.left),
      forward_vel: dot(velocity, start.forward),
      up_vel: velocity[2],
      goal_distance: goal - forward,
      bar_distance: bar - forward,
    };
  }

  // Observations along the nose and to its left; those of feet only if the controller reads them.
  noseSenses(forward, place, velocity) {
    const length = Math.max(Math.hypot(forward[0], forward[1]), 1e-6);
    const nose = [forward[0] / length, forward[1] / length, 0],
      beside = cross([0, 0, 1], nose);
    return {
      nose_vel: [dot(velocity, nose), dot(velocity, beside)],
      ...(this.facts.feet.seen ? this.footSenses(place, nose, beside) : {}),
    };
  }

  footSenses(place, nose, beside) {
    const { feet } = this.facts,
      { geom_xpos } = this.data;
    const middle = geoms =>
      [0, 1, 2].map(
        axis => geoms.reduce((sum, { geom }) => sum + geom_xpos[3 * geom + axis], 0) / geoms.length,
      );
    const foot_height = feet.parts.map(geoms =>
      this.water ? Infinity : Math.min(...geoms.map(one => this.height(one))),
    );
    return {
      light: feet.parts.flat().map(({ geom }) => this.towardsLight(geom)),
      foot_height,
      contact: foot_height.map(height => (height < CONTACT_GAP ? 1 : 0)),
      foot_place: feet.parts.map(geoms => {
        const away = minus(middle(geoms), place);
        return [dot(away, nose), dot(away, beside)];
      }),
    };
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

  // Direction [3] of the light in a geom's own axes; zero in the dark. In a contest it is the cube.
  towardsLight(geom) {
    const { data, facts } = this,
      place = facts.opponent ? three(data.geom_xpos, facts.opponent.cube) : this.lightPlace();
    if (!place) return [0, 0, 0];
    const there = minus(place, three(data.geom_xpos, geom)),
      far = Math.max(Math.hypot(...there), 1e-9),
      rot = data.geom_xmat.slice(9 * geom, 9 * geom + 9);
    return [0, 1, 2].map(
      column => dot([rot[column], rot[3 + column], rot[6 + column]], there) / far,
    );
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

  // Joint torques [J]: the target itself, or by stable PD (Tan, Liu & Turk 2011) or plain PD.
  torque(target) {
    const { data, facts } = this,
      { kp, kd, limit, law, command } = facts.drive,
      { dofs, qpos } = facts.joints;
    if (command === "torque") return target.map((value, j) => clip(value, -limit[j], limit[j]));
    const h = law === "pd" ? 0 : facts.step;
    const wanted = dofs.map(
      (dof, j) =>
        -kp[j] * (data.qpos[qpos[j]] + h * data.qvel[dof] - target[j]) - kd[j] * data.qvel[dof],
    );
    if (law !== "pd") {
      const acceleration = this.predicted(
        wanted,
        kd.map(value => h * value),
      );
      dofs.forEach((dof, j) => {
        wanted[j] -= h * kd[j] * acceleration[dof];
      });
    }
    return wanted.map((value, j) => clip(value, -limit[j], limit[j]));
  }

  // The next acceleration [nv], with the motors' damping [J] taken implicitly.
  predicted(wanted, damping) {
    const {
        data,
        model: { nv },
        facts,
      } = this,
      { M, qfrc_bias, qfrc_passive } = data;
    const matrix = Array.from({ length: nv }, () => new Float64Array(nv));
    this.entries.forEach(([row, column], n) => {
      matrix[row][column] = M[n];
    });
    const forces = Float64Array.from(qfrc_bias, (bias, i) => qfrc_passive[i] - bias);
    if (facts.drive.constraint_forces)
      forces.forEach((_, i) => {
        forces[i] += this.forces[i];
      });
    facts.joints.dofs.forEach((dof, j) => {
      matrix[dof][dof] += damping[j];
      forces[dof] += wanted[j];
    });
    return solved(matrix, forces);
  }

  // The visitor's spring, and a damper, from a point of a body to a place in the world.
  applyPull() {
    const { pull } = this;
    if (!pull) return;
    const { body, target, stiffness, damping, most } = pull,
      point = this.pulledPoint();
    const velocity = this.velocityAt(body, point);
    const force = point.map(
      (value, i) => stiffness * (target[i] - value) - damping * velocity[i],
    );
    const share = Math.min(1, most / Math.max(Math.hypot(...force), 1e-9));
    force.forEach((value, i) => {
      force[i] = share * value;
    });
    this.pushAt(body, point, force);
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

  // The place in the world at which the visitor holds a body.
  pulledPoint() {
    const {
        data,
        pull: { body, local },
      } = this,
      place = three(data.xpos, body);
    return turned(data.xmat.slice(9 * body, 9 * body + 9), local).map(
      (value, i) => place[i] + value,
    );
  }

  // Hold a body at a point in the world, as firmly as suits the creature's mass.
  hold(body, point) {
    const { data, model } = this,
      rot = data.xmat.slice(9 * body, 9 * body + 9);
    const away = minus(point, three(data.xpos, body));
    const mass = model.body_mass.reduce((sum, value) => sum + value, 0),
      firmness = 8;
    this.pull = {
      body,
      target: [...point],
      stiffness: mass * firmness ** 2,
      damping: mass * firmness,
      most: 2 * mass * Math.hypot(...this.plain.gravity),
      local: [0, 1, 2].map(
        column => rot[column] * away[0] + rot[3 + column] * away[1] + rot[6 + column] * away[2],
      ),
    };
  }

  letGo() {
    this.pull = null;
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

// Solution of a symmetric positive definite system by Cholesky's method. matrix: its lower triangle.
// Both arguments are overwritten.
function solved(matrix, right) {
  const size = right.length;
  for (let i = 0; i < size; i++) {
    for (let j = 0; j <= i; j++) {
      let sum = matrix[i][j];
      for (let k = 0; k < j; k++) sum -= matrix[i][k] * matrix[j][k];
      matrix[i][j] = i === j ? Math.sqrt(sum) : sum / matrix[j][j];
    }
    let sum = right[i];
    for (let k = 0; k < i; k++) sum -= matrix[i][k] * right[k];
    right[i] = sum / matrix[i][i];
  }
  for (let i = size - 1; i >= 0; i--) {
    let sum = right[i];
    for (let k = i + 1; k < size; k++) sum -= matrix[k][i] * right[k];
    right[i] = sum / matrix[i][i];
  }
  return right;
}
