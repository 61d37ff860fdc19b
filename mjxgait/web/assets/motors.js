// Motors of the joints, written from docs/reference/controller.md: stable PD (Tan, Liu & Turk 2011),
// plain PD, or torques. Letters: J joints, nv degrees of freedom.

import { clip } from "./vectors.js";

export class Motors {
  // facts: of mjxgait/web/facts.py. model: one with the creature's mass matrix.
  constructor(facts, { M_rownnz, M_colind }) {
    this.facts = facts;
    // Row and column of each stored entry of the mass matrix.
    this.entries = [];
    for (const row of M_rownnz.keys())
      for (let n = 0; n < M_rownnz[row]; n++)
        this.entries.push([row, M_colind[this.entries.length]]);
  }

  // Joint torques [J]: the target itself, or by stable or plain PD. forces: [nv] of the constraints.
  torque(target, data, forces) {
    const { facts } = this,
      { kp, kd, limit, law, command } = facts.drive,
      { dofs, qpos } = facts.joints;
    if (command === "torque") return target.map((value, j) => clip(value, -limit[j], limit[j]));
    const h = law === "pd" ? 0 : facts.step;
    const wanted = dofs.map(
      (dof, j) =>
        -kp[j] * (data.qpos[qpos[j]] + h * data.qvel[dof] - target[j]) - kd[j] * data.qvel[dof],
    );
    if (law !== "pd") {
      const damping = kd.map(value => h * value),
        acceleration = this.predicted(wanted, damping, data, forces);
      dofs.forEach((dof, j) => {
        wanted[j] -= h * kd[j] * acceleration[dof];
      });
    }
    return wanted.map((value, j) => clip(value, -limit[j], limit[j]));
  }

  // The next acceleration [nv], with the motors' damping [J] taken implicitly.
  predicted(wanted, damping, { M, qfrc_bias, qfrc_passive }, constraint) {
    const { facts } = this,
      size = qfrc_bias.length;
    const matrix = Array.from({ length: size }, () => new Float64Array(size));
    this.entries.forEach(([row, column], n) => {
      matrix[row][column] = M[n];
    });
    const forces = Float64Array.from(qfrc_bias, (bias, i) => qfrc_passive[i] - bias);
    if (facts.drive.constraint_forces)
      forces.forEach((_, i) => {
        forces[i] += constraint[i];
      });
    facts.joints.dofs.forEach((dof, j) => {
      matrix[dof][dof] += damping[j];
      forces[dof] += wanted[j];
    });
    return solved(matrix, forces);
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
