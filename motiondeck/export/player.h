/* Plays a figure on a microcontroller as Motiondeck's deck does: switches, fades, tempo, emergency stop, joint limits.

   A figure is an array of 32-bit words that `motiondeck export` writes: motions of joints as keys of splines or as networks,
   the limits of the joints, and what the deck knows of the motions. The player reads it where it lies, in flash. It has no heap, no
   global state and no recursion; all of its state is in a struct md_player of yours, which stays where it is. Angles are in rad, times in s.

       static md_player player;
       md_begin(&player, figure, measured);        once, with the measured angles
       angles = md_step(&player);                  at each tick, md_rate(figure) times a second

   Functions that can refuse return 0, or a negative MD_E...; what they refuse changes nothing. */
#ifndef MOTIONDECK_PLAYER_H
#define MOTIONDECK_PLAYER_H
#include <stdint.h>

/* A function wants no copies of itself on a small board. */
#ifdef __GNUC__
#define MD_CALLED __attribute__((noinline, unused)) static
#else
#define MD_CALLED static
#endif

/* Numbers are floats. Where MD_FIXED is defined, there is no floating point: numbers are integers, MD_ONE for 1 (rad, s, a
   tempo or a share of 1), at most 63 of these, and player.c is compiled as C++. MD(0.5) is 0.5
   as such a number, MD_FLOAT(x) a number as a float. */
#ifdef MD_FIXED
#define MD_ONE 33554432.0
#define MD(x) ((md_number)((x) * MD_ONE + ((x) < 0 ? -0.5 : 0.5)))
#ifdef __cplusplus
#include "fixed.h"
#else
typedef int32_t md_real, md_time;
typedef int64_t md_wide;
#endif
typedef int32_t md_number;
typedef uint32_t md_rest, md_ticks; /* less than a unit of md_time; ticks, in 2^-16 */
#define FINER 32.0f /* the figure has the time of a tick by so many times */
#define ROUNDING 1.5e-5f /* rad; the rounding error of a sum of many positions */
#define FARTHEST 60.0f   /* rad; targets beyond are not followed */
#define DEAREST 8000.0f
#define MD_FLOAT(x) ((float)(x) * (float)(1.0 / MD_ONE))
#define IN(number) md_real::of(number)
#define OUT(real) md_real(real).raw
#define ALL_OUT(reals) (&(reals)->raw)
#else
#define MD_ONE 1.0f
#define MD(x) ((md_number)(x))
typedef float md_real, md_wide, md_time, md_number, md_rest, md_ticks;
#define FINER 1.0f
#define ROUNDING 1e-6f /* rad; the rounding error of a sum of many positions */
#define FARTHEST 1e30f
#define DEAREST 1e30f
#define MD_FLOAT(x) (x)
#define IN(number) (number)
#define OUT(real) (real)
#define ALL_OUT(reals) (reals)
#endif
#define REAL md_real
#define CHANGED 1e-6f
#define SQRT sqrtf
#define CEIL rounded_up
#define FLOOR rounded_down
#define COPYSIGN copysignf
#define FABS fabsf

#ifndef MD_MOST_JOINTS
#define MD_MOST_JOINTS 32
#endif
#define MD_MOST_QUEUED 32
#ifndef MD_MOST_LAYERS
#define MD_MOST_LAYERS 4 /* coming, playing and going */
#endif
#ifndef MD_MOST_BLENDED
#define MD_MOST_BLENDED 4 /* motions that play side by side, as in the deck: coming, playing and going; 1: no blends */
#endif
#ifdef MD_FIXED
#define MD_NETWORKS 0
#endif
#ifndef MD_NETWORKS
#define MD_NETWORKS 1 /* 0 without networks in the figure */
#endif

enum {
  MD_E_FIGURE = -1,  /* no figure, a damaged one, or one with more than MD_MOST_JOINTS joints */
  MD_E_MOTION = -2,  /* there is no such motion */
  MD_E_VALUE = -3,   /* a number out of its range */
  MD_E_FULL = -4,    /* MD_MOST_QUEUED motions wait already, or MD_MOST_LAYERS layers play */
  MD_E_STOPPED = -5, /* the emergency stop is on */
  MD_E_MOVING = -6,  /* the joints still brake for the emergency stop */
  MD_E_BLEND = -7    /* motions that cannot be blended, or a jump while some are */
};

/* What the joints do: follow the motion, go slowly to where it is, are held, or are held by the emergency stop. */
enum { MD_PLAYING, MD_APPROACHING, MD_HELD, MD_STOPPED };

/* Speed, rad/s, and acceleration, 64 rad/s^2. */
typedef struct {
  md_real speed, acceleration;
} md_bounds;

