/* The player of player.h: the deck of Motiondeck (controller/deck, controller/loop) for joints, in C99 and C++.

   It does what the files named in the comments below do, which say why; here is only what a compiler needs. */
#include "player.h"

#include <math.h>
#include <string.h>

/* As memset and memcpy, some hundred bytes less on a small board; volatile, or the compiler calls those. */
MD_CALLED void clear(void *place, size_t bytes) {
  for (volatile unsigned char *byte = (unsigned char *)place; bytes--;) *byte++ = 0;
}
MD_CALLED void copy(void *place, const void *from, size_t bytes) {
  const unsigned char *other = (const unsigned char *)from;
  for (volatile unsigned char *byte = (unsigned char *)place; bytes--;) *byte++ = *other++;
}
#ifndef MD_FIXED
/* The whole numbers at and below, at and above, and nearest to some (clip.nearest); those of large ones are themselves. */
MD_CALLED float rounded_down(float x) {
  if (fabsf(x) >= 8388608.0f) return x;
  float whole = (float)(int32_t)x;
  return whole > x ? whole - 1.0f : whole;
}
static float rounded_up(float x) { return -rounded_down(-x); }
static float rounded(float x) { return rounded_down(x + 0.50013f); }
#endif

#include "envelope.c"

#ifdef MD_FIXED
#define MAGIC 0x3258444Du /* "MDX2" */
#else
#define MAGIC 0x3250444Du /* "MDP2" */
#endif
enum { WORDS = 1, CHECKSUM, JOINTS, MOTIONS, TICK_RATE, FRAMES_A_TICK, LIMITS, MOTION_ROWS, WAYS, NAMES, INVERSE, TICK };

#define SHORTEST 0.2f /* fade_search.py */
#define LONGEST 1.6f
#define PLANNED_SHARE 0.8f
#define MOMENTS 16
#define LONGER 1.1f
#define ALL_BUT 1.001f
#define PATIENT_TRIALS 6
#define YIELDING 0.02f
#define FASTEST 1.5f /* join_limits.py */
#define HARDEST 2.0f
#define CORRECTED_FROM 0.9f /* performance.py */
#define CORRECTED_AGAIN 0.05f
#define VELOCITY_REACH (8.0f / 120.0f)
#define TEMPO_RATE 2.5f /* tempo.py */
#define PER_LEVER (1.0f / LEVER)
#define LEVER 4.0f      /* m, of the bone that stands for a joint and turns by 1 / LEVER of its angle (joint_angles.py) */
#define HARD 8.0f       /* accelerations of motions are in units of HARD * HARD rad/s^2 */
#define SOON 1.13e-3f   /* s; times that differ by less are the same (deck_motions.py) */
#define NONE (-1)
#define COARSE 4 /* anchors from one that is compared first to the next (spread_search.py) */
#define CARRIED 0.4531f
#define NEXT_TO_NONE 1e-4f
#define SHORTEST_BEAT 0.25f /* s (beat_clock.py) */
#define LONGEST_BEAT 1.5f
#define SLACK 0.02013f
#define LONG_AGO 30.0f
#define FOLLOW 80.0f /* 1/s (live_values.py) */
#define BLEND_TURNS_OVER 2.0f /* performance.py, playing_tracks.py */
#define EASED_FROM 0.7f
#define EASED_TO 0.8f
#define SLOWEST 0.2f
#define EASING_SECONDS 0.1f
#define STILL 0.1f
#define TURNS_OVER 2.5f
#define LEAST_RESPONSE -9.0f /* the exponent of a satellite that counts (satellites.py) */
#define MOST_CENTERS 8
#define BLENDS (MD_MOST_BLENDED > 1)

/* What numbers of fixed point do in their own way (fixed.h). */
#ifndef MD_FIXED
static md_real times_key(md_real weight, int16_t key) { return weight * (float)key; }
static md_wide product(md_real x, md_real y) { return x * y; }
static md_wide clearly_less(md_wide cost) { return cost * (1.0f - 1.0f / 1024.0f); }
static md_real times(md_real x, int n) { return x * (float)n; }
static md_real share_of(md_real x, int n) { return x / (float)n; }
static md_real ratio(int k, int n) { return (float)k / (float)n; }
static uint32_t md_part(uint32_t x, uint32_t y) { return x / y; }
static int nearest(md_real x) { return (int)rounded(x); }
static int nearest_times(md_real x, int n) { return (int)rounded(x * (float)n); }
static int whole_ticks(md_real seconds, md_real tick) { return (int)(seconds / tick); }
static void pass(md_time *x, md_rest *rest, md_real tick, md_real tempo) { /* as Kahan sums */
  md_time step = tick * tempo - *rest, sum = *x + step;
  *rest = (sum - *x) - step, *x = sum;
}
static int whole_times(md_time x, md_real more, md_real y, md_real *share) {
  md_real times = (x + more) / y, n = rounded_down(times);
  *share = times - n;
  return (int)n;
}
#endif

/* exp x, for |x| < 10, in fixed point for x < 4 */
static md_real exponential(md_real x) {
  md_real part = x * (1.0f / 8.0f), power = 1.0f;
  for (int n = 10; n > 0; n--) power = 1.0f + share_of(part * power, n);
  for (int twice = 0; twice < 3; twice++) power *= power;
  return power;
}

MD_CALLED md_real within(md_real x, md_real size) { return least(most(x, -size), size); }

enum { RUNNING, BRAKING, LATCHED, HELD };           /* phases of the stop (stop_state.py) */
enum { BEFORE, LAST, NOW }; /* of the angles of a joint */
enum { STOPPING, MOVING, ARRIVING, FOLLOWING, HOLDING }; /* ways of the joints (run_phases.py) */

/* ---- the figure ---- */

static float float_at(const uint32_t *figure, int word) { return *(const float *)(const void *)(figure + word); }
#ifdef MD_FIXED
static md_real real_at(const uint32_t *figure, int word) { return md_real::of((int32_t)figure[word]); }
#else
static md_real real_at(const uint32_t *figure, int word) { return float_at(figure, word); }
#endif
static const md_motion *motion_row(const uint32_t *figure, int motion) {
  return (const md_motion *)(const void *)(figure + figure[MOTION_ROWS]) + motion;
}
static const EnvelopeLimits *limits_of(const uint32_t *figure) {
  return (const EnvelopeLimits *)(const void *)(figure + figure[LIMITS]);
}
static int motion_index(const md_player *p, const md_motion *m) { return (int)(m - motion_row(p->figure, 0)); }
MD_CALLED int next_on_way(const md_player *p, int from, int to) {
  return ((const uint8_t *)(p->figure + p->figure[WAYS]))[from * (int)p->figure[MOTIONS] + to];
}

/* CRC-32 over all words but the sum itself. */
static uint32_t sum_of(const uint32_t *figure) {
  uint32_t sum = 0xFFFFFFFFu;
  for (uint32_t word = 0; word < figure[WORDS]; word++) {
    if (word == CHECKSUM) continue;
    sum ^= figure[word];
    for (int bit = 0; bit < 32; bit++) sum = sum >> 1 ^ (sum & 1u ? 0xEDB88320u : 0u);
  }
  return ~sum;
}

int md_joints(const uint32_t *figure) { return (int)figure[JOINTS]; }
int md_motions(const uint32_t *figure) { return (int)figure[MOTIONS]; }
float md_rate(const uint32_t *figure) { return float_at(figure, TICK_RATE); }
const char *md_joint_name(const uint32_t *figure, int joint) {
  const char *name = (const char *)(figure + figure[NAMES]);
  while (joint) joint -= !*name++;
  return name;
}
const char *md_motion_name(const uint32_t *figure, int motion) {
  return (const char *)(figure + figure[NAMES]) + motion_row(figure, motion)->name;
}
int md_find(const uint32_t *figure, const char *name) {
  for (int motion = 0; motion < md_motions(figure); motion++) {
    const char *one = md_motion_name(figure, motion), *other = name;
    for (; *one && *one == *other; one++) other++;
    if (*one == *other) return motion;
  }
  return MD_E_MOTION;
}

#if MD_NETWORKS
/* 1 - cos x, and sin x, for |x| < 1 */
static md_real versine(md_real x) {
  md_real s = x * x;
  return s * (1.0f / 2.0f - s * (1.0f / 24.0f - s * (1.0f / 720.0f - s * (1.0f / 40320.0f))));
}
static md_real sine(md_real x) {
  md_real s = x * x;
  return x * (1.0f - s * (1.0f / 6.0f - s * (1.0f / 120.0f - s * (1.0f / 5040.0f - s * (1.0f / 362880.0f)))));
}
/* The centers at a frame, (cos, sin) each, and the exponent of a satellite's response there, by its linear form. */
static void turn_centers(const md_real *turns, int states, md_real frame, md_real *state) {
  for (int k = 0; k < states; k += 2) {
    md_real turn = frame * turns[k] + turns[k + 1], x = 1.57079633f * (turn - rounded(turn));
    md_real c = 1.0f - versine(x), s = sine(x), c2 = c * c - s * s, s2 = 2.0f * c * s;
    state[k] = c2 * c2 - s2 * s2, state[k + 1] = 2.0f * c2 * s2;
  }
}
static md_real exponent_at(const md_real *form, const md_real *state, int states) {
  md_real exponent = form[states];
  for (int k = 0; k < states; k += 2) exponent += form[k] * state[k] + form[k + 1] * state[k + 1];
  return exponent;
}
/* exp x, for |x| < 80, as `exponential`, but quicker */
static float response_of(float x) {
  int32_t twos = (int32_t)(x * 1.44269504f + copysignf(0.5f, x));
  float r = x - (float)twos * 0.693147181f, power;
  uint32_t bits = (uint32_t)(twos + 127) << 23;
  memcpy(&power, &bits, sizeof power);
  return power * (1.0f + r * (1.0f + r * (0.5f + r * (1.0f / 6.0f + r * (1.0f / 24.0f + r * (1.0f / 120.0f + r / 720.0f))))));
}
/* Angles of a frame, rad, of a network: centers turn, satellites respond to where they are (centralized.py). Its words: the
   centers, the satellites; of each center its turns in a frame and at the first; of each joint the rest and the unit of its
   weights; of each satellite the linear form of its exponent; then of each the weights of all joints, 16 bits each. */
