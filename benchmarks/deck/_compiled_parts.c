/* Two parts of a tick as C would do them: the rotations of the bones (controller/motion/orientation.py) and the angles
   of the limbs (LimbAngles in sim/retargeting/retarget.py). `python -m benchmarks compiled` compares them. */
#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

static double bounded(double x, double low, double high) { return fmin(fmax(x, low), high); }

/* Turns a bone on about itself so that its children, rest directions v onto goals h, fit best. */
static void twist(double *q, const double *g, long count, const long *child, const double *rest, const double *goal) {
  double w = q[0], x = q[1], y = q[2], z = q[3], cosine = 0.0, sine = 0.0;
  for (long k = 0; k < count; k++) {
    const double *v = rest + 3 * child[k], *h = goal + 3 * child[k];
    double own = w * w - x * x - y * y - z * z, twice = 2.0 * dot(q + 1, v), turned[3], across[3];
    cross(q + 1, v, turned);
    for (int i = 0; i < 3; i++) turned[i] = own * v[i] + twice * q[i + 1] + 2.0 * w * turned[i];
    double along = dot(turned, g);
    for (int i = 0; i < 3; i++) turned[i] -= along * g[i];
    cross(g, turned, across);
    cosine += dot(turned, h);
    sine += dot(across, h);
  }
  double half = 0.5 * atan2(sine, cosine), c = cos(half), s = sin(half), a = s * g[0], b = s * g[1], d = s * g[2];
  q[0] = c * w - a * x - b * y - d * z;
  q[1] = c * x + a * w + b * z - d * y;
  q[2] = c * y - a * z + b * w + d * x;
  q[3] = c * z + a * y - b * x + d * w;
}

/* Rotations (1 + n, 4) of n bones, the first given; 1 where a rare case would need Python. */
int orient(long n, const long *parent, const double *rest, const long *first, const long *child, const double *goal,
           double *rotation) {
  for (long bone = 0; bone < n; bone++) {
    const double *p = rotation + 4 * (parent[bone] + 1), *r = rest + 3 * bone, *g = goal + 3 * bone;
    double *q = rotation + 4 * (bone + 1), e[3], f[3] = {g[0] + r[0], g[1] + r[1], g[2] + r[2]}, w = 1.0 + dot(g, r);
    cross(r, g, e);
    double s = w * p[0] + dot(e, p + 1), t = dot(f, p + 1);
    if (w < 0.01 || (w == 1.0 && g[0] == 0.0) || (s == 0.0 && t == 0.0)) return 1;
    q[0] = s * w;
    for (int i = 0; i < 3; i++) q[i + 1] = s * e[i] + t * f[i];
    if (first[bone + 1] - first[bone] > 1)
      twist(q, g, first[bone + 1] - first[bone], child + first[bone], rest, goal);
  }
  for (double *q = rotation; q <= rotation + 4 * n; q += 4) {
    double length = sqrt(q[0] * q[0] + dot(q + 1, q + 1));
    for (int i = 0; i < 4; i++) q[i] /= length;
  }
  return 0;
}

typedef struct {
  const double *lower, *upper, *last;
  double *angles, slope;
} Limbs;

static void follow(Limbs *l, int joint, double goal, double moved, double certain) {
  double last = l->last[joint], lower = l->lower[joint], upper = l->upper[joint], most = 4.0 * moved + 0.02 * certain;
  if (fabs(last - goal) > PI) goal += 2.0 * PI * rint((last - goal) / (2.0 * PI));
  if (goal < lower || goal > upper) {
    double other = goal > upper ? goal - 2.0 * PI : goal + 2.0 * PI;
    if ((goal > upper + 0.6 || goal < lower - 0.6) && lower <= other && other <= upper) goal = other;
    goal = bounded(goal, lower, upper);
  }
  l->angles[joint] = bounded(goal, last - most, last + most);
}

