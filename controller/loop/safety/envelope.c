/* The safety envelope in C: the same laws as its twin in Python, safety_envelope.py with braking.py, to the last bit.

   Those two files say why; here is only what a compiler needs. No heap, no global state, no recursion; C99 and C++.
   Numbers are doubles, or what REAL is defined as. Lengths are in rad, the unit of time is one tick. Compile without
   -ffast-math and with -ffp-contract=off, or the twins part by rounding. */
#include <math.h>

#ifndef REAL
#define REAL double
#define ROUNDING 1e-12 /* rad; the rounding error of a sum of many positions */
#define CHANGED 1e-9   /* rad; a target that is changed by more is counted as changed */
#define FARTHEST 1e300 /* rad; a target beyond is not finite */
#define SQRT sqrt
#define CEIL ceil
#define FLOOR floor
#define COPYSIGN copysign
#define FABS fabs
#endif

#ifdef ENVELOPE_SOURCE
const unsigned envelope_source = ENVELOPE_SOURCE; /* a checksum of this file */
#endif

#define R(x) ((REAL)(x))
#define STEPS 16 /* bisection steps for an acceleration between two extremes */

/* Limits of a joint: velocity, acceleration and jerk, ends of its range, and the longest way to rest it may need. */
typedef struct {
  REAL v, a, j, lower, upper, way;
} EnvelopeLimits;

/* A joint: position, velocity, acceleration, the goal before, its velocity, and whether the joint moves like it. */
typedef struct {
  REAL p, v, a, goal, goal_v, matched;
} EnvelopeJoint;

typedef struct {
  REAL high, low, last;
} Run;

static REAL least(REAL x, REAL y) { return y < x ? y : x; }
static REAL most(REAL x, REAL y) { return y > x ? y : x; }
static REAL bounded(REAL x, REAL low, REAL high) { return least(most(x, low), high); }

static REAL held_back(REAL v, REAL j) {
  REAL size = FABS(v), n = CEIL(R(0.5) * (SQRT(R(1.0) + R(8.0) * size / j) - R(1.0)));
  n = n > R(0.0) ? n : R(1.0);
  return COPYSIGN(size / n + R(0.5) * j * (n - R(1.0)), v);
}

static REAL braked(REAL v, REAL a, REAL most_a, REAL j) {
  return least(least(most(most(-held_back(v, j), a - j), -most_a), a + j), most_a);
}

static Run stopping_run(REAL v, REAL a, REAL most_a, REAL j) {
  REAL size = FABS(a), n = CEIL(size / j);
  int mirrored = v + COPYSIGN(n * size - R(0.5) * j * n * (n - R(1.0)), a) - a < R(0.0);
  if (mirrored) v = -v, a = -a;

  REAL f = FLOOR(a / j), square = a * a + j * (v - (f + R(1.0)) * (a - R(0.5) * j * f));
  REAL curve = FLOOR((a + (square > R(0.0) ? SQRT(square) : R(0.0))) / j), m = curve > f ? curve : f;
  REAL floored = FLOOR((a + most_a) / j);
  m = m > floored ? floored : m;
  m = m > R(0.0) ? m : R(0.0);
  REAL run = m * v + R(0.5) * m * (m + R(1.0)) * (a - j * (m + R(2.0)) / R(3.0));
  REAL fast = v + m * a - R(0.5) * j * m * (m + R(1.0));

  n = CEIL(most_a / j);
  REAL q = FLOOR((fast - (n * most_a - R(0.5) * j * n * (n - R(1.0)))) / most_a) + R(1.0);
  if (q > R(0.0)) {
    run += q * fast - R(0.5) * most_a * q * (q + R(1.0));
    fast -= q * most_a;
  }

  REAL h = held_back(fast, j);
  n = CEIL(h / j);
  run += n * (n - R(1.0)) * (R(0.5) * (h - n * j) + j * (n + R(1.0)) / R(6.0));

  REAL dip = R(0.0);
  if (v < R(0.0)) {
    REAL b = a - R(0.5) * j, k = CEIL((b - SQRT(most(b * b + R(2.0) * j * v, R(0.0)))) / j) - R(1.0);
    dip = k * v + R(0.5) * k * (k + R(1.0)) * (a - j * (k + R(2.0)) / R(3.0));
  }
  REAL high = run > R(0.0) ? run : R(0.0), low = dip < R(0.0) ? dip : R(0.0);
  Run there = {high, low, run}, back = {-low, -high, -run};
  return mirrored ? back : there;
}

static REAL longest_run(REAL speed, REAL size, REAL most_a, REAL j) {
  REAL top = speed + R(0.5) * ((size + j) * (size + j)) / j;
  return top * (size / j + top / most_a + most_a / j + R(4.0));
}