static void evaluate(const md_player *p, const md_motion *m, int frame, md_real *angles) {
  const uint32_t *at = p->figure + m->keys;
  int centers = (int)at[0], satellites = (int)at[1], states = 2 * centers, joints = p->joints, width = (joints + 1) & ~1;
  const md_real *turns = (const md_real *)(const void *)(at + 2), *rest = turns + states;
  const md_real *form = rest + 2 * joints;
  const int16_t *weights = (const int16_t *)(const void *)(form + satellites * (states + 1));
  md_real state[2 * MOST_CENTERS];
  int32_t response[4]; /* of satellites that count, in 2^-20 */
  const int16_t *row[4];
  int64_t sum[MD_MOST_JOINTS];
  turn_centers(turns, states, (md_real)frame, state);
  memset(sum, 0, sizeof sum);
  for (int count = 0; satellites--; weights += width) {
    md_real exponent = exponent_at(form, state, states);
    form += states + 1;
    if (exponent >= LEAST_RESPONSE) response[count] = (int32_t)(1048576.0f * response_of(exponent)), row[count++] = weights;
    if (count < 4 && (satellites || !count)) continue;
    for (; count < 4; count++) response[count] = 0, row[count] = row[0];
    for (int j = 0; j < joints; j++)
      sum[j] += (int64_t)response[0] * row[0][j] + (int64_t)response[1] * row[1][j] + (int64_t)response[2] * row[2][j] +
                (int64_t)response[3] * row[3][j];
    count = 0;
  }
  for (int j = 0; j < joints; j++) angles[j] = rest[2 * j] + rest[2 * j + 1] / 256.0f * (md_real)(int32_t)(sum[j] >> 12);
}
#endif

/* Angles of a frame, rad: a uniform cubic B-spline through the keys (keys.py), or what a network has there. */
static void draw(const md_player *p, const md_motion *m, int frame, md_real *angles) {
  int count = (int)m->count, moving = (int)m->moving, width = (p->joints + 1) & ~1;
  frame = frame < moving ? frame : moving - 1;
#if MD_NETWORKS
  if (!count) {
    evaluate(p, m, frame, angles);
    return;
  }
#endif
  int keys = m->loop ? count : count - 3, frames = m->loop ? moving : moving - 1, first = (int)md_part((uint32_t)(frame * keys), (uint32_t)frames);
  first = first < keys ? first : keys - 1;
  md_real u = ratio(frame * keys - first * frames, frames), w = 1.0f - u;
  md_real before = w * w * w, third = 3.0f * u * (1.0f + u * w) + 1.0f, last = u * u * u;
  md_real weight[4] = {before, 6.0f - before - third - last, third, last}; /* of sum 6 */
  const int16_t *row[4];
  for (int k = 0; k < 4; k++) {
    int key = first + k < count ? first + k : first + k - count;
    row[k] = (const int16_t *)(p->figure + m->keys) + key * width;
    weight[k] *= m->unit;
  }
  int j = 0;
  do /* an instruction less in each turn */
    angles[j] = times_key(weight[0], row[0][j]) + times_key(weight[1], row[1][j]) + times_key(weight[2], row[2][j]) +
                times_key(weight[3], row[3][j]);
  while (++j < p->joints);
}

/* ---- one motion as it plays (frame_player.py, track.py) ---- */

/* A number of a frame or an anchor on a round of so many. */
MD_CALLED int around(int number, int many) {
  while (number < 0) number += many;
  while (number >= many) number -= many;
  return number;
}

/* Angles at an anchor, rad; a loop goes round, a one-shot is at rest before and after itself. */
MD_CALLED void draw_anchor(const md_player *p, const md_motion *m, int anchor, md_real *angles) {
  int anchors = (int)m->anchors;
  if (m->loop)
    anchor = around(anchor, anchors);
  else
    anchor = anchor < 0 ? 0 : anchor < anchors ? anchor : anchors - 1;
  draw(p, m, anchor * (int)m->stride, angles);
}

static int after(const md_motion *m, int frame) {
  int last = (int)m->frames - 1;
  return frame < last ? frame + 1 : m->loop ? 0 : last;
}
static int preceding(const md_motion *m, int frame) { return frame > 0 ? frame - 1 : m->loop ? (int)m->frames - 1 : 0; }

/* The row of a frame by its place in time. */
static int row_at(const md_track *t, int place) { return (t->forwards ? t->oldest + place : t->oldest - place) & 3; }
static int onward(const md_track *t, int frame) {
  return t->forwards ? after(t->motion, frame) : preceding(t->motion, frame);
}
static void take(const md_player *p, md_track *t, int place, int frame) {
  int row = row_at(t, place);
  t->index[row] = frame;
  draw(p, t->motion, frame, t->frame[row]);
}
static void take_from(const md_player *p, md_track *t, int place) {
  for (; place < 4; place++) take(p, t, place, onward(t, t->index[row_at(t, place - 1)]));
}
MD_CALLED void begin_at(const md_player *p, md_track *t, const md_motion *m, int frame) {
  t->motion = m, t->fraction = 0.0f, t->forwards = 1, t->backwards = t->oldest = 0;
  t->first = 0.0f, t->last = m->seconds;
  take(p, t, 0, frame);
}

static void enter_phase(const md_player *p, md_track *t, const md_motion *m, md_real phase) {
  int frame = nearest_times(phase, (int)m->steps);
  if (m->loop) frame = around(frame, (int)m->frames);
  begin_at(p, t, m, preceding(m, frame));
  if (t->index[0] == frame) { /* no frame comes before the first of a one-shot */
    take(p, t, 1, frame);
    take_from(p, t, 2);
    for (int j = 0; j < p->joints; j++) t->frame[0][j] = 2.0f * t->frame[1][j] - t->frame[2][j];
  } else {
    take_from(p, t, 1);
  }
  t->at = least(m->whole * phase, m->seconds);
}

static void enter_anchor(const md_player *p, md_track *t, const md_motion *m, int anchor) {
  if (anchor == 0) {
    enter_phase(p, t, m, 0.0f);
  } else {
    begin_at(p, t, m, anchor * (int)m->stride);
    take_from(p, t, 1);
  }
  t->at = times(m->spacing, anchor);
  if (m->loop) t->first = t->at - m->seconds, t->last = t->at + m->seconds;
}

static void turn_round(const md_player *p, md_track *t) {
  t->oldest = row_at(t, 3);
  t->forwards = !t->forwards;
  t->fraction = 1.0f - t->fraction;
  int towards = t->index[row_at(t, 2)], end = (int)t->motion->steps;
  take(p, t, 3, onward(t, towards < end ? towards : end));
}

static md_real phase_of(const md_track *t, int place) {
  md_real phase = ratio(t->index[row_at(t, place)], (int)t->motion->steps);
  return phase < 1.0f ? phase : 1.0f;
}

/* Goes on by a tick or none, and notes the angles there. */
static void step_track(const md_player *p, md_track *t, int ticks, md_real tempo) {
  md_real shift = ticks ? tempo : 0.0f;
  md_time round = t->motion->seconds, two = round + round;
  pass(&t->at, &t->rest, p->tick_time, shift);
  if (!t->motion->loop) {
    t->at = bounded(t->at, t->first, t->last);
  } else if (fabsf(t->at) > two) {
    if (t->at > round) round = -round;
    t->at += round;
    if (fabsf(t->last + round) <= two) t->first += round, t->last += round; /* else it has long gone round */
  }
  t->backwards = tempo < 0.0f || (tempo == 0.0f && t->backwards);

  if (shift != 0.0f && (shift > 0.0f) != t->forwards) turn_round(p, t);
  t->fraction += fabsf(shift) * real_at(p->figure, FRAMES_A_TICK);
  for (; t->fraction >= 1.0f; t->fraction -= 1.0f) {
    t->oldest = row_at(t, 1);
    take_from(p, t, 3);
  }
  md_real u = t->fraction, uu = u * u, uuu = uu * u;
  md_real weight[4] = {0.5f * (2.0f * uu - u - uuu), 1.0f + 0.5f * (3.0f * uuu - 5.0f * uu),
                     0.5f * (u + 4.0f * uu - 3.0f * uuu), 0.5f * (uuu - uu)};
  const md_real *row[4];
  for (int k = 0; k < 4; k++) row[k] = t->frame[row_at(t, k)];
  for (int j = 0; j < p->joints; j++) {
    t->before[j] = t->now[j];
    t->now[j] = weight[0] * row[0][j] + weight[1] * row[1][j] + weight[2] * row[2][j] + weight[3] * row[3][j];
  }
}

