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

#ifdef MD_CALLED /* a small board wants no copies of a function */
#define SHARED MD_CALLED
#else
#define SHARED static
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

SHARED REAL least(REAL x, REAL y) { return y < x ? y : x; }
SHARED REAL most(REAL x, REAL y) { return y > x ? y : x; }
static REAL bounded(REAL x, REAL low, REAL high) { return least(most(x, low), high); }

#ifdef MD_FIXED
/* The same in whole numbers, with a limit of the jerk that 6 divides: what rounds is a size that n ticks divide. */
#define PRODUCT(x, y) product(x, y)
#define TARGET(x) bounded(x, R(-30.0), R(30.0)) /* so that no difference is too large */

static int32_t up(int32_t x, int32_t y) {
  return x > 0 ? (int32_t)md_part((uint32_t)x - 1u, (uint32_t)y) + 1 : -(int32_t)md_part(0u - (uint32_t)x, (uint32_t)y);
}
static int32_t down(int32_t x, int32_t y) { return -up(-x, y); }
SHARED REAL near_enough(int64_t x) {
  const int64_t most_way = (int64_t)24 << 25;
  return md_real::of((int32_t)(x > most_way ? most_way : x < -most_way ? -most_way : x));
}
SHARED REAL half_square(REAL x, REAL j) { return md_real::of(md_quotient((uint64_t)md_whole(x.raw, x.raw) >> 1, (uint32_t)j.raw)) + md_real::of(1); }

static int32_t held_size(uint32_t size, uint32_t j) {
  uint32_t n = md_root(md_part(2u * size, j));
  n = n ? n : 1u;
  if (n * (n + 1u) * j < 2u * size) n++;
  return (int32_t)(md_part(size, n) + (j / 2u) * (n - 1u));
}
static REAL held_back(REAL v, REAL j) {
  return md_real::of(v.raw < 0 ? -held_size(0u - (uint32_t)v.raw, (uint32_t)j.raw) : held_size((uint32_t)v.raw, (uint32_t)j.raw));
}
#else
#define PRODUCT(x, y) ((x) * (y))
#define TARGET(x) (x)

static REAL half_square(REAL x, REAL j) { return R(0.5) * (x * x) / j; }
static REAL held_back(REAL v, REAL j) {
  REAL size = FABS(v), n = CEIL(R(0.5) * (SQRT(R(1.0) + R(8.0) * size / j) - R(1.0)));
  n = n > R(0.0) ? n : R(1.0);
  return COPYSIGN(size / n + R(0.5) * j * (n - R(1.0)), v);
}

#endif

static REAL braked(const EnvelopeLimits *l, REAL v, REAL a) {
  return least(least(most(most(-held_back(v, l->j), a - l->j), -l->a), a + l->j), l->a);
}

#ifdef MD_FIXED
SHARED int64_t let_go(int32_t a, int32_t j, int64_t n) { return n * a - (j >> 1) * n * (n - 1); }
/* The way in n ticks that begin with a velocity and an acceleration from which six times a sixth goes away in each. */
SHARED int64_t way_in(int32_t n, int64_t v, int32_t a, int32_t sixth) {
  int64_t two = md_whole(n, n + 1);
  return n * v + (two >> 1) * a - two * (n + 2) * sixth;
}

static Run stopping_run(const EnvelopeLimits *l, REAL velocity, REAL acceleration) {
  int32_t v = velocity.raw, a = acceleration.raw, most_a = l->a.raw, j = l->j.raw, sixth = (int32_t)md_part((uint32_t)j, 6u), size = a < 0 ? -a : a;
  int64_t gone = let_go(size, j, up(size, j));
  int mirrored = v + (a < 0 ? -gone : gone) - a < 0;
  if (mirrored) v = -v, a = -a;

  int32_t f = down(a, j), m = f, floored = down(a + most_a, j);
  int64_t square = md_whole(a, a) + j * (v - (f + 1) * (a - md_whole(j >> 1, f)));
  int32_t curve = down(a + (square > 0 ? (int32_t)md_root((uint64_t)square) : 0), j);
  m = curve > f ? curve : f;
  m = m > floored ? floored : m;
  m = m > 0 ? m : 0;
  int64_t run = way_in(m, v, a, sixth), fast = v + let_go(a - j, j, m);

  int64_t over = fast - let_go(most_a, j, up(most_a, j));
  if (over >= 0) {
    int32_t q = md_quotient((uint64_t)over, (uint32_t)most_a) + 1;
    run += way_in(q, fast, -most_a, 0);
    fast -= md_whole(q, most_a);
  }

  int32_t h = held_back(md_real::of((int32_t)fast), l->j).raw;
  int32_t n = up(h, j);
  run += way_in(n - 1, 0, (int32_t)((uint32_t)h - (uint32_t)n * (uint32_t)j), -sixth);

  int64_t dip = 0;
  if (v < 0) {
    int32_t b = a - (j >> 1);
    int64_t turning = md_whole(b, b) + 2 * md_whole(j, v);
    int32_t k = up(b - (turning > 0 ? (int32_t)md_root((uint64_t)turning) : 0), j) - 1;
    dip = way_in(k, v, a, sixth);
  }
  REAL last = near_enough(run), high = most(last, R(0.0)), low = least(near_enough(dip), R(0.0));
  Run there = {high, low, last}, back = {-low, -high, -last};
  return mirrored ? back : there;
}