/* One motion, as the figure has it. */
typedef struct {
  uint32_t keys, count, frames, moving; /* offset and number of the keys, or 0; frames, of which the first `moving` move */
  uint32_t loop, steps;                 /* whether it is a loop; frames until its phase is 1 */
  uint32_t stride, anchors, entries;    /* frames from anchor to anchor; anchors, of which the first may be entered */
  uint32_t searched;                    /* how many places or moments of it are weighed in a tick */
  md_real unit;                           /* of a key, rad / 6, in fixed point times 2^15 */
  md_real spacing, seconds, whole;        /* s from anchor to anchor, of a round, and until its phase is 1 */
  md_bounds bounds;                       /* the largest of a joint */
  md_real extent, pace;                   /* the largest way and speed of the end of a joint's bone, m and m/s */
  uint32_t name;                        /* offset in bytes among the names */
} md_motion;

/* How a difference runs out: the time it takes, and that until nothing is left of its rate, s. */
typedef struct {
  md_real duration, slowing;
} md_fade;

typedef struct {
  md_real x, y;
} md_vector;

/* A difference that runs out, and its rate. */
typedef struct {
  md_real value, rate;
} md_difference;

/* A joint in a trial, as a bone: its angle, by how much more it is turned, its length, by how much its end is away, and by
   how much that has risen. */
typedef struct {
  md_real angle, turn, length;
  md_vector away, rise;
} md_bone;

/* A joint as it is shown: its angles two ticks ago, at the last one, and in this one; the difference that a fade has to run
   out, and that of the gap to a shorter fade; what a motion that is entered is compared with; where a blend has the
   joint, and has had it in half a second, m; the way of the approach. */
typedef struct {
  md_real angle[3];
  md_difference whole, gap;
  md_real entered_from, entered_reach, place, low, high, from, to;
  md_bone bone;
} md_joint;

/* One motion as it plays: four frames about the present moment, of which `oldest` comes first, and the time into it. */
typedef struct {
  const md_motion *motion;
  int forwards, backwards, oldest;
  int32_t index[4]; /* of the frames */
  md_real fraction; /* of the way from the second frame to the third */
  md_real weight, weight_from, weight_to, lasts; /* in a blend; how long a round lasts there, s */
  md_time at, first, last; /* s into the motion, and where it has ended or gone round */
  md_rest rest;             /* of `at`, that is not in it yet */
  md_real frame[4][MD_MOST_JOINTS], before[MD_MOST_JOINTS], now[MD_MOST_JOINTS]; /* rad */
} md_track;

/* The share that angles have in those beneath, on its way to a goal; what bounds how fast it goes. */
typedef struct {
  md_real goal, share, pace;
  md_bounds bounds;
  md_real farthest;
} md_share;

/* A motion on some joints, over what else is played. */
typedef struct {
  md_share share;
  uint64_t joints; /* a bit for each, the first joint's lowest */
  md_real tempo, commanded_tempo;
  md_track track;
} md_layer_state;

/* A joint that follows values from outside. */
typedef struct {
  md_share share;
  int active, seen; /* and how many of its targets are known, up to 2 */
  int left;         /* ticks */
  md_real value, at, moving, shown, shown_moving;
} md_live_state;

/* The beat that loops keep step with; times are s ago. */
typedef struct {
  int locked, steps, chosen, counted, strays, was_stray, steady;
  int ticks;                                     /* since `last` and `before` were so long ago */
  md_real phase, period, last, before, interval; /* no period is known at 0 */
} md_beats;

/* Small numbers stand first, then what else is not an array, and of both what is named most: a small core reaches 32 bytes, or
   31 words, with short instructions. */
