// The controller of one expression per joint, written from docs/reference/expressions.md.
//
// For the page of `mjxgait share --physics`. It uses neither the page nor MuJoCo. Letters: J joints.

const NAMES = {
  t: "time",
  vx: "forward_vel",
  vz: "up_vel",
  px: "forward",
  py: "aside",
  pz: "trunk_height",
  s0: "goal_distance",
  b0: "bar_distance",
};
const PARTS = { a: "joint_pos", w: "joint_vel", c: "contact" };
const FUNCTIONS = {
  "+": (a, b) => a + b,
  "-": (a, b) => a - b,
  "*": (a, b) => a * b,
  "/": (a, b) => (Math.abs(b) < 1e-6 ? 1 : a / b),
  ifltz: (a, b, c) => (a < 0 ? b : c),
  min: Math.min,
  max: Math.max,
  abs: Math.abs,
  sin: Math.sin,
  cos: Math.cos,
};
const MOST = 1e9;

export class Expressions {
  // facts: `controller` of mjxgait/web/facts.py: expressions [J] as text, low and high [J] in rad.
  constructor({ expressions, low, high }) {
    this.functions = expressions.map(text => compiled(text.match(/[()]|[^\s()]+/g)));
    Object.assign(this, { low, high });
  }

  // There is no memory.
  init() {
    return null;
  }

  // Return the target [J] in rad. senses: observations by name.
  act(memory, senses) {
    const target = this.functions.map((value, j) =>
      Math.min(this.high[j], Math.max(this.low[j], value(senses))),
    );
    return { target, memory };
  }
}

// The function of the observations that the next words mean; takes them from the list.
function compiled(words) {
  const word = words.shift();
  if (word !== "(") return /^[a-z]/.test(word) ? observation(word) : () => Number(word);
  const apply = FUNCTIONS[words.shift()];
  const given = [];
  while (words[0] !== ")") given.push(compiled(words));
  words.shift();
  return senses => {
    const value = apply(...given.map(argument => argument(senses)));
    return Math.min(MOST, Math.max(-MOST, value));
  };
}

function observation(word) {
  const part = /^([awc])(\d+)$/.exec(word);
  if (part) return senses => senses[PARTS[part[1]]][Number(part[2])];
  const name = NAMES[word] ?? word;
  return senses => senses[name];
}
