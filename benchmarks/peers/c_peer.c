// The contest's rival in C: one mjData, one episode after the other, double precision.
//
// The controller is docs/reference/controller.md's. A step calls the parts of mj_step one by one, so that
// the controller sits between them and nothing is computed twice; what a walker without tendons,
// cameras and actuators does not need is not called. Compiled and called by c_peer.py, which fills
// `Work` field by field in this order.

#include <math.h>
#include <mujoco/mujoco.h>

enum { MAX_NV = 128 };

// J actuated joints, C poses in a cycle, F forbidden geoms, N genomes, R starts.
typedef struct {
  int joints, poses, interpolation, starts, steps, by_clock, constraint_forces, forbidden;
  int trunk, root_dof;  // root_dof: the first of the root's three angular velocities
  double body_length, stand_height, min_up, lowest, highest;
  const int *qpos_adr, *dof_adr, *geom, *push_step;                          // [J] [J] [F] [R]
  const double *kp, *kd, *limit, *low, *high, *stand;                        // [J]
  const double *steer_bend, *steer_stride, *balance_pitch, *balance_roll;    // [J]
  const double *reach;                          // [F, 7]: radius, box, ellipsoid
  const double *axes, *up;                      // [2, 3], [3]: forward and left, up of the trunk
  const double *start, *forward, *left;         // [3] of the standing pose, in the world
  const double *cycle, *tuning;                 // [N, C, J], [N, 7] as in docs/reference/controller.md
  const double *qpos, *qvel, *friction, *push;  // [R, ...]
  const double *geom_friction, *pair_friction;  // [ngeom], [npair] of the model: sliding
} Work;

static double clip(double x, double low, double high) { return fmin(fmax(x, low), high); }

