// Runs walks under the page's own scripts: cases on standard input, motions on standard output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { engine, assets, cases } = JSON.parse(readFileSync(0, "utf8"));
const of = async file => import(pathToFileURL(file));
const mujoco = await (await of(`${engine}/mujoco.js`)).default();
const { KeyPoses } = await of(`${assets}/key_poses.js`);
const { Simulation } = await of(`${assets}/simulation.js`);

function walk({ facts, steps, disturbed, push }) {
  const simulation = new Simulation(mujoco, facts, new KeyPoses(facts.controller));
  if (disturbed) {
    simulation.setMass(disturbed.mass);
    simulation.setFriction(disturbed.friction);
    simulation.setSlope(...disturbed.slope);
    simulation.reset();
  }
  const qpos = [], target = [];
  for (let k = 0; k < steps; k++) {
    if (push?.step === k) simulation.push(...push.speed);
    qpos.push([...simulation.data.qpos]);
    simulation.step();
    target.push(simulation.target);
  }
  return { qpos, target, fell: simulation.fell === Infinity ? null : simulation.fell, pulls: pulls(simulation) };
}

// A hand that holds the trunk still, after a reset: its motion in 1 s, and then without the hand.
function pulls(simulation) {
  const { trunk, step } = simulation.facts;
  const place = () => [...simulation.data.xpos.slice(3 * trunk, 3 * trunk + 3)];
  simulation.reset();
  simulation.hold(trunk, place());
  simulation.pull.target[2] += 1;
  const before = place();
  for (let time = 0; time < 1; time += step) simulation.step();
  const held = place();
  simulation.letGo();
  for (let time = 0; time < 1; time += step) simulation.step();
  return { before, held, after: place() };
}

console.log(JSON.stringify(cases.map(walk)));