static int has_ended(const md_track *t) {
  return t->backwards ? t->at <= t->first + SOON : t->at >= t->last - SOON;
}

MD_CALLED void finish_round(md_track *t) {
  md_time seconds = t->motion->seconds, at = t->at + SOON;
  if (!t->motion->loop) return;
  while (t->last <= at) t->last += seconds;
  while (t->last - seconds > at) t->last -= seconds;
  t->first = t->last - seconds;
}

/* ---- where a motion is entered (transition.entry_costs) ---- */


/* The end of a joint's bone is LEVER away, m: its way across as the joint turns by some rad. */
static md_real way_of(md_real turn) {
  md_real s = turn * turn * (1.0f / (LEVER * LEVER));
  return turn * (1.0f - s * (1.0f / 6.0f - s * (1.0f / 120.0f - s * (1.0f / 5040.0f - s * (1.0f / 362880.0f)))));
}
/* The straight way to an end that is turned by some rad, signed, and its square. */
MD_CALLED md_real chord(md_real turn) { return 2.0f * way_of(0.5f * turn); }
static md_wide square_of(md_real turn) {
  md_real way = chord(turn);
  return product(way, way);
}

/* How many anchors of a motion are compared: some all over it, then those about the best of these. */
static int compared(const md_motion *m) { return ((int)m->entries + COARSE - 1) / COARSE + 2 * (COARSE - 1); }

MD_CALLED void compare(md_player *p, const md_motion *m, int anchor) {
  md_real back[MD_MOST_JOINTS], here[MD_MOST_JOINTS], next[MD_MOST_JOINTS];
  md_wide cost = NEXT_TO_NONE;
  int sides = m->loop || (anchor > 0 && anchor < (int)m->anchors - 1) ? 2 : 1;
  md_real reach = VELOCITY_REACH / times(m->spacing, sides), ahead = p->dt * (1.0f / VELOCITY_REACH);
  draw_anchor(p, m, anchor - 1, back);
  draw_anchor(p, m, anchor, here);
  draw_anchor(p, m, anchor + 1, next);
  for (int j = 0; j < p->joints && cost < p->entry_cost; j++) {
    md_real own = chord(next[j] - back[j]) * reach, from = p->joint[j].entered_from, shown = p->joint[j].entered_reach;
    md_real apart = 0.5f * (next[j] + back[j] + ahead * shown) - from, faster = own - shown;
    md_real aside = (md_real)square_of(apart) * (1.0f / (LEVER * LEVER));
    cost += square_of(here[j] - from) + product(faster, faster) + product(own, shown * aside);
  }
  if (cost < p->entry_cost) p->entry_cost = clearly_less(cost), p->entry = anchor;
}

/* Begins to look where a motion is most like what was shown NOW, or LAST. */
static void seek_entry(md_player *p, int motion, int moment) {
  md_real reach = VELOCITY_REACH / p->dt;
  p->entering = motion, p->compared = 0, p->entry_cost = DEAREST, p->entry = 0, p->adding = 0;
  for (md_joint *j = p->joint; j < p->joint + p->joints; j++) {
    j->entered_from = j->angle[moment];
    j->entered_reach = chord(j->angle[moment] - j->angle[moment - 1]) * reach;
  }
}

/* Compares as many anchors as a tick allows; whether they all have been compared. */
static int search_entry(md_player *p) {
  const md_motion *m = motion_row(p->figure, p->entering);
  int entries = (int)m->entries, first = compared(m) - 2 * (COARSE - 1);
  for (int most = (int)m->searched; most && p->compared < compared(m); most--, p->compared++) {
    int anchor = p->compared * COARSE, nth = p->compared - first;
    if (nth == 0) p->coarse = p->entry;
    if (nth >= 0) anchor = p->coarse + nth + (nth < COARSE - 1 ? 1 - COARSE : 2 - COARSE);
    if (m->loop) anchor = around(anchor, entries);
    if (anchor >= 0 && anchor < entries) compare(p, m, anchor);
  }
  return p->compared == compared(m);
}

/* Enters the motion where that was, and as much further on as the search took. */
static void enter_found(const md_player *p, md_track *t) {
  const md_motion *m = motion_row(p->figure, p->entering);
  int late = (int)md_part((uint32_t)(compared(m) - 1), m->searched) + 1, anchors = (int)m->anchors;
  md_real spacing = m->spacing, left;
  int carried = m->loop ? whole_times(0.0f, times(p->dt, late) * p->tempo + CARRIED * spacing, spacing, &left) : 0;
  enter_anchor(p, t, m, around(p->entry + carried, anchors));
}

/* ---- fades (quintic.py, transition.Fade, fade_search.py) ---- */

typedef struct {
  md_real value, slope;     /* what is left of a difference in place, and of the way on which its rate leads, s */
  md_real leaving, turning; /* the rates of both */
} Shares;

/* From 0 at 0 to 1 at 1, at rest there: a quintic. */
static md_real smooth(md_real s) { return s * s * s * (10.0f + s * (6.0f * s - 15.0f)); }

static const md_fade shortest = {SHORTEST, SHORTEST};

static Shares left_of(const md_fade *fade, md_real elapsed) {
  md_real s = least(elapsed / fade->duration, 1.0f), r = least(elapsed / fade->slowing, 1.0f), turn = s - s * s, rr = r * r;
  Shares left = {1.0f - smooth(s), fade->slowing * (r + rr * r * (-6.0f + r * (8.0f - 3.0f * r))), -30.0f * turn * turn / fade->duration,
                 1.0f + rr * (-18.0f + r * (32.0f - 15.0f * r))};
  return left;
}
/* What is left of a difference, and how fast that changes. */
MD_CALLED md_real rest_of(const Shares *left, const md_difference *d) { return left->value * d->value + left->slope * d->rate; }
MD_CALLED md_real change_of(const Shares *left, const md_difference *d) { return left->leaving * d->value + left->turning * d->rate; }

/* The share of an acceleration that changes have in some ticks by their square. */
MD_CALLED md_real hardness(md_wide square, md_real seconds, md_real acceleration) {
  md_real hard = HARD * seconds;
  return sqrtf(square) / hard / hard / acceleration;
}

/* Ends the trial of the candidate, and names the fade to go on with (FadeSearch._try). */
static void end_trial(md_player *p, md_real step, const md_fade **next) {
  static const md_real slowed_within[3] = {1.0f, 0.5f, 0.25f};
  const md_fade *fade = &p->candidate;
  if (p->already == 0.0f) p->already = sqrtf(p->first) / step;
  md_real speed = sqrtf(p->fastest) / step / most(p->bound.speed, p->already), duration;
  /* The use of the bounds; 1 is the limit. */
  md_real use = most(hardness(p->hardest, step, p->bound.acceleration), speed * speed);
  int better = use <= p->least /* as large uses are alike in fixed point */, whole = fade->slowing == fade->duration, exhausted;
  p->moment = 0;
  if (++p->trials == 1) p->hasty = p->already > p->bound.speed;
  if (better) p->best = *fade, p->least = use;
  p->rises = use > ALL_BUT * p->last ? p->rises + 1 : 0;
  p->last = use;
  exhausted = fade->duration >= LONGEST || p->rises == 2;
  if (exhausted)
    p->slowed++, duration = p->best.duration, p->last = DEAREST, p->rises = 0;
  else
    duration = least(LONGEST, fade->duration * most(LONGER, sqrtf(use)));
  md_real allowed = ALL_BUT + times(YIELDING, p->trials > PATIENT_TRIALS ? p->trials - PATIENT_TRIALS : 0);
  p->found = p->least <= allowed || p->slowed == 3;
  *next = &p->best;
  if (p->found) return;
  p->candidate.duration = duration;
  p->candidate.slowing = slowed_within[p->hasty ? 2 - p->slowed : p->slowed] * duration;
  if (better && !exhausted && whole) *next = &p->candidate;
}

/* What a vector is beyond an earlier one that has turned on. */
static md_vector beyond(md_vector now, md_vector before, md_real cosine, md_real sine) {
  md_vector rest = {now.x - cosine * before.x - sine * before.y, now.y - cosine * before.y + sine * before.x};
  return rest;
}
static md_wide square(md_vector v) { return product(v.x, v.x) + product(v.y, v.y); }