static void arm(Limbs *l, int joint, const double *upper, const double *fore, double upper_moved, double moved) {
  double x = upper[0], y = upper[1], z = upper[2], fx = fore[0], fy = fore[1], fz = fore[2], share_of_fore = 0.7;
  double pitch = l->last[joint], elbow = l->last[joint + 2], roll, most = fmax(upper_moved, moved);
  for (int rounds = 3;;) {
    double c = cos(pitch), s = sin(pitch), fore_ahead = c * fx - s * fz, fore_up = s * fx + c * fz;
    double share = share_of_fore * cos(elbow);
    roll = atan2(y + share * fy, fmax(-(s * x + c * z) - share * fore_up, 0.5 * hypot(x, z)));
    roll = bounded(roll, l->lower[joint + 1], l->upper[joint + 1]);
    double sideways = sin(roll), upper_down = -cos(roll);
    elbow = bounded(atan2(fore_ahead, sideways * fy + upper_down * fore_up), l->lower[joint + 2], l->upper[joint + 2]);
    if (rounds-- == 0) break;
    double ahead = sin(elbow), down = cos(elbow) * upper_down;
    double sine = upper_down * x + share_of_fore * (down * fx - ahead * fz);
    double cosine = upper_down * z + share_of_fore * (down * fz + ahead * fx), certain = fmin(hypot(sine, cosine), 1.0);
    if (certain < 1e-3) {
      rounds = 0, pitch = l->angles[joint];
    } else if (rounds == 0) {
      follow(l, joint, atan2(sine, cosine), fmin(2.0 * certain, 1.0) * most, certain);
      pitch = l->angles[joint];
    } else {
      pitch = atan2(sine, cosine);
    }
  }
  follow(l, joint + 1, roll, most, 1.0);
  follow(l, joint + 2, elbow, upper_moved + moved, 1.0);
}

static void leg(Limbs *l, int joint, double *across, const double *thigh, const double *shank, const double *foot,
                const double *up, double moved) {
  double bend[3], turn[3], ahead[3];
  cross(thigh, shank, bend);
  cross(foot, shank, turn);
  for (int i = 0; i < 3; i++) turn[i] += 2.0 * bend[i];
  double faint = fmax(0.5 - sqrt(dot(turn, turn)), 0.0);
  for (int i = 0; i < 3; i++) turn[i] += faint * across[i];
  double along = dot(turn, thigh);
  for (int i = 0; i < 3; i++) turn[i] -= along * thigh[i];
  double length = sqrt(dot(turn, turn));
  if (length > 1e-3)
    for (int i = 0; i < 3; i++) across[i] = turn[i] / length;
  cross(thigh, across, ahead);
  double level = hypot(across[0], across[1]), *angles = l->angles;
  follow(l, joint, atan2(-across[0], across[1]), moved, level);
  follow(l, joint + 1, atan2(across[2], level), moved, 1.0);
  follow(l, joint + 2, atan2(-ahead[2], -thigh[2]), moved, level);
  follow(l, joint + 3, atan2(sqrt(dot(bend, bend)), dot(thigh, shank)), moved, 1.0);
  double pitch = atan2(dot(foot, thigh), dot(foot, ahead));
  follow(l, joint + 4, pitch - angles[joint + 3] - l->slope, moved, 1.0);
  double total = angles[joint + 3] + angles[joint + 4], upright = fmax(-dot(shank, up), 0.0);
  double sole_up = sin(total) * dot(ahead, up) - cos(total) * dot(thigh, up);
  follow(l, joint + 5, upright * upright * atan2(-dot(across, up), fmax(sole_up, 0.3)), moved, 1.0);
}

/* The 20 angles of limbs that point in directions (14, 3), from the last ones, directions and legs' axes on. */
void limbs(const double *direction, const double *up, const double *lower, const double *upper, double slope,
           double *before, double *across, double *last, double *angles) {
  double moved[14];
  const double(*d)[3] = (const double(*)[3])direction;
  for (int i = 0; i < 14; i++) {
    double step[3];
    for (int k = 0; k < 3; k++) step[k] = d[i][k] - before[3 * i + k];
    moved[i] = sqrt(dot(step, step));
  }
  memcpy(before, direction, 42 * sizeof(double));
  Limbs l = {lower, upper, last, angles, slope};
  double level = hypot(d[10][0], d[10][1]);
  follow(&l, 0, atan2(d[10][1], d[10][0]), moved[10], level);
  follow(&l, 1, atan2(-d[10][2], level), moved[10], 1.0);
  arm(&l, 2, d[0], d[1], moved[0], moved[1]);
  arm(&l, 5, d[2], d[3], moved[2], moved[3]);
  leg(&l, 8, across, d[4], d[5], d[6], up, fmax(fmax(moved[4], moved[5]), moved[6]));
  leg(&l, 14, across + 3, d[7], d[8], d[9], up, fmax(fmax(moved[7], moved[8]), moved[9]));
  memcpy(last, angles, 20 * sizeof(double));
}
