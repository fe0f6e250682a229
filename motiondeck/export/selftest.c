/* Replays a golden trace of the deck: are the angles the same, and do they keep the limits of the joints?

   Prints the result and returns 0 if both are so. On a board let PRINT write to what it has. */
#ifndef PRINT
#include <stdio.h>
#define PRINT printf
#endif

#include "player.h"

typedef struct {
  int tick;
  char kind;
  int motion;
  float value, other;
} golden_command;

#include "figure.h"
#include "golden.h"

#ifdef MD_FIXED
#define SAME MD(0.003f) /* rad */
#else
#define SAME 0.001f
#endif

static md_player player;

static int give(const golden_command *c) {
  switch (c->kind) {
    case 's': return md_switch(&player, c->motion, c->value != 0.0f);
    case 'q': return md_queue(&player, c->motion);
    case 't': return md_tempo(&player, MD(c->value), MD(c->other));
    case 'm': return md_blend(&player, c->motion, (int)c->other, MD(c->value));
    case 'j': return md_jump(&player, MD(c->value));
    case 'p': return md_pause(&player);
    case 'g': return md_resume(&player);
  }
  md_stop(&player);
  return 0;
}

/* How many of the limits velocity, acceleration, jerk and range a joint breaks, by its positions in the last ticks. */
static int beyond(md_number x, md_number limit) { return x > limit || -x > limit; }
static int broken(const md_number *p, const md_number *limit) {
  md_number before = p[1] - p[0], then = p[2] - p[1], v = p[3] - p[2], a = v - then, j = a - (then - before);
  md_number bit = MD(1e-6f); /* rad; what positions of 32 bits are rounded by, added up */
  return beyond(v, limit[0] + bit) + beyond(a, limit[1] + bit) + beyond(j, limit[2] + bit) +
         (p[3] < limit[3] - 2 * bit || p[3] > limit[4] + 2 * bit);
}

int main(void) {
  static md_number last[FIGURE_JOINTS][4];
  const golden_command *command = golden_commands, *end = command + sizeof golden_commands / sizeof *command;
  const md_number *angles = golden_angles, *limits = (const md_number *)(const void *)(figure + figure[7]);
  md_number worst = 0;
  int refused = 0, over = 0;
  if (md_begin(&player, figure, 0)) return PRINT("the figure is damaged, or MD_MOST_JOINTS is too small\n"), 1;
  for (int j = 0; j < FIGURE_JOINTS; j++)
    for (int k = 0; k < 4; k++) last[j][k] = player.safe[j];
  for (int tick = 0; tick < GOLDEN_TICKS; tick++) {
    for (; command < end && command->tick <= tick; command++) refused += give(command) != 0;
    const md_number *safe = md_step(&player);
    for (int j = 0; j < FIGURE_JOINTS; j++) {
      for (int k = 0; k < 3; k++) last[j][k] = last[j][k + 1];
      last[j][3] = safe[j];
      over += broken(last[j], limits + 6 * j);
      if (tick % GOLDEN_EVERY) continue;
      md_number off = md_targets(&player)[j] - *angles++;
      off = off < 0 ? -off : off;
      worst = off <= worst ? worst : off; /* so that a NaN counts */
    }
  }
  int passed = worst < SAME && !refused && !over;
  PRINT("%d ticks of %d joints: at most %d urad from the deck, limits broken %d times, %d commands refused: %s\n",
        GOLDEN_TICKS, FIGURE_JOINTS, (int)(1e6f * MD_FLOAT(worst)), over, refused, passed ? "passed" : "FAILED");
  return !passed;
}