/* Weighs the next moment of the candidate: how fast joints are, and how much accelerated beyond their target. */
static void weigh(md_player *p, const md_fade **next) {
  const md_motion *m = p->track->motion;
  const md_fade *fade = &p->candidate;
  int moments = nearest(MOMENTS * fade->duration / fade->slowing), k = p->moment;
  md_real step = share_of(fade->duration, moments), time = times(step, k), way = ratio(k, moments);
  md_real low[MD_MOST_JOINTS], high[MD_MOST_JOINTS]; /* angles at the anchors around the moment */
  md_real risen = (1.0f - p->onset) * way * way;
  md_real share;
  int near = whole_times(p->course_at, p->course_tempo * time * (p->onset + risen * (1.0f / 3.0f)), m->spacing, &share);
  Shares left = left_of(fade, time);
  draw_anchor(p, m, near, low);
  draw_anchor(p, m, near + 1, high);
  if (k == 0) p->fastest = p->hardest = 0.0f;
  md_wide hardest = p->hardest, fastest = p->fastest;
  md_real short_by = 0.5f * share * (1.0f - share) * PER_LEVER * PER_LEVER;
  for (int j = 0; j < p->joints; j++) {
    /* The bone, between those of two anchors, and the turn by what is left of the difference. Vectors turn with it. */
    md_joint *joint = p->joint + j;
    md_bone *bone = &joint->bone;
    md_real way_on = high[j] - low[j], length = 1.0f - short_by * way_on * way_on, both = length * bone->length;
    md_real angle = low[j] + share * way_on, turn = left.value * joint->whole.value + left.slope * joint->whole.rate;
    md_real turned = turn * PER_LEVER, ss = turned * turned;
    /* LEVER times its cosine less 1, and its sine, as far as decisions ask for them. */
    md_vector away = {-length * turn * turned * (1.0f / 2.0f - ss * (1.0f / 24.0f - ss * (1.0f / 720.0f))), length * way_of(turn)};
    if (k > 0) {
      md_real on = angle - bone->angle, moved = on + turn - bone->turn, longer = LEVER * (length - bone->length);
      md_real back = on * PER_LEVER, s = back * back, ahead = moved * PER_LEVER, a = ahead * ahead;
      md_real cosine = 1.0f - s * (0.5f - s * (1.0f / 24.0f)), sine = back * (1.0f - s * (1.0f / 6.0f));
      md_vector rise = beyond(away, bone->away, cosine, sine);
      /* both times the square of the chord */
      fastest = most(fastest, product(longer, longer) + product(both * moved, moved * (1.0f - a * (1.0f / 12.0f - a * (1.0f / 360.0f)))));
      if (k > 1) hardest = most(hardest, square(beyond(rise, bone->rise, cosine, sine)));
      bone->rise = rise;
    }
    bone->angle = angle, bone->turn = turn, bone->length = length, bone->away = away;
  }
  p->fastest = fastest;
  p->hardest = hardest;
  if (k == 1) p->first = p->fastest;
  if (p->moment++ == moments) end_trial(p, step, next);
}

/* Goes over to another fade; the gap between both runs out in turn (Fading._go_over_to). */
static void go_over_to(md_player *p, const md_fade *fade) {
  if (fade->duration == p->fade.duration && fade->slowing == p->fade.slowing) return;
  Shares was = left_of(&p->fade, p->elapsed), is = left_of(fade, p->elapsed), ending = left_of(&shortest, p->gap_elapsed);
  Shares more = {was.value - is.value, was.slope - is.slope, was.leaving - is.leaving, was.turning - is.turning};
  for (md_joint *j = p->joint; j < p->joint + p->joints; j++) {
    md_difference gap = {rest_of(&more, &j->whole), change_of(&more, &j->whole)};
    if (p->has_gap) gap.value += rest_of(&ending, &j->gap), gap.rate += change_of(&ending, &j->gap);
    j->gap = gap;
  }
  p->fade = *fade, p->has_gap = 1, p->gap_elapsed = 0.0f;
}

static void advance_fade(md_player *p) {
  const md_fade *fade = &p->fade;
  for (int most = p->entering == NONE ? ((int)p->track->motion->searched + 2) / 2 : 0; most && !p->found; most--) weigh(p, &fade);
  if (p->elapsed > 0.0f)
    go_over_to(p, fade);
  else
    p->fade = *fade;
  p->elapsed += p->dt, p->gap_elapsed += p->dt;
  if (p->gap_elapsed >= SHORTEST - SOON) p->has_gap = 0;
}

/* Starts the fade of the difference from the target of the track to what is shown. */
static void begin_fade(md_player *p, md_real onset, md_bounds bounds) {
  const md_track *t = p->track;
  for (int k = 0; k < p->joints; k++) {
    md_joint *j = p->joint + k;
    j->whole.value = j->angle[NOW] - t->now[k];
    j->whole.rate = (j->whole.value - (j->angle[LAST] - t->before[k])) / p->dt;
  }
  p->fade = p->candidate = p->best = shortest;
  p->fading = 1, p->found = p->has_gap = p->slowed = 0, p->trials = p->rises = p->moment = 0;
  p->elapsed = p->gap_elapsed = p->already = 0.0f;
  p->least = p->last = DEAREST, p->onset = onset;
  md_real faster = most(1.0f, fabsf(p->tempo));
  p->bound.speed = PLANNED_SHARE * FASTEST * faster * bounds.speed;
  p->bound.acceleration = PLANNED_SHARE * faster * faster * bounds.acceleration;
  p->course_at = t->at, p->course_tempo = p->tempo;
}

/* The share of the tempo at which the motion plays: a one-shot starts slowly as it fades in. */
static md_real onset_of(const md_player *p) {
  if (!p->fading || p->track->motion->loop) return 1.0f;
  md_real progress = least(1.0f, p->elapsed / p->fade.duration);
  return p->onset + (1.0f - p->onset) * progress * progress;
}

/* ---- joins (performance.py, join_limits.py) ---- */

/* The larger ones of both. */
MD_CALLED md_bounds wider(md_bounds one, md_bounds other) {
  md_bounds both = {most(one.speed, other.speed), most(one.acceleration, other.acceleration)};
  return both;
}

static void limit_join(md_player *p, md_bounds bounds) {
  md_bounds join = p->limited ? wider(p->own, bounds) : bounds;
  if (!p->limited) p->weight_pace = 1.0f;
  p->join.speed = FASTEST * join.speed, p->join.acceleration = HARDEST * join.acceleration;
  p->own = bounds, p->limited = 1, p->correct_from = CORRECTED_FROM;
}

/* The way to an end that is turned by little, across and along. */
static md_vector short_way(md_real turn) {
  md_real square = turn * turn, sixth = square * (PER_LEVER * PER_LEVER / 6.0f);
  md_vector way = {turn - turn * sixth, (0.5f * PER_LEVER) * (square - 0.5f * sixth * square)};
  return way;
}

/* The use of the limits of the join by what is shown; 1 is the limit. */
static md_real use_of_limits(const md_player *p) {
  md_real fastest = 0.0f;
  md_wide hardest = 0.0f;
  for (const md_joint *j = p->joint; j < p->joint + p->joints; j++) {
    md_real now = j->angle[NOW] - j->angle[LAST], then = j->angle[LAST] - j->angle[BEFORE];
    md_vector on = short_way(now), before = short_way(then), change = {on.x - before.x, on.y + before.y};
    fastest = most(fastest, fabsf(now)), hardest = most(hardest, square(change));
  }
  md_real faster = most(1.0f, fabsf(p->tempo));
  return most(chord(fastest) / (faster * p->join.speed * p->dt), hardness(hardest, p->dt * faster, p->join.acceleration));
}

/* Limits the join with what plays now within some bounds, and fades to it. */
static void fade_to(md_player *p, md_bounds bounds) {
  md_real onset = 1.0f;
  if (!p->track->motion->loop) onset = 0.0f;
  limit_join(p, bounds);
  step_track(p, p->track, 0, onset * p->tempo); /* its first two postures: a fade needs a rate of change */
  step_track(p, p->track, 1, onset * p->tempo);
  begin_fade(p, onset, bounds);
}

/* ---- blends (playing_tracks.py, blend_weight.py, deck_motions.py) ---- */

/* The place of a motion among those that play, or NONE. */
static int place_of(const md_player *p, int motion) {
  int place = p->blended;
  while (place >= 0 && motion_index(p, p->track[place].motion) != motion) place--;
  return place;
}
static void play_alone(md_player *p) { p->blended = 0, p->crossing = 0; }

/* Steps the motions of a blend, which stay in step, and shows their mean. */
static void step_blend(md_player *p) {
  md_real change, common = 0.0f, own[MD_MOST_BLENDED];
  p->weighed += p->dt * p->weight_pace;
  p->crossing = p->weighed < p->weighing - SOON;
  change = p->crossing ? p->weighed / p->weighing : 1.0f;
  change = smooth(change);
  for (int k = 0; k <= p->blended; k++) {
    p->track[k].weight = (1.0f - change) * p->track[k].weight_from + change * p->track[k].weight_to;
    own[k] = p->track[k].lasts / p->track->lasts;
    md_real z = (own[k] - 1.0f) / (own[k] + 1.0f), log = 0.0f; /* ln x = 2 artanh z */
    for (int n = 11; n > 0; n -= 2) log = share_of(1.0f, n) + z * z * log;
    common += 2.0f * p->track[k].weight * z * log;
  }
  common = exponential(-common);
  for (int k = 0; k <= p->blended; k++) {
    md_track *t = p->track + k;
    step_track(p, t, 1, p->tempo * (common * own[k]));
    for (int j = 0; j < p->joints; j++) {
      md_real *shown = p->joint[j].angle + NOW, part = p->track[k].weight * t->now[j];
      *shown = k ? *shown + part : part;
    }
  }
}

enum { FINE, STANDS_STILL, OVER };