typedef struct {
  const uint32_t *figure;
  md_track *track; /* the first of `tracks` */
  /* The plan: whether a switch is under way, waits for an end, or fades. The run: emergency stop, approach, heartbeat. */
  uint8_t current, waits, fade_of_switch, queued, paused, phase, way, demanded, missed;
  /* The fade of the last switch, whether there is a gap to a shorter one that it began as, and the search for its duration. */
  uint8_t fading, has_gap, found, slowed, hasty;
  /* The blend: whether weights change for the switch, or at all, or its motion is sought; what is wrong with it. Whether
     there are limits of a join. */
  uint8_t blending, crossing, adding, problem, limited;
  int joints, blended; /* motions beside the one that leads */
  md_real dt, tempo;
  /* The plan: what is entered, what the present switch goes to, what is blended in with it, and what waits. */
  int entering, going_to, with, ahead;
  int layers;
  md_fade fade;
  md_real weight_pace; /* of the change of weights */
  md_real elapsed, gap_elapsed, onset;
  md_real watched; /* s of `low` and `high`; below 0 at first */
  md_real jump;    /* the phase to go to in this tick, below 0 none */
  md_real commanded_tempo, tempo_rate;
  int trials, rises, moment;
  int compared, entry; /* places of the motion that is entered, and the best so far */
  int32_t tick;
  int within, silent; /* ticks; within 0 any */
  int blending_to, coarse;
  md_fade best;
  md_real least, last, already, course_tempo; /* of the trial, and the course of the motion that it considers */
  md_bounds bound;                            /* of the trial, as planned */
  md_fade candidate;
  md_bounds join, own;                        /* of the join, and the largest of its motions */
  md_real correct_from;                       /* the use of the limits from which on the fade is replaced */
  md_real share, decay;                       /* of what is blended in; of a live joint in a tick */
  md_real weighed, weighing;                  /* s of the change of weights, and of all of it */
  md_wide entry_cost, fastest, first, hardest;
  md_time course_at;                          /* s into the motion */
  md_real tick_time;                          /* s, times FINER */
  md_ticks approach;                          /* all of them */
  md_beats beats;
  uint8_t queue[MD_MOST_QUEUED];

  md_real targets[MD_MOST_JOINTS], safe[MD_MOST_JOINTS];
  md_joint joint[MD_MOST_JOINTS];
  md_track tracks[MD_MOST_BLENDED];     /* the one that leads, and those that are blended in */
  md_layer_state layer[MD_MOST_LAYERS]; /* the lowest first */
  md_live_state live[MD_MOST_JOINTS];
  REAL limit[MD_MOST_JOINTS][6]; /* an EnvelopeJoint each, see envelope.c */
  long long changed[MD_MOST_JOINTS]; /* how many targets the limits have changed */
} md_player;

#ifdef __cplusplus
extern "C" {
#endif

/* Starts with the joints at rest at the measured angles, rad, or (NULL) at the first ones of the first motion. */
int md_begin(md_player *p, const uint32_t *figure, const md_number *measured);
/* The angles of the next tick, rad, within all limits; they are overwritten by the one after it. */
const md_number *md_step(md_player *p);

int md_switch(md_player *p, int motion, int direct); /* to a motion, by way of others where it is far; else direct */
/* Plays a loop with a weight of another from -0.3 to 1.3 in it: switches to the first, then blends the second in. */
int md_blend(md_player *p, int first, int second, md_number weight);
int md_queue(md_player *p, int motion);              /* plays a motion after the present round and what waits */
int md_tempo(md_player *p, md_number tempo, md_number over); /* -3 to 3, 1 as recorded, reached within 0 to 60 s */
int md_jump(md_player *p, md_number phase);              /* fades to a phase in [0, 1] of the present motion */
/* Plays a motion on some joints, a bit for each, with a weight from 0 to 1, at 0 to 3 times the tempo; motion -1 ends
   the layer of these joints, joints 0 all layers. */
int md_layer(md_player *p, uint64_t joints, int motion, md_number weight, md_number tempo);
/* Holds a joint at -1 (its lower limit) over 0 (its zero) to 1 (its upper one) for some seconds, at least 0.05; then it
   falls back to the motion. */
int md_live(md_player *p, int joint, md_number value, md_number seconds);
/* Locks loops to a beat, of which one falls on a phase in [0, 1] and so many are in a round, up to 16 (0: whichever number
   is nearest to the motion's own tempo). md_beat is a beat so many s ago, -2 to 2; the first one locks. */
int md_lock(md_player *p, md_number phase, int steps);
int md_beat(md_player *p, md_number ago);
int md_unlock(md_player *p);
int md_pause(md_player *p);
int md_resume(md_player *p);
void md_stop(md_player *p); /* emergency stop: brakes, and stays so until reset, and then resume or a switch */
int md_reset(md_player *p);
void md_heartbeat(md_player *p, md_number within); /* pauses unless it is called again within so many s; 0: never */

int md_joints(const uint32_t *figure);
int md_motions(const uint32_t *figure);
float md_rate(const uint32_t *figure); /* ticks a second */
const char *md_joint_name(const uint32_t *figure, int joint);
const char *md_motion_name(const uint32_t *figure, int motion);
int md_find(const uint32_t *figure, const char *name); /* a motion by its name, or MD_E_MOTION */

const md_number *md_targets(const md_player *p); /* the angles of the last tick before the limits, rad */
int md_playing(const md_player *p);  /* the motion that plays now */
int md_going_to(const md_player *p); /* the motion that is switched to, or that plays */
md_number md_weight(const md_player *p, int motion); /* the present weight of a motion; 1 if it plays alone */
md_number md_phase(const md_player *p);  /* 0 to 1 */
int md_mode(const md_player *p);     /* MD_PLAYING ... */

#ifdef __cplusplus
}
#endif
#endif
