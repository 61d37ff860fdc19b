// Vectors, rotations and angles of MuJoCo, for the other modules.

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const minus = (a, b) => a.map((value, i) => value - b[i]);
export const clip = (value, low, high) => Math.min(high, Math.max(low, value));
export const wrapped = angle => angle - 2 * Math.PI * Math.floor((angle + Math.PI) / (2 * Math.PI));
export const three = (array, i) => [array[3 * i], array[3 * i + 1], array[3 * i + 2]];
// A rotation [9], row by row, times a vector [3].
export const turned = (rot, v) => [0, 1, 2].map(row => dot(three(rot, row), v));