/* What is wrong with the blend (BlendCheck.problem). */
static uint8_t problem_of(md_player *p) {
  md_real least_way = FARTHEST, fastest = 0.0f, moved = 0.0f, way = 0.0f, passed = p->dt * fabsf(p->tempo);
  for (int k = 0; k <= p->blended; k++) {
    least_way = least(least_way, STILL * p->track[k].motion->extent);
    fastest = most(fastest, TURNS_OVER * p->track[k].motion->pace);
  }
  for (md_joint *j = p->joint; j < p->joint + p->joints; j++) {
    md_real place = way_of(j->angle[NOW]);
    moved = most(moved, fabsf(place - j->place)), j->place = place;
    if (p->watched <= 0.0f) j->low = j->high = place;
    j->low = least(j->low, place), j->high = most(j->high, place);
    way = most(way, j->high - j->low);
  }
  int known = p->watched >= 0.0f;
  p->watched = most(p->watched, 0.0f);
  if (known && moved > fastest * most(p->dt, passed)) return OVER;
  p->watched += passed;
  if (p->watched < 0.5f - SOON) return FINE;
  p->watched = 0.0f;
  return way < least_way ? STANDS_STILL : FINE;
}

/* Has the weights go to those of the plan, others to 0; a change by 1 takes a second. */
static void change_weights(md_player *p) {
  md_real change = 0.0f;
  for (int k = 0; k <= p->blended; k++) {
    int motion = motion_index(p, p->track[k].motion);
    p->track[k].weight_from = p->track[k].weight;
    p->track[k].weight_to = motion == p->with ? p->share : motion == p->going_to ? 1.0f - p->share : 0.0f;
    change = most(change, fabsf(p->track[k].weight_to - p->track[k].weight_from));
  }
  p->weighed = 0.0f, p->weighing = change, p->crossing = change > SOON;
}

static void limit_blend(md_player *p) {
  md_bounds bounds = p->track->motion->bounds;
  for (int k = 1; k <= p->blended; k++) bounds = wider(bounds, p->track[k].motion->bounds);
  limit_join(p, bounds);
}

/* Adds the motion that was sought, with a weight of 0 so far. */
static void add_motion(md_player *p) {
  md_track *t = p->track + p->blended + 1;
  md_real first = p->track->motion->seconds, other;
  if (!p->blended) p->track->weight = 1.0f, p->track->lasts = first;
  p->track[++p->blended].weight = 0.0f, p->watched = -1.0f;
  enter_found(p, t);
  step_track(p, t, 0, p->tempo);
  other = t->motion->seconds; /* the shorter goes round a whole number of times while the longer does */
  t->lasts = p->track->lasts / first * other * (first < other ? 1.0f / rounded(other / first) : rounded(first / other));
}

/* Begins the blend of the plan, or looks first where the motion that is not playing yet is entered. */
static void begin_blend(md_player *p) {
  int added = place_of(p, p->going_to) == NONE ? p->going_to : place_of(p, p->with) == NONE ? p->with : NONE;
  p->blending = 1, p->blending_to = p->going_to;
  if (added == NONE) {
    limit_blend(p);
    change_weights(p);
  } else {
    seek_entry(p, added, LAST);
    p->adding = 1;
  }
}

static void move_track(md_player *p, int from, int to) {
  if (from == to) return;
  copy(p->track + to, p->track + from, sizeof *p->track);
  p->track[from].weight = 0.0f;
}

/* Drops the motions whose weight has become 0; where the first one is dropped, that of the switch leads, or the next. */
static void drop_weightless(md_player *p) {
  int kept = 0, lead = place_of(p, p->blending_to);
  if (p->track->weight == 0.0f) {
    if (lead == NONE || p->track[lead].weight == 0.0f)
      for (lead = 0; p->track[lead].weight == 0.0f;) lead++;
    move_track(p, lead, 0);
  }
  for (int k = 0; k <= p->blended; k++)
    if (p->track[k].weight != 0.0f) move_track(p, k, kept++);
  if (kept <= p->blended) p->watched = -1.0f;
  p->blended = kept - 1;
  for (int k = 0; k < kept; k++) p->track[k].weight_from = p->track[k].weight_to = p->track[k].weight;
}

/* Gives the blend up for the motion that the next one goes on with, or has most weight, and fades to that where it is. */
static void give_up_blend(md_player *p) {
  int nearest = 0;
  for (int k = 1; k <= p->blended; k++)
    if (p->track[k].weight > p->track[nearest].weight) nearest = k;
  if (p->entering != NONE && p->adding) nearest = place_of(p, p->entering == p->with ? p->going_to : p->with);
  md_bounds bounds = wider(p->track->motion->bounds, p->track[nearest].motion->bounds);
  limit_join(p, bounds);
  move_track(p, nearest, 0);
  play_alone(p);
  begin_fade(p, 1.0f, bounds);
  if (p->entering != NONE) return;
  p->going_to = md_playing(p), p->with = NONE, p->current = p->fade_of_switch = p->waits = 1, p->blending = 0;
}

/* ---- switches and jumps (performance.py) ---- */

static void switch_to_found(md_player *p) {
  md_bounds bounds = wider(p->track->motion->bounds, motion_row(p->figure, p->entering)->bounds);
  play_alone(p);
  enter_found(p, p->track);
  fade_to(p, bounds);
}

static void jump_to(md_player *p, md_real phase) {
  const md_motion *m = p->track->motion;
  enter_phase(p, p->track, m, phase);
  fade_to(p, m->bounds);
}

static void show_extrapolated(md_player *p) {
  for (md_joint *j = p->joint; j < p->joint + p->joints; j++) j->angle[NOW] = 2.0f * j->angle[LAST] - j->angle[BEFORE];
}

MD_CALLED void show_track(md_player *p) {
  for (int j = 0; j < p->joints; j++) p->joint[j].angle[NOW] = p->track->now[j];
}

/* Goes a tick on; whether a fade has been completed with it. */
MD_CALLED int perform(md_player *p) {
  int completed = 0;
  if (BLENDS && p->blended) {
    step_blend(p);
  } else {
    step_track(p, p->track, 1, p->tempo * onset_of(p));
    show_track(p);
  }
  p->problem = FINE;
  if (BLENDS && p->blended) p->problem = problem_of(p);
  if (p->fading) {
    advance_fade(p);
    if (p->elapsed < p->fade.duration - SOON || p->has_gap) {
      Shares left = left_of(&p->fade, p->elapsed), gap = left_of(&shortest, p->gap_elapsed);
      for (md_joint *j = p->joint; j < p->joint + p->joints; j++) {
        j->angle[NOW] += rest_of(&left, &j->whole);
        if (p->has_gap) j->angle[NOW] += rest_of(&gap, &j->gap);
      }
    } else {
      p->fading = 0, completed = 1;
    }
  }
  if (p->limited) {
    md_real use = use_of_limits(p);
    if (BLENDS && p->crossing) {
      md_real wanted = bounded(1.0f - (use - EASED_FROM) / (EASED_TO - EASED_FROM), SLOWEST, 1.0f);
      p->weight_pace += (wanted - p->weight_pace) * least(1.0f, p->dt / EASING_SECONDS);
    }
    if (BLENDS && p->blended) {
      if (use > BLEND_TURNS_OVER) p->problem = OVER;
    } else if (use > p->correct_from && !(p->fading && !p->found)) {
      md_real onset = onset_of(p);
      p->correct_from = use + CORRECTED_AGAIN;
      show_extrapolated(p);
      begin_fade(p, onset, p->track->motion->bounds);
    }
  }
  if (BLENDS && p->problem == OVER) show_extrapolated(p);
  return completed;
}

/* ---- the plan (switch_plan.py, tempo.py, deck.py) ---- */

static int apart(const md_player *p, int one, int other) { return next_on_way(p, one, other) != other; }

/* Whether what plays goes on in the motion, or the blend of two, that is commanded. */
static int goes_on(md_player *p, int to, int with) {
  if (!BLENDS || !p->blended) return motion_index(p, p->track->motion) == to;
  int known = (place_of(p, to) != NONE) + (place_of(p, with) != NONE), added = place_of(p, to) == NONE ? to : with;
  if (with == NONE || !known || p->blended + 3 - known > MD_MOST_BLENDED) return 0;
  for (int k = 0; known < 2 && k <= p->blended; k++) {
    int other = motion_index(p, p->track[k].motion);
    if (apart(p, added, other) || apart(p, other, added)) return 0;
  }
  return 1;
}

/* Starts a switch to a motion, and then to its blend with another, if not NONE, that gets the share of the plan. */
static void start_switch(md_player *p, int to, int direct, int with) {
  const md_motion *here = p->track->motion;
  p->going_to = to, p->with = with, p->current = 1, p->fade_of_switch = 0, p->entering = NONE;
  if (p->blending) p->blending = 2; /* for a switch that was overtaken */
  if (here->loop && goes_on(p, to, with)) {
    if (!BLENDS || with == NONE)
      p->current = 0;
    else if (p->fading)
      p->fade_of_switch = 1;
    else
      begin_blend(p);
    return;
  }
  p->ahead = direct ? to : next_on_way(p, motion_index(p, here), to);
  p->waits = !direct && !here->loop && !has_ended(p->track);
}

static void take_next(md_player *p) {
  int over = has_ended(p->track) && !p->fading && p->entering == NONE && !p->crossing;
  if (!p->current && p->queued && over) {
    int to = p->queue[0];
    copy(p->queue, p->queue + 1, (size_t)--p->queued);
    start_switch(p, to, 0, NONE);
  }
  if (p->ahead != NONE && (over || !p->waits)) {
    int motion = p->ahead;
    p->ahead = motion == p->going_to ? NONE : next_on_way(p, motion, p->going_to);
    p->waits = 1, p->fade_of_switch = p->current, p->blending = 0;
    seek_entry(p, motion, NOW);
  } else if (p->entering != NONE) {
    if (search_entry(p)) {
      if (BLENDS && p->adding) {
        add_motion(p);
        limit_blend(p);
        change_weights(p);
      } else {
        switch_to_found(p);
      }
      p->entering = NONE;
    }
  } else if (p->jump >= 0.0f) {
    jump_to(p, p->jump);
  }
  p->jump = -1.0f;
}