static REAL catching_up(const EnvelopeLimits *l, REAL p, REAL v, REAL goal, REAL goal_v, REAL goal_a, REAL low,
                        REAL high) {
  int steady = FABS(goal_a) <= l->a && FABS(goal_v) <= l->v;
  goal_v = bounded(goal_v, -l->v, l->v);
  goal_a = steady ? goal_a : R(0.0);
  REAL off = p + v - goal, fast = v - goal_v;
  REAL y_low = off + low + stopping_run(fast + low, low - goal_a, l->a, l->j).last;
  if (y_low >= R(0.0) || low >= high) return low;
  REAL y_high = off + high + stopping_run(fast + high, high - goal_a, l->a, l->j).last;
  if (y_high <= R(0.0)) return high;
  REAL enough = (high - low) / R(STEPS);
  for (;;) {
    REAL middle = low + bounded(-y_low / (y_high - y_low), R(0.1), R(0.9)) * (high - low);
    if (!(low < middle && middle < high)) return low;
    REAL y = off + middle + stopping_run(fast + middle, middle - goal_a, l->a, l->j).last;
    if (y < R(0.0))
      low = middle, y_low = y;
    else
      high = middle, y_high = y;
    if (high - low <= enough) return low - y_low / (y_high - y_low) * (high - low);
  }
}

static int can_stop(const EnvelopeLimits *l, REAL p, REAL v, REAL c) {
  REAL bottom = least(l->lower, p) - R(ROUNDING), top = most(l->upper, p) + R(ROUNDING);
  Run run = stopping_run(v + c, c, l->a, l->j);
  return p + v + c + run.high <= top && p + v + c + run.low >= bottom;
}

/* The next acceleration of a joint on its way to a goal, and whether the goal passes, by the exact tests. */
static REAL limited(const EnvelopeLimits *l, const EnvelopeJoint *s, REAL goal, REAL goal_v, int near, int *passes) {
  REAL p = s->p, v = s->v, a = s->a, direct = goal - p - v, stop = braked(v, a, l->a, l->j);
  REAL low = most(a - l->j, -l->a), high = least(a + l->j, l->a), half = R(0.5) * l->j;
  if ((half - low) * (half - low) > R(2.0) * l->j * (l->v + v)) low = most(low, -held_back(l->v + v, l->j));
  if ((half + high) * (half + high) > R(2.0) * l->j * (l->v - v)) high = least(high, held_back(l->v - v, l->j));
  low = least(low, stop), high = most(high, stop);

  *passes = (near || s->matched > R(0.0)) && low <= direct && direct <= high;
  REAL chosen = bounded(direct, low, high);
  if (!*passes && !near) chosen = catching_up(l, p, v, goal, goal_v, goal_v - s->goal_v, low, high);
  if (can_stop(l, p, v, chosen)) return chosen;
  *passes = 0;
  REAL way = chosen - stop, safe = stop;
  for (int step = 1; step < STEPS; step++) {
    REAL c = stop + R(step) / R(STEPS) * way;
    if (!can_stop(l, p, v, c)) break;
    safe = c;
  }
  return safe;
}

/* The safe target of a joint's tick, rad, for any target; `near` as of the twin. */
static REAL joint_tick(const EnvelopeLimits *l, EnvelopeJoint *s, REAL target, int near) {
  REAL fastest = target - s->p, direct = fastest - s->v;
  if ((s->matched > R(0.0) || near) && -l->j <= direct - s->a && direct - s->a <= l->j && -l->a <= direct &&
      direct <= l->a) {
    REAL size = FABS(direct), fast = FABS(fastest), spare = size - R(0.5) * l->j;
    REAL room = l->upper - target < target - l->lower ? l->upper - target : target - l->lower;
    if (fast + R(0.5) * (spare * spare) / l->j <= l->v &&
        (l->way <= room || longest_run(fast, size, l->a, l->j) <= room)) {
      EnvelopeJoint next = {target, s->v + direct, direct, target, target - s->goal, R(1.0)};
      *s = next;
      return target;
    }
  }
  REAL goal = -R(FARTHEST) < target && target < R(FARTHEST) ? target : s->goal;
  goal = goal < l->lower ? l->lower : goal > l->upper ? l->upper : goal;
  int passes;
  REAL goal_v = goal - s->goal, chosen = limited(l, s, goal, goal_v, near, &passes), v = s->v + chosen;
  REAL position = passes ? goal : s->p + v, lag = position - goal, away = goal_v - v - R(2.0) * lag;
  int matched = -l->j <= lag && lag <= l->j && -l->j <= away && away <= l->j;
  EnvelopeJoint next = {position, v, chosen, goal, goal_v, R(matched)};
  *s = next;
  return position;
}

/* One tick of all joints: safe targets, rad, for any targets; counts those that were changed. */
void envelope_tick(int joints, const EnvelopeLimits *limits, EnvelopeJoint *states, REAL *safe, const REAL *targets,
                   long long *changed, int near) {
  for (int k = 0; k < joints; k++) {
    safe[k] = joint_tick(limits + k, states + k, targets[k], near);
    REAL by = FABS(safe[k] - targets[k]);
    changed[k] += !(by <= R(CHANGED)); /* so that a NaN counts */
  }
}

/* One tick of braking; once at rest the joints are held. */
void envelope_brake(int joints, const EnvelopeLimits *limits, EnvelopeJoint *states, REAL *safe) {
  for (int k = 0; k < joints; k++) {
    EnvelopeJoint *s = states + k;
    REAL a = braked(s->v, s->a, limits[k].a, limits[k].j), v = s->v + a;
    EnvelopeJoint next = {s->p + v, v, a, s->p + v, v, R(1.0)};
    *s = next;
    safe[k] = s->p;
  }
}
