// Runs walks under the page's own scripts: cases on standard input, motions on standard output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { engine, assets, cases } = JSON.parse(readFileSync(0, "utf8"));
const of = async file => import(pathToFileURL(file));
const mujoco = await (await of(`${engine}/mujoco.js`)).default();
const { KeyPoses } = await of(`${assets}/key_poses.js`);
const { Expressions } = await of(`${assets}/expressions.js`);
const { Brain } = await of(`${assets}/brain.js`);
const { Network } = await of(`${assets}/network.js`);
const { Water } = await of(`${assets}/water.js`);
const { Ground } = await of(`${assets}/ground.js`);
const { Simulation } = await of(`${assets}/simulation.js`);
const CONTROLLERS = { poses: KeyPoses, program: Expressions, brain: Brain, network: Network };

function walk({ facts, steps, disturbed, push, rough }) {
  const controller = new CONTROLLERS[facts.kind](facts.controller);
  const water = facts.water && new Water(facts.water);
  const opponent = facts.opponent && new CONTROLLERS[facts.kind](facts.opponent.controller);
  const ground = facts.ground && new Ground(facts.ground, facts.start);
  const simulation = new Simulation(mujoco, facts, controller, { water, opponent, ground });
  if (disturbed) {
    simulation.setMass(disturbed.mass);
    simulation.setFriction(disturbed.friction);
    simulation.setSlope(...disturbed.slope);
    simulation.reset();
  }
  const qpos = [],
    target = [],
    lowest = [];
  for (let k = 0; k < steps; k++) {
    if (push?.step === k) simulation.push(...push.speed);
    for (const { step, size } of rough ?? [])
      if (step === k) {
        simulation.setRough(size);
        lowest.push(Math.min(...facts.solid.map(part => simulation.height(part))));
      }
    qpos.push([...simulation.data.qpos]);
    simulation.step();
    target.push(simulation.target);
  }
  return {
    qpos,
    target,
    lowest,
    last: [...simulation.data.qpos],
    heights: facts.solid.map(part => simulation.height(part)),
    fell: simulation.fell === Infinity ? null : simulation.fell,
    pulls: pulls(simulation),
  };
}

// A hand that lifts the trunk by 1 m, after a reset: places before, after 1.8 s,
// after 2 s, and 1 s later.
function pulls(simulation) {
  const { trunk, step } = simulation.facts;
  const place = () => [...simulation.data.xpos.slice(3 * trunk, 3 * trunk + 3)];
  const wait = seconds => {
    for (let time = 0; time < seconds; time += step) simulation.step();
    return place();
  };
  simulation.reset();
  simulation.hand.hold(trunk, place());
  simulation.hand.pull.target[2] += 1;
  const before = place(),
    rising = wait(1.8),
    held = wait(0.2);
  simulation.hand.letGo();
  return { before, rising, held, after: wait(1) };
}

console.log(JSON.stringify(cases.map(walk)));