/* ---- a lock to beats (beat_clock.py, references.Beats, phase_lock.py) ---- */

MD_CALLED int captured(md_real interval) { return interval >= (1.0f - SLACK) * SHORTEST_BEAT && interval <= (1.0f + SLACK) * LONGEST_BEAT; }

MD_CALLED void begin_beats(md_beats *b, md_real ago) {
  b->last = ago, b->counted = 1, b->strays = b->was_stray = b->steady = 0;
}

static void second_beat(md_beats *b, md_real ago) {
  md_real since = b->last - ago;
  if (captured(since))
    b->period = bounded(since, SHORTEST_BEAT, LONGEST_BEAT), b->last = ago, b->counted = 2;
  else if (since > LONGEST_BEAT)
    begin_beats(b, ago);
}

/* Whether the latest three intervals are alike and no whole number of periods. */
static int another_tempo(md_beats *b, md_real interval) {
  md_real whole = most(rounded(interval / b->period), 1.0f);
  int off = fabsf(interval - whole * b->period) > 0.20013f * b->period;
  int alike = fabsf(interval - b->interval) < 0.10013f * interval;
  b->steady = off && alike ? b->steady + 1 : 0;
  b->interval = interval;
  return b->steady > 1 && captured(interval);
}

MD_CALLED void take_beat(md_beats *b, md_real ago, md_real dt) {
  md_real passed = times(dt, b->ticks), before = b->before + passed, since;
  b->ticks = 0, b->last += passed, since = b->last - ago;
  b->before = ago;
  if (!b->counted) {
    begin_beats(b, ago);
    return;
  }
  if (b->counted == 1 || b->period == 0.0f) {
    second_beat(b, ago);
    return;
  }
  md_real periods = rounded(since / b->period), error = since - periods * b->period;
  if (periods > 8.0f) {
    begin_beats(b, ago);
    return;
  }
  int anew = another_tempo(b, before - ago);
  if (!anew && (periods < 1.0f || fabsf(error) > 0.30013f * b->period)) {
    b->was_stray = 1;
    b->strays += captured(before - ago);
    anew = b->strays > 1;
  } else if (!anew) {
    int k = b->counted < 7 ? b->counted : 7, both = (k + 1) * (k + 2); /* the gains are constant from then on */
    md_real gain = most(0.51f, ratio(4 * k + 2, both)), period_gain = most(0.09f, ratio(6, both));
    b->last = ago + (1.0f - gain) * error;
    b->period = bounded(b->period + period_gain * error / periods, SHORTEST_BEAT, LONGEST_BEAT);
    b->counted++;
    b->strays = b->was_stray ? b->strays : 0, b->was_stray = 0;
  }
  if (anew) {
    begin_beats(b, before);
    second_beat(b, ago);
  }
}

static md_real in_direction(md_real tempo, md_real reference) {
  return reference >= 0.0f ? bounded(tempo, 0.0f, 3.0f) : bounded(tempo, -3.0f, 0.0f);
}

static md_real phase_now(const md_player *p) {
  const md_track *t = p->track;
  md_real before = phase_of(t, 1), way = phase_of(t, 2) - before;
  way -= rounded(way);
  md_real phase = before + t->fraction * way;
  return way != 0.0f ? phase - rounded_down(phase) * (md_real)(phase < 0.0f || phase > 1.0f) : phase;
}

/* The tempo that keeps step with the beat; far off, a jump. */
static md_real steered_tempo(md_player *p) {
  md_beats *b = &p->beats;
  const md_motion *m = p->track->motion;
  if (b->period == 0.0f || !m->loop) return p->commanded_tempo;
  md_real seconds = m->seconds, beats = seconds / b->period, off = share_of(beats, b->chosen ? b->chosen : 1);
  if (!b->chosen || off > 1.6817928f || off < 0.59460356f)
    for (b->chosen = 1; b->chosen < 16 && beats > times(1.4142135f, b->chosen);) b->chosen *= 2;
  int steps = b->steps ? b->steps : b->chosen;
  md_real tempo = share_of(beats, steps), behind = b->phase + share_of((b->last + times(p->dt, b->ticks)) / b->period, steps) - phase_now(p);
  md_real error = (behind - share_of(rounded(times(behind, steps)), steps)) * seconds, size = fabsf(error);
  if (size > 0.8f && !p->current && !p->fading && !p->paused && !p->blended) {
    md_real to = phase_now(p) + error / seconds;
    p->jump = to - rounded_down(to);
    return in_direction(tempo, tempo);
  }
  md_real brake_rate = 0.8f * TEMPO_RATE, linear = brake_rate / 25.0f; /* 5 per s for small errors */
  md_real speed = size <= linear ? 5.0f * size : sqrtf(2.0f * brake_rate * (size - 0.5f * linear));
  return in_direction(tempo + copysignf(least(speed, 1.0f), error), tempo);
}

/* A tick later. A beat that is long ago is as well as one by so many rounds later. */
MD_CALLED void keep_time(md_beats *b, md_real dt) {
  int beats = b->steps ? b->steps : 16;
  md_real passed = times(dt, ++b->ticks);
  if (passed < 1.0f) return;
  b->ticks = 0, b->last += passed, b->before = least(b->before + passed, LONG_AGO);
  if (b->period == 0.0f)
    b->last = least(b->last, LONG_AGO);
  else if (b->last > times(b->period, beats + 9) + 2.0f)
    b->last -= times(b->period, beats);
}

static void advance_tempo(md_player *p) {
  md_real goal = p->commanded_tempo, rate = p->tempo_rate;
  if (p->beats.locked) goal = steered_tempo(p), rate = TEMPO_RATE;
  if (p->paused) goal = 0.0f, rate = TEMPO_RATE;
  md_real most_change = rate * p->dt;
  keep_time(&p->beats, p->dt);
  p->tempo += within(goal - p->tempo, most_change);
}

/* The first tick that is so many s away, or more. */
static int ticks_within(const md_player *p, md_real seconds) { return 1 + whole_ticks(least(seconds, 1e5f), p->tick_time); }

/* ---- layers and live values (share.py, layers.py, live_values.py) ---- */

static void begin_share(md_share *s, md_real goal, md_real share, md_bounds bounds) {
  s->goal = goal, s->share = share, s->pace = 0.0f, s->bounds = bounds, s->farthest = 1e-6f;
}
static int arrived(const md_share *s) { return s->share == s->goal; }

static void approach_share(md_share *s, md_real apart, md_real dt, int may_change) {
  md_real left = s->goal - s->share;
  s->farthest = most(apart, s->farthest);
  md_real slew = least(20.0f, s->bounds.acceleration / s->farthest * (0.45f * HARD * HARD));
  md_real fastest = least(least(3.0f, 0.4f * s->bounds.speed / s->farthest), s->bounds.acceleration / s->bounds.speed * (HARD * HARD / 8.0f));
  md_real wanted = may_change ? copysignf(least(fastest, sqrtf(slew * fabsf(left))), left) : 0.0f;
  s->pace = within(s->pace + within(wanted - s->pace, slew * dt), fastest);
  if (fabsf(s->pace) < 2e-5f) s->pace = 0.0f;
  md_real step = s->pace * dt;
  if (may_change && fabsf(left) <= most(fabsf(step), 1e-7f) && step * left >= 0.0f)
    s->share = s->goal, s->pace = 0.0f;
  else
    s->share = bounded(s->share + step, 0.0f, 1.0f);
}

/* Whether the share of a layer may change: one at a time does of those that share a joint, the latest first. */
static int may_change(const md_player *p, int number) {
  const md_layer_state *own = p->layer + number;
  if (p->current || p->fading) return 0;
  for (int k = 0; k < p->layers; k++) {
    const md_layer_state *other = p->layer + k;
    if (k == number || !(other->joints & own->joints)) continue;
    if (other->share.pace != 0.0f || (k > number && !arrived(&other->share))) return 0;
  }
  return 1;
}

static void mix_layers(md_player *p) {
  int may[MD_MOST_LAYERS], kept = 0;
  for (int k = 0; k < p->layers; k++) {
    md_layer_state *l = p->layer + k;
    if (l->share.goal != 0.0f && !l->track.motion->loop && has_ended(&l->track)) l->share.goal = 0.0f;
  }
  for (int k = 0; k < p->layers; k++) may[k] = may_change(p, k);
  for (int k = 0; k < p->layers; k++) {
    md_layer_state *l = p->layer + k;
    md_real most_change = TEMPO_RATE * p->dt, apart = 0.0f;
    l->tempo += within(l->commanded_tempo - l->tempo, most_change);
    step_track(p, &l->track, 1, p->tempo * l->tempo);
    for (int j = 0; j < p->joints; j++) {
      if (!(l->joints >> j & 1)) l->track.now[j] = p->targets[j];
      apart = most(apart, fabsf(l->track.now[j] - p->targets[j]));
    }
    if (!arrived(&l->share) || l->share.pace != 0.0f) approach_share(&l->share, apart, p->dt, may[k]);
    for (int j = 0; j < p->joints; j++) p->targets[j] += l->share.share * (l->track.now[j] - p->targets[j]);
  }
  for (int k = 0; k < p->layers; k++) {
    const md_share *s = &p->layer[k].share;
    if (s->goal == 0.0f && arrived(s)) continue;
    if (kept < k) copy(p->layer + kept, p->layer + k, sizeof *p->layer);
    kept++;
  }
  p->layers = kept;
}