static REAL longest_run(REAL speed, REAL size, REAL most_a, REAL j) {
  uint32_t top = (uint32_t)speed.raw + (uint32_t)half_square(size + j, j).raw, hardest = (uint32_t)most_a.raw, jerk = (uint32_t)j.raw;
  return near_enough((int64_t)top * (md_part((uint32_t)size.raw, jerk) + md_part(top, hardest) + md_part(hardest, jerk) + 7u));
}
#else
SHARED REAL let_go(REAL a, REAL j, REAL n) { return n * a - R(0.5) * j * n * (n - R(1.0)); }
SHARED REAL way_in(REAL n, REAL v, REAL a, REAL j) {
  return n * v + R(0.5) * n * (n + R(1.0)) * (a - j * (n + R(2.0)) / R(3.0));
}

static Run stopping_run(const EnvelopeLimits *l, REAL v, REAL a) {
  REAL most_a = l->a, j = l->j, size = FABS(a), n = CEIL(size / j);
  int mirrored = v + COPYSIGN(let_go(size, j, n), a) - a < R(0.0);
  if (mirrored) v = -v, a = -a;

  REAL f = FLOOR(a / j), square = a * a + j * (v - (f + R(1.0)) * (a - R(0.5) * j * f));
  REAL curve = FLOOR((a + SQRT(most(square, R(0.0)))) / j), m;
  REAL floored = FLOOR((a + most_a) / j);
  m = most(least(most(curve, f), floored), R(0.0));
  REAL run = way_in(m, v, a, j);
  REAL fast = v + m * a - R(0.5) * j * m * (m + R(1.0));

  n = CEIL(most_a / j);
  REAL q = FLOOR((fast - let_go(most_a, j, n)) / most_a) + R(1.0);
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
    dip = way_in(k, v, a, j);
  }
  REAL high = most(run, R(0.0)), low = least(dip, R(0.0));
  Run there = {high, low, run}, back = {-low, -high, -run};
  return mirrored ? back : there;
}

static REAL longest_run(REAL speed, REAL size, REAL most_a, REAL j) {
  REAL top = speed + half_square(size + j, j);
  return top * (size / j + top / most_a + most_a / j + R(4.0));
}
#endif

static REAL catching_up(const EnvelopeLimits *l, REAL p, REAL v, REAL goal, REAL goal_v, REAL goal_a, REAL low,
                        REAL high) {
  int steady = FABS(goal_a) <= l->a && FABS(goal_v) <= l->v;
  goal_v = bounded(goal_v, -l->v, l->v);
  goal_a = steady ? goal_a : R(0.0);
  REAL off = p + v - goal, fast = v - goal_v;
  REAL y_low = off + low + stopping_run(l, fast + low, low - goal_a).last;
  if (y_low >= R(0.0) || low >= high) return low;
  REAL y_high = off + high + stopping_run(l, fast + high, high - goal_a).last;
  if (y_high <= R(0.0)) return high;
  REAL enough = (high - low) * R(1.0 / STEPS);
  for (;;) {
    REAL middle = low + bounded(-y_low / (y_high - y_low), R(0.1), R(0.9)) * (high - low);
    if (!(low < middle && middle < high)) return low;
    REAL y = off + middle + stopping_run(l, fast + middle, middle - goal_a).last;
    if (y < R(0.0))
      low = middle, y_low = y;
    else
      high = middle, y_high = y;
    if (high - low <= enough) return low - y_low / (y_high - y_low) * (high - low);
  }
}