static double dot(const double* a, const double* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// What of mj_step depends on positions and velocities only.
static void look(const mjModel* m, mjData* d) {
  mj_kinematics(m, d);
  mj_comPos(m, d);
  mj_makeM(m, d);
  mj_factorM(m, d);
  mj_collision(m, d);
  mj_makeConstraint(m, d);
  mj_comVel(m, d);
  mj_passive(m, d);
  mj_referenceConstraint(m, d);
  mj_rne(m, d, 0, d->qfrc_bias);
}

// The rest of it, once the applied forces are known.
static void move(const mjModel* m, mjData* d) {
  mj_fwdAcceleration(m, d);
  mj_fwdConstraint(m, d);
  mj_Euler(m, d);
}

// x becomes (M + h diag(kd))^-1 x: L'DL along the tree, in MuJoCo's sparse rows, diagonals last.
static void solve_damped(const Work* w, const mjModel* m, const mjData* d, double* x) {
  double LD[MAX_NV * MAX_NV];
  mju_copy(LD, d->M, m->nC);
  for (int j = 0; j < w->joints; j++) {
    int k = w->dof_adr[j];
    LD[m->M_rowadr[k] + m->M_rownnz[k] - 1] += m->opt.timestep * w->kd[j];
  }
  for (int k = m->nv - 1; k >= 0; k--) {
    int n = m->M_rownnz[k] - 1;
    double* row = LD + m->M_rowadr[k];
    const int* column = m->M_colind + m->M_rowadr[k];
    double inverse = 1 / row[n];
    for (int j = n - 1; j >= 0; j--) {
      double* above = LD + m->M_rowadr[column[j]];
      double share = row[j] * inverse;
      for (int c = 0; c <= j; c++) above[c] -= share * row[c];
      x[column[j]] -= share * x[k];
      row[j] = share;
    }
    x[k] *= inverse;  // nothing below k changes it any more
  }
  for (int k = 0; k < m->nv; k++) {
    const double* row = LD + m->M_rowadr[k];
    const int* column = m->M_colind + m->M_rowadr[k];
    for (int j = 0; j < m->M_rownnz[k] - 1; j++) x[k] -= row[j] * x[column[j]];
  }
}

// Whether the episode has failed. What is not a number has.
static int down(const Work* w, const mjData* d) {
  double up = dot(d->xmat + 9 * w->trunk + 6, w->up);
  double height = d->xpos[3 * w->trunk + 2] / w->stand_height;
  if (!(up >= w->min_up && height >= w->lowest && height <= w->highest)) return 1;
  for (int f = 0; f < w->forbidden; f++) {
    const double *reach = w->reach + 7 * f, *z = d->geom_xmat + 9 * w->geom[f] + 6;
    double low = d->geom_xpos[3 * w->geom[f] + 2] - reach[0], round = 0;
    for (int i = 0; i < 3; i++) {
      low -= fabs(z[i]) * reach[1 + i];
      round += z[i] * reach[4 + i] * z[i] * reach[4 + i];
    }
    if (!(low >= sqrt(round))) return 1;
  }
  return 0;
}

// One step of the controller: forces into qfrc_applied; the next position in the cycle.
static int control(const Work* w, const mjModel* m, mjData* d, int genome, int position, int step) {
  const double *gain = w->tuning + 7 * genome, h = m->opt.timestep;
  double threshold = gain[0], period = gain[1], axes[2][3], spin[3];
  const double *pos = d->xpos + 3 * w->trunk, *rot = d->xmat + 9 * w->trunk;
  for (int a = 0; a < 2; a++) mju_mulMatVec3(axes[a], rot, w->axes + 3 * a);
  mju_mulMatVec3(spin, rot, d->qvel + w->root_dof);
  double offset[3] = {pos[0] - w->start[0], pos[1] - w->start[1], pos[2] - w->start[2]};
  double wrong = atan2(dot(axes[0], w->left), dot(axes[0], w->forward)) +
                 dot(offset, w->left) / (2 * w->body_length);
  double steer = clip(gain[2] * wrong, -0.5, 0.5);
  double nose_down = -asin(clip(axes[0][2], -1, 1)), right_down = asin(clip(axes[1][2], -1, 1));
  double pitch = clip(gain[3] * nose_down + gain[4] * dot(spin, axes[1]), -0.5, 0.5);
  double roll = clip(gain[5] * right_down + gain[6] * dot(spin, axes[0]), -0.5, 0.5);

  int a = position / w->interpolation, length = w->poses * w->interpolation;
  double part = (double)(position % w->interpolation) / w->interpolation;
  const double* cycle = w->cycle + (long)genome * w->poses * w->joints;
  const double *here = cycle + a * w->joints, *next = cycle + (a + 1) % w->poses * w->joints;

  double error = 0, pull[MAX_NV], x[MAX_NV];
  for (int k = 0; k < m->nv; k++) {
    x[k] = d->qfrc_passive[k] - d->qfrc_bias[k];
    if (w->constraint_forces) x[k] += d->qfrc_constraint[k];
  }
  for (int j = 0; j < w->joints; j++) {
    double q = d->qpos[w->qpos_adr[j]], v = d->qvel[w->dof_adr[j]];
    double target = here[j] + part * (next[j] - here[j]);
    target += steer * (w->steer_bend[j] + w->steer_stride[j] * (target - w->stand[j]));
    target += pitch * w->balance_pitch[j] + roll * w->balance_roll[j];
    target = clip(target, w->low[j], w->high[j]);
    error += (target - q) * (target - q);
    pull[j] = w->kp[j] * (target - q - h * v) - w->kd[j] * v;
    x[w->dof_adr[j]] += pull[j];
  }
  solve_damped(w, m, d, x);
  for (int j = 0; j < w->joints; j++) {
    double torque = pull[j] - h * w->kd[j] * x[w->dof_adr[j]];
    d->qfrc_applied[w->dof_adr[j]] = clip(torque, -w->limit[j], w->limit[j]);
  }
  if (w->by_clock) return (int)(length * step * h / period + 1e-6) % length;
  return (position + (error < w->joints * threshold * threshold)) % length;
}

// Lives through an episode: its steps; *moved: m forward.
static int live(const Work* w, const mjModel* m, mjData* d, int genome, int start, double* moved) {
  mju_copy(d->qpos, w->qpos + start * m->nq, m->nq);
  mju_copy(d->qvel, w->qvel + start * m->nv, m->nv);
  mju_zero(d->qacc_warmstart, m->nv);
  mju_zero(d->qfrc_applied, m->nv);
  mju_zero(d->qfrc_constraint, m->nv);
  *moved = 0;
  for (int step = 0, position = 0; step < w->steps; step++) {
    if (step == w->push_step[start]) mju_addTo(d->qvel, w->push + start * m->nv, m->nv);
    look(m, d);
    if (down(w, d)) return step;
    const double* pos = d->xpos + 3 * w->trunk;
    *moved = dot(pos, w->forward) - dot(w->start, w->forward);
    position = control(w, m, d, genome, position, step + 1);
    move(m, d);
  }
  return w->steps;
}

// Episodes first, first + stride, ... below count: steps lived in *steps, m forward in *forward.
void lap(const Work* w, mjModel* m, mjData* d, int first, int stride, int count,
         long long* steps, double* forward) {
  mjcb_time = NULL;  // the Python package has MuJoCo time every function
  *steps = 0;
  *forward = 0;
  for (int episode = first; episode < count; episode += stride) {
    int start = episode % w->starts;
    double moved;
    for (int g = 0; g < m->ngeom; g++)
      m->geom_friction[3 * g] = w->geom_friction[g] * w->friction[start];
    for (int p = 0; p < m->npair; p++)
      for (int i = 0; i < 2; i++)
        m->pair_friction[5 * p + i] = w->pair_friction[p] * w->friction[start];
    *steps += live(w, m, d, episode / w->starts, start, &moved);
    *forward += moved;
  }
}
