// The page with physics: loads MuJoCo, keeps real time, and lets a visitor disturb the creature.
//
// Scripts before it define these.
const { KeyPoses, Expressions, Network, Brain, Water, Ground, Simulation, View, loadMujoco } =
  globalThis;
const CONTROLLERS = { poses: KeyPoses, program: Expressions, network: Network, brain: Brain };

const element = id => document.getElementById(id);
const json = id => JSON.parse(element(id).textContent);
const viewer = element("walk"),
  said = element("said"),
  now = element("now");
// s: longest time that one picture makes up for. ms: longest computing for one picture.
const MOST_PASSED = 0.1,
  MOST_COMPUTING = 30;
// s that it must lie before the page says so: a creature that was lifted may land on its feet.
const LYING = 0.4;
const ARROWS = { ArrowUp: "ahead", ArrowDown: "back", ArrowLeft: "left", ArrowRight: "right" };

async function unpacked(id) {
  const packed = await fetch(`data:application/gzip;base64,${element(id).textContent.trim()}`);
  const stream = packed.body.pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function start() {
  const [facts, page] = [json("facts"), json("page")];
  const mujoco = await loadMujoco({ wasmBinary: await unpacked("engine") });
  const controller = new CONTROLLERS[facts.kind](facts.controller);
  const water = facts.water && new Water(facts.water);
  const opponent = facts.opponent && new CONTROLLERS[facts.kind](facts.opponent.controller);
  const ground = facts.ground && new Ground(facts.ground, facts.start);
  const simulation = new Simulation(mujoco, facts, controller, { water, opponent, ground });
  showControls(facts);
  const view = new View(viewer, element("overlay"), page);
  const state = {
    paused: false,
    slow: 1,
    follow: true,
    pulled: null,
    lying: 0,
    shove: null,
    changed: true,
  };
  const parts = { simulation, view, state, page };
  connectButtons(parts);
  connectSliders(parts);
  connectPointer(parts);
  connectKeys(parts);
  said.textContent = "";
  run(parts);
}

// Only key poses have a cycle whose speed could change; in water there is no floor.
function showControls({ kind, water, light }) {
  const hide = (id, hidden) => {
    element(id).closest("label").hidden = hidden;
  };
  hide("pace", kind !== "poses");
  for (const id of ["uphill", "aside", "rough", "friction"]) hide(id, water !== null);
  for (const part of document.querySelectorAll(".lit")) part.hidden = light === null;
  document.body.classList.toggle("water", water !== null);
}

// Real time, with an accumulator. A machine that is too slow slows the creature down, not the page.
function run({ simulation, view, state, page }) {
  const { step } = simulation.facts;
  let before = performance.now(),
    due = 0,
    shown = [];
  const frame = moment => {
    const passed = Math.max(0, Math.min((moment - before) / 1000, MOST_PASSED)),
      began = performance.now();
    before = moment;
    if (!state.paused) due += passed * state.slow;
    let steps = 0;
    for (; due >= step; due -= step, steps++) {
      if (performance.now() - began > MOST_COMPUTING) {
        due = 0;
        break;
      }
      aim(simulation, view, state);
      simulation.step();
      state.lying = simulation.isDown() && !state.pulled ? state.lying + step : 0;
    }
    const computing = performance.now() - began;
    // A paused page costs nothing.
    if (!state.paused || state.changed) view.draw(simulation, state.follow, passed);
    state.changed = false;
    drawLines(simulation, view, state);
    shown = [
      ...shown,
      { moment, time: simulation.time, steps, computing, place: ahead(simulation) },
    ].filter(one => moment - one.moment < 1000 && one.time <= simulation.time);
    tell(simulation, state, shown, page);
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

// m that the trunk is ahead of its start. A body that grew has no front: m from its start.
function ahead({ data, facts: { kind, trunk, start } }) {
  const moved = start.place.map((value, i) => data.xpos[3 * trunk + i] - value);
  if (kind === "brain") return Math.hypot(...moved);
  return start.forward.reduce((sum, value, i) => sum + value * moved[i], 0);
}

// The string's end follows the pointer, at the distance at which the creature was caught.
function aim(simulation, view, { pulled }) {
  const { pull } = simulation.hand;
  if (pulled && pull) pull.target = view.at(pulled.x, pulled.y, pulled.far);
}

function drawLines(simulation, view, state) {
  const { hand } = simulation;
  view.line("string", hand.pull && [hand.point(), hand.pull.target]);
  const { shove } = state,
    { trunk } = simulation.facts,
    { xpos } = simulation.data;
  if (shove && simulation.time - shove.time > 0.4) state.shove = null;
  const tip = [...xpos.slice(3 * trunk, 3 * trunk + 3)];
  view.spot("light", simulation.lightPlace());
  view.line("shove", state.shove && [tip.map((value, i) => value - (shove.way[i] ?? 0)), tip]);
}

// Text without "-0.0".
const rounded = (value, digits) => value.toFixed(digits).replace(/^-(?=0\.0*$)/, "");

function tell(simulation, state, shown, page) {
  const { time } = simulation,
    first = shown[0],
    last = shown.at(-1),
    lies = state.lying > LYING;
  const passed = last.time - first.time,
    real = (last.moment - first.moment) / 1000;
  const speed = passed > 0.2 ? (last.place - first.place) / passed : 0;
  const sum = key => shown.reduce((total, one) => total + one[key], 0);
  const late = !state.paused && real > 0.8 && passed / real < 0.9 * state.slow;
  now.textContent =
    `${rounded(time, 1)} s, ${rounded(last.place, 1)} m, ${rounded(speed, 2)} m/s` +
    (late ? `; this machine manages ${Math.round((100 * passed) / real)} % of real time` : "");
  if (lies !== said.classList.contains("fell")) {
    said.classList.toggle("fell", lies);
    said.innerHTML = lies ? 'It fell. <button data-do="restart">Stand up again (R)</button>' : "";
  }
  Object.assign(viewer.dataset, {
    time,
    ahead: last.place,
    lies,
    paused: state.paused,
    pulled: Boolean(simulation.hand.pull),
    apart: simulation.lightDistance(),
    frames: real > 0 ? (shown.length - 1) / real : 0,
    stepped: sum("computing") / Math.max(1, sum("steps")),
  });
}

const actions = {
  pause({ state }) {
    state.paused = !state.paused;
    element("pause").textContent = state.paused ? "Go on" : "Pause";
  },
  restart({ simulation, view, state }) {
    simulation.reset();
    Object.assign(state, { lying: 0, pulled: null, shove: null });
    view.recentre();
  },
  follow({ state, view }) {
    state.follow = !state.follow;
    if (state.follow) view.recentre();
    element("follow").setAttribute("aria-pressed", String(state.follow));
  },
  light({ simulation }) {
    simulation.turnLight(Math.PI / 2);
  },
  defaults() {
    for (const slider of document.querySelectorAll("#sliders input")) {
      slider.value = slider.defaultValue;
      slider.dispatchEvent(new Event("input"));
    }
  },
};

// A sudden change of the trunk's velocity, as in the certificate, seen from the creature.
function push({ simulation, state, page }, direction) {
  const {
      data,
      facts: { trunk, axes },
    } = simulation,
    rot = data.xmat.slice(9 * trunk, 9 * trunk + 9);
  const nose = [0, 3].map(
    row =>
      rot[row] * axes.forward[0] + rot[row + 1] * axes.forward[1] + rot[row + 2] * axes.forward[2],
  );
  const length = Math.max(Math.hypot(...nose), 1e-6),
    [x, y] = nose.map(value => value / length);
  const way = { ahead: [x, y], back: [-x, -y], left: [-y, x], right: [y, -x] }[direction];
  simulation.push(page.push * way[0], page.push * way[1]);
  state.shove = { time: simulation.time, way: way.map(value => page.extent * 0.5 * value) };
}

function connectButtons(parts) {
  document.addEventListener("click", event => {
    const { do: action, push: direction } = event.target.dataset;
    if (action) actions[action](parts);
    parts.state.changed = true;
    if (direction) push(parts, direction);
  });
  const speeds = [...document.querySelectorAll(".speed")];
  for (const button of speeds)
    button.addEventListener("click", () => {
      parts.state.slow = Number(button.dataset.speed);
      for (const other of speeds) other.setAttribute("aria-pressed", String(other === button));
    });
}

function connectSliders({ simulation, state }) {
  const value = id => Number(element(id).value),
    { forward, left } = simulation.facts.start;
  const slope = () => {
    const [up, aside] = ["uphill", "aside"].map(id => (value(id) * Math.PI) / 180);
    simulation.setSlope(up * forward[0] + aside * left[0], up * forward[1] + aside * left[1]);
  };
  const change = {
    uphill: slope,
    aside: slope,
    rough: () => simulation.setRough(value("rough") / 100),
    friction: () => simulation.setFriction(value("friction")),
    mass: () => simulation.setMass(value("mass")),
    pace: () => {
      simulation.pace = value("pace");
    },
  };
  for (const [id, apply] of Object.entries(change)) {
    const slider = element(id),
      shown = document.querySelector(`output[for="${id}"]`);
    slider.addEventListener("input", () => {
      shown.textContent = `${slider.value}${slider.dataset.unit}`;
      apply();
      state.changed = true;
    });
  }
}

// A pointer that goes down on the creature pulls it; elsewhere it turns the viewer's camera.
function connectPointer({ simulation, view, state }) {
  const end = event => {
    if (state.pulled?.id !== event.pointerId) return;
    state.pulled = null;
    simulation.hand.letGo();
  };
  viewer.addEventListener(
    "pointerdown",
    event => {
      if (state.pulled) event.stopPropagation();
      if (state.pulled || event.button !== 0) return;
      const found = view.pick(
        simulation,
        event.clientX,
        event.clientY,
        event.pointerType === "touch" ? 24 : 8,
      );
      if (!found) return;
      event.stopPropagation();
      viewer.setPointerCapture(event.pointerId);
      state.pulled = { id: event.pointerId, x: event.clientX, y: event.clientY, far: found.far };
      simulation.hand.hold(found.body, found.point);
    },
    { capture: true },
  );
  viewer.addEventListener("pointermove", event => {
    if (state.pulled?.id === event.pointerId)
      Object.assign(state.pulled, { x: event.clientX, y: event.clientY });
    else if (!event.buttons && event.pointerType === "mouse")
      viewer.classList.toggle(
        "grab",
        Boolean(view.pick(simulation, event.clientX, event.clientY, 8)),
      );
  });
  viewer.addEventListener("pointerup", end);
  viewer.addEventListener("pointercancel", end);
}

function connectKeys(parts) {
  const keys = { " ": "pause", r: "restart", f: "follow", l: "light" };
  addEventListener(
    "keydown",
    event => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const slides = event.target.matches?.("input"),
        action = keys[event.key.toLowerCase()];
      if (event.key in ARROWS && !slides && !event.repeat) push(parts, ARROWS[event.key]);
      else if (action && !event.repeat) actions[action](parts);
      parts.state.changed = true;
      if (action || (event.key in ARROWS && !slides)) {
        event.preventDefault();
        event.stopPropagation();
      }
    },
    { capture: true },
  );
  // Space on a button would press it as well.
  addEventListener(
    "keyup",
    event => {
      if (event.key === " ") event.preventDefault();
    },
    { capture: true },
  );
}

const begin = () =>
  start().catch(error => {
    said.textContent = `This browser cannot run the physics (${error.message}).`;
  });
viewer.loaded ? begin() : viewer.addEventListener("load", begin, { once: true });