static md_real live_angle(md_player *p, md_live_state *l, md_real beneath) {
  md_real dt = p->dt, goal;
  if (!l->seen) {
    l->seen = 1, l->shown = beneath;
    return beneath;
  }
  if (l->seen == 1) l->seen = 2, l->at = l->shown, l->moving = beneath - l->shown;
  goal = p->paused ? l->at : l->value;
  md_real follow = (FOLLOW / 2.0f) * (2.0f * dt), off = l->at - goal, pull = l->moving + follow * off, way = l->share.bounds.speed * dt;
  l->at += within(p->decay * (off + pull) - off, way);
  l->moving = within(p->decay * (l->moving - follow * pull), way);
  if (!p->paused) {
    if (--l->left <= 0) l->share.goal = 0.0f;
  }
  if (l->share.goal == 0.0f) approach_share(&l->share, fabsf(l->at - beneath), dt, !p->paused);
  md_real shown = beneath + l->share.share * (l->at - beneath);
  l->shown_moving = shown - l->shown, l->shown = shown;
  return shown;
}

static void mix_live_values(md_player *p) {
  for (int j = 0; j < p->joints; j++) {
    md_live_state *l = p->live + j;
    if (!l->active) continue;
    p->targets[j] = live_angle(p, l, p->targets[j]);
    if (l->share.goal == 0.0f && arrived(&l->share)) l->active = 0;
  }
}

/* The deck's next tick: angles without the limits of the joints, in `targets`. */
static void update(md_player *p) {
  advance_tempo(p);
  if (perform(p) && p->entering == NONE) {
    if (p->fade_of_switch && p->ahead == NONE) {
      if (!BLENDS || p->with == NONE)
        p->current = 0;
      else
        begin_blend(p);
    }
    p->fade_of_switch = 0;
  }
  if (BLENDS && p->problem && p->ahead == NONE) give_up_blend(p);
  if (BLENDS && p->blending && p->entering == NONE && !p->crossing && !p->fading) {
    drop_weightless(p);
    if (p->blending == 1 && p->ahead == NONE) p->current = 0;
    p->blending = 0;
  }
  take_next(p);
  if (!p->fading && p->entering == NONE && !p->crossing) p->limited = 0;
  for (int j = 0; j < p->joints; j++) {
    md_real *angle = p->joint[j].angle;
    angle[BEFORE] = angle[LAST];
    p->targets[j] = angle[LAST] = angle[NOW];
  }
  mix_layers(p);
  mix_live_values(p);
}

/* ---- the run (run_phases.py, stop_state.py, approach.py) ---- */

static EnvelopeJoint *joints_of(md_player *p) { return (EnvelopeJoint *)(void *)p->limit; }
static int at_rest(md_player *p) {
  const EnvelopeJoint *s = joints_of(p);
  for (int j = 0; j < p->joints; j++)
    if (s[j].v != 0.0f || s[j].a != 0.0f) return 0;
  return 1;
}
MD_CALLED const md_real *follow(md_player *p, const md_real *targets) {
  envelope_tick(p->joints, limits_of(p->figure), joints_of(p), p->safe, targets, p->changed, 0);
  return p->safe;
}
static const md_real *brake(md_player *p) {
  envelope_brake(p->joints, limits_of(p->figure), joints_of(p), p->safe);
  return p->safe;
}

/* Goes to where the motion is, before it follows it. */
static void go_there(md_player *p) {
  const EnvelopeLimits *l = limits_of(p->figure);
  p->way = STOPPING;
  for (int j = 0; j < p->joints; j++) p->joint[j].to = bounded(p->targets[j], l[j].lower, l[j].upper);
}

/* Limits of speed, acceleration and jerk are kept in some ticks if the way is at most the limit times so many ticks, or their
   second or third power, by these; the part of some ticks that has passed. */
#ifdef MD_FIXED
typedef uint64_t md_reach;
#define FINEST 1u
#define MOST_TICKS (1u << 29)
static const md_ticks peaks[3] = {122880u, 378373u, 3932160u};
static md_reach reach_of(md_real x) { return (uint32_t)x.raw; }
static md_reach grown(md_reach reach, md_ticks ticks) {
  reach = reach * ticks >> 16;
  return reach >> 34 ? 1ull << 34 : reach;
}
static md_ticks ticks_of(int tick) { return (uint32_t)tick << 16; }
static md_real part_of(int tick, md_ticks ticks) {
  int32_t part = md_quotient((uint64_t)tick << 41, ticks);
  return md_real::of(part < 1 << 25 ? part : 1 << 25);
}
#else
typedef float md_reach;
#define FINEST (1.0f / 65536.0f)
#define MOST_TICKS 1048576.0f
static const float peaks[3] = {1.875f, 5.7735027f, 60.0f};
static md_reach reach_of(md_real x) { return x; }
static md_reach grown(md_reach reach, md_ticks ticks) { return reach * ticks; }
static md_ticks ticks_of(int tick) { return (float)tick; }
static md_real part_of(int tick, md_ticks ticks) { return least((float)tick / ticks, 1.0f); }
#endif

/* Whether a joint needs more ticks for its way. */
static int too_soon(md_real way, const EnvelopeLimits *l, md_ticks ticks) {
  md_real limits[3] = {l->v, l->a, l->j};
  for (int k = 0; k < 3; k++) {
    md_reach reach = reach_of(limits[k]);
    for (int n = k; n; n--) reach = grown(reach, ticks);
    if (reach * ticks < reach_of(way) * peaks[k]) return 1;
  }
  return 0;
}

static void start_approach(md_player *p) {
  md_ticks ticks = 0; /* that the joints need at least from where they are to where they go */
  for (int j = 0; j < p->joints; j++) {
    const EnvelopeLimits *l = limits_of(p->figure) + j;
    md_joint *joint = p->joint + j;
    joint->from = joints_of(p)[j].p;
    md_real way = most(fabsf(joint->to - joint->from) - CHANGED, 0.0f);
    for (md_ticks more = too_soon(way, l, ticks) ? MOST_TICKS : 0; more >= FINEST; more /= 2)
      if (too_soon(way, l, ticks + more - FINEST)) ticks += more;
  }
  p->approach = 4 * ticks, p->tick = 0, p->way = MOVING;
}

static const md_real *approach(md_player *p) {
  md_real x = part_of(++p->tick, p->approach), share = smooth(x);
  md_real targets[MD_MOST_JOINTS];
  for (int j = 0; j < p->joints; j++) targets[j] = p->joint[j].from + (p->joint[j].to - p->joint[j].from) * share;
  return follow(p, targets);
}

MD_CALLED void halt(md_player *p) { p->paused = 1, p->tempo_rate = TEMPO_RATE; }

static void set_phase(md_player *p, uint8_t phase) {
  if (phase == p->phase) return;
  p->phase = phase;
  if (phase == RUNNING)
    go_there(p);
  else
    p->way = HOLDING;
}

static const md_real *step(md_player *p) {
  if (p->within && !p->missed && p->silent++ >= p->within) p->missed = 1, halt(p);
  if (p->way == HOLDING) {
    if (at_rest(p) && p->phase == BRAKING) set_phase(p, p->demanded ? LATCHED : HELD);
    update(p);
    return brake(p);
  }
  if (p->way == STOPPING) {
    if (!at_rest(p)) return brake(p);
    start_approach(p);
  }
  if (p->way == MOVING) {
    if (ticks_of(p->tick) < p->approach) return approach(p);
    p->tick = p->approach > 0 ? 2 : 0; /* brake at least so long, though 32 bits may not show the last velocity */
    p->way = ARRIVING;
  }
  if (p->way == ARRIVING) {
    if (p->tick-- > 0 || !at_rest(p)) return brake(p);
    p->way = FOLLOWING;
  }
  update(p);
  return follow(p, p->targets);
}

const md_number *md_step(md_player *p) { return ALL_OUT(step(p)); }

int md_begin(md_player *p, const uint32_t *figure, const md_number *measured) {
  if (figure[0] != MAGIC || figure[WORDS] != ~figure[INVERSE]) return MD_E_FIGURE; /* before all words are read */
  if (figure[JOINTS] > MD_MOST_JOINTS || sum_of(figure) != figure[CHECKSUM]) return MD_E_FIGURE;
  clear(p, sizeof *p);
  p->figure = figure, p->track = p->tracks, p->joints = (int)figure[JOINTS], p->tick_time = real_at(figure, TICK), p->dt = p->tick_time * (1.0f / FINER);
  p->tempo = p->commanded_tempo = 1.0f, p->tempo_rate = TEMPO_RATE;
  p->ahead = p->entering = p->with = NONE, p->track->weight = 1.0f, p->jump = -1.0f, p->phase = RUNNING;
  p->decay = exponential((-FOLLOW / 2.0f) * (2.0f * p->dt));
  enter_phase(p, p->track, motion_row(figure, 0), 0.0f);
  step_track(p, p->track, 0, 1.0f);
  for (int j = 0; j < p->joints; j++) {
    md_real *angle = p->joint[j].angle;
    angle[BEFORE] = angle[LAST] = angle[NOW] = p->track->now[j];
  }
  update(p);
  go_there(p);
  EnvelopeJoint *s = joints_of(p);
  for (int j = 0; j < p->joints; j++) {
    s[j].p = measured && fabsf(IN(measured[j])) < FARTHEST ? IN(measured[j]) : p->joint[j].to;
    s[j].goal = s[j].p, s[j].matched = 1.0f;
    p->safe[j] = s[j].p;
  }
  return 0;
}