static int can_stop(const EnvelopeLimits *l, REAL p, REAL v, REAL c) {
  REAL bottom = least(l->lower, p) - R(ROUNDING), top = most(l->upper, p) + R(ROUNDING);
  Run run = stopping_run(l, v + c, c);
  return p + v + c + run.high <= top && p + v + c + run.low >= bottom;
}

/* An acceleration, made less where the limit of the velocity, which is so far, would be passed. */
static REAL kept_below(const EnvelopeLimits *l, REAL a, REAL room) {
  REAL all = R(0.5) * l->j + a;
  return PRODUCT(all, all) > PRODUCT(l->j, R(2.0) * room) ? least(a, held_back(room, l->j)) : a;
}

/* The next acceleration of a joint on its way to a goal, and whether the goal passes, by the exact tests. */
static REAL limited(const EnvelopeLimits *l, const EnvelopeJoint *s, REAL goal, REAL goal_v, int near, int *passes) {
  REAL p = s->p, v = s->v, a = s->a, direct = goal - p - v, stop = braked(l, v, a);
  REAL low = most(a - l->j, -l->a), high = least(a + l->j, l->a);
  low = least(-kept_below(l, -low, l->v + v), stop), high = most(kept_below(l, high, l->v - v), stop);

  *passes = (near || s->matched > R(0.0)) && low <= direct && direct <= high;
  REAL chosen = bounded(direct, low, high);
  if (!*passes && !near) chosen = catching_up(l, p, v, goal, goal_v, goal_v - s->goal_v, low, high);
  if (can_stop(l, p, v, chosen)) return chosen;
  *passes = 0;
  REAL way = chosen - stop, safe = stop;
  for (int step = 1; step < STEPS; step++) {
    REAL c = stop + R(step) * R(1.0 / STEPS) * way;
    if (!can_stop(l, p, v, c)) break;
    safe = c;
  }
  return safe;
}

/* Moves a joint to a position, which it returns. */
static REAL moved(EnvelopeJoint *s, REAL p, REAL v, REAL a, REAL goal, REAL goal_v, REAL matched) {
  s->p = p, s->v = v, s->a = a, s->goal = goal, s->goal_v = goal_v, s->matched = matched;
  return p;
}

/* The safe target of a joint's tick, rad, for any target; `near` as of the twin. */
static REAL joint_tick(const EnvelopeLimits *l, EnvelopeJoint *s, REAL target, int near) {
  REAL fastest = target - s->p, direct = fastest - s->v;
  if ((s->matched > R(0.0) || near) && FABS(direct - s->a) <= l->j && FABS(direct) <= l->a) {
    REAL size = FABS(direct), fast = FABS(fastest), spare = size - R(0.5) * l->j;
    REAL room = least(target - l->lower, l->upper - target);
    if (fast + half_square(spare, l->j) <= l->v &&
        (l->way <= room || longest_run(fast, size, l->a, l->j) <= room)) {
      return moved(s, target, s->v + direct, direct, target, target - s->goal, R(1.0));
    }
  }
  REAL goal = -R(FARTHEST) < target && target < R(FARTHEST) ? target : s->goal;
  goal = bounded(goal, l->lower, l->upper);
  int passes;
  REAL goal_v = goal - s->goal, chosen = limited(l, s, goal, goal_v, near, &passes), v = s->v + chosen;
  REAL position = passes ? goal : s->p + v, lag = position - goal, away = goal_v - v - R(2.0) * lag;
  int matched = FABS(lag) <= l->j && FABS(away) <= l->j;
  return moved(s, position, v, chosen, goal, goal_v, R(matched));
}

/* One tick of all joints: safe targets, rad, for any targets; counts those that were changed. */
void envelope_tick(int joints, const EnvelopeLimits *limits, EnvelopeJoint *states, REAL *safe, const REAL *targets,
                   long long *changed, int near) {
  for (int k = 0; k < joints; k++) {
    safe[k] = joint_tick(limits + k, states + k, TARGET(targets[k]), near);
    REAL by = FABS(safe[k] - targets[k]);
    changed[k] += !(by <= R(CHANGED)); /* so that a NaN counts */
  }
}

/* One tick of braking; once at rest the joints are held. */
void envelope_brake(int joints, const EnvelopeLimits *limits, EnvelopeJoint *states, REAL *safe) {
  for (int k = 0; k < joints; k++) {
    EnvelopeJoint *s = states + k;
    REAL a = braked(limits + k, s->v, s->a), v = s->v + a;
    safe[k] = moved(s, s->p + v, v, a, s->p + v, v, R(1.0));
  }
}