/* ---- commands (commanded_run.py) ---- */

static int stopped(const md_player *p) { return p->phase == LATCHED || (p->phase == BRAKING && p->demanded); }

/* What a command answers that takes numbers from low to high. */
MD_CALLED int refused(const md_player *p, md_real x, md_real low, md_real high) {
  if (stopped(p)) return MD_E_STOPPED;
  return x >= low && x <= high ? 0 : MD_E_VALUE;
}

static int playable(const md_player *p, int motion) {
  if (stopped(p)) return MD_E_STOPPED;
  return motion >= 0 && motion < md_motions(p->figure) ? 0 : MD_E_MOTION;
}

static int go_on(md_player *p) {
  if (p->phase == HELD) set_phase(p, RUNNING);
  p->paused = 0;
  return 0;
}
static int played(md_player *p) { return p->phase == RUNNING ? 0 : go_on(p); }

int md_switch(md_player *p, int motion, int direct) {
  int wrong = playable(p, motion);
  if (wrong) return wrong;
  int under_way = p->current && p->going_to == motion && p->with == NONE && motion_row(p->figure, motion)->loop;
  p->queued = 0;
  if (!under_way || (direct && p->ahead != NONE)) {
    p->ahead = NONE;
    start_switch(p, motion, direct, NONE);
  }
  return played(p);
}

int md_blend(md_player *p, int first, int second, md_number weight_of_second) {
  md_real weight = IN(weight_of_second);
  int wrong = playable(p, first) | playable(p, second); /* one number, whichever answers it */
  if (wrong) return wrong;
  if (refused(p, weight, IN(MD(-0.3)), IN(MD(1.3))) || first == second) return MD_E_VALUE;
  if (!BLENDS || !motion_row(p->figure, first)->loop || !motion_row(p->figure, second)->loop || apart(p, first, second))
    return MD_E_BLEND;
  int turned = p->blended && md_playing(p) == second; /* the one that leads stays the first */
  p->queued = 0, p->ahead = NONE, p->share = turned ? 1.0f - weight : weight;
  start_switch(p, turned ? second : first, 0, turned ? first : second);
  return played(p);
}

int md_queue(md_player *p, int motion) {
  int wrong = playable(p, motion);
  if (wrong) return wrong;
  if (p->queued == MD_MOST_QUEUED) return MD_E_FULL;
  finish_round(p->track);
  p->queue[p->queued++] = (uint8_t)motion;
  return played(p);
}

int md_tempo(md_player *p, md_number factor, md_number within) {
  md_real tempo = IN(factor), over = IN(within);
  int wrong = refused(p, tempo, -3.0f, 3.0f) | refused(p, over, 0.0f, 60.0f);
  if (wrong) return wrong;
  md_real change = fabsf(tempo - (p->paused ? 0.0f : p->tempo));
  p->commanded_tempo = tempo, p->beats.locked = 0;
  p->tempo_rate = over > 0.0f ? least(TEMPO_RATE, change / over) : TEMPO_RATE;
  return 0;
}

int md_lock(md_player *p, md_number at, int steps) {
  md_real phase = IN(at);
  int wrong = refused(p, phase, 0.0f, 1.0f);
  if (wrong) return wrong;
  if (steps < 0 || steps > 16) return MD_E_VALUE;
  clear(&p->beats, sizeof p->beats);
  p->beats.locked = 1, p->beats.phase = phase, p->beats.steps = steps;
  return 0;
}

int md_beat(md_player *p, md_number since) {
  md_real ago = IN(since);
  int wrong = refused(p, ago, -2.0f, 2.0f);
  if (wrong) return wrong;
  if (!p->beats.locked) md_lock(p, OUT(0.0f), 0);
  take_beat(&p->beats, ago, p->dt);
  return 0;
}

int md_unlock(md_player *p) { return md_tempo(p, OUT(p->commanded_tempo), OUT(0.0f)); }

int md_jump(md_player *p, md_number to) {
  md_real phase = IN(to);
  int wrong = refused(p, phase, 0.0f, 1.0f);
  if (wrong) return wrong;
  if (p->blended) return MD_E_BLEND;
  p->jump = phase;
  return 0;
}

MD_CALLED void end_layers(md_player *p, uint64_t joints) {
  for (int k = 0; k < p->layers; k++)
    if (!joints || p->layer[k].joints == joints) p->layer[k].share.goal = 0.0f;
}

int md_layer(md_player *p, uint64_t joints, int motion, md_number share_of_it, md_number factor) {
  md_real weight = IN(share_of_it), tempo = IN(factor);
  if (stopped(p)) return MD_E_STOPPED;
  if (!joints || motion == NONE) {
    end_layers(p, joints);
    return 0;
  }
  int wrong = playable(p, motion);
  if (wrong) return wrong;
  wrong = refused(p, weight, 0.0f, 1.0f) | refused(p, tempo, 0.0f, 3.0f);
  if (wrong) return wrong;
  const md_motion *m = motion_row(p->figure, motion);
  md_bounds bounds = wider(m->bounds, p->track->motion->bounds);
  md_layer_state *latest = 0;
  for (int k = 0; k < p->layers; k++) {
    md_layer_state *l = p->layer + k;
    if (l->joints != joints || l->share.goal == 0.0f) continue;
    bounds = wider(bounds, l->track.motion->bounds);
    latest = l;
  }
  if (latest && latest->track.motion == m && m->loop) {
    latest->share.goal = weight, latest->commanded_tempo = tempo;
    return 0;
  }
  if (p->layers == MD_MOST_LAYERS) return MD_E_FULL;
  end_layers(p, joints);
  md_layer_state *l = p->layer + p->layers++;
  begin_share(&l->share, weight, 0.0f, bounds);
  l->joints = joints, l->tempo = l->commanded_tempo = tempo;
  enter_phase(p, &l->track, m, 0.0f);
  return 0;
}

int md_live(md_player *p, int joint, md_number place, md_number lasting) {
  md_real value = IN(place), seconds = IN(lasting);
  int wrong = refused(p, value, -1.0f, 1.0f) | refused(p, seconds, 0.05f, 1e30f);
  if (wrong) return wrong;
  if (joint < 0 || joint >= p->joints) return MD_E_VALUE;
  const EnvelopeLimits *limits = limits_of(p->figure) + joint;
  md_live_state *l = p->live + joint;
  md_real zero = bounded(0.0f, limits->lower, limits->upper), hard = HARD * p->dt;
  md_bounds bounds = {limits->v / p->dt, limits->a / hard / hard};
  if (!l->active || l->share.goal == 0.0f) begin_share(&l->share, 1.0f, 1.0f, bounds), l->at = l->shown, l->moving = l->shown_moving;
  if (!l->active) l->active = 1, l->seen = 0, l->at = l->moving = l->shown_moving = 0.0f;
  l->value = zero + fabsf(value) * ((value > 0.0f ? limits->upper : limits->lower) - zero);
  l->left = ticks_within(p, seconds - SOON);
  return 0;
}

int md_pause(md_player *p) {
  if (stopped(p)) return MD_E_STOPPED;
  halt(p);
  return 0;
}

int md_resume(md_player *p) {
  return stopped(p) ? MD_E_STOPPED : go_on(p);
}

void md_stop(md_player *p) {
  p->demanded = 1;
  set_phase(p, p->phase == HELD || p->phase == LATCHED ? LATCHED : BRAKING);
  halt(p);
}

int md_reset(md_player *p) {
  if (!stopped(p)) return MD_E_VALUE;
  if (p->phase == BRAKING) return MD_E_MOVING;
  p->demanded = 0;
  set_phase(p, HELD);
  return 0;
}

void md_heartbeat(md_player *p, md_number within) {
  md_real seconds = IN(within);
  p->within = seconds > 0.0f ? ticks_within(p, seconds + SOON) : 0, p->silent = 0, p->missed = 0;
}

/* ---- what a player tells ---- */

const md_number *md_targets(const md_player *p) { return ALL_OUT(p->targets); }
int md_playing(const md_player *p) { return motion_index(p, p->track->motion); }
int md_going_to(const md_player *p) { return p->current ? p->going_to : md_playing(p); }
md_number md_weight(const md_player *p, int motion) {
  int place = place_of(p, motion);
  return place == NONE ? 0 : p->blended ? OUT(p->track[place].weight) : OUT(1.0f);
}
md_number md_phase(const md_player *p) { return OUT(phase_now(p)); }
int md_mode(const md_player *p) {
  if (p->phase != RUNNING) return stopped(p) ? MD_STOPPED : MD_HELD;
  return p->way == FOLLOWING ? MD_PLAYING : MD_APPROACHING;
}
