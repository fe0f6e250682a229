/* Commands of a player as lines of text, spelled as `motiondeck send` has them. */
#ifndef MOTIONDECK_COMMANDS_H
#define MOTIONDECK_COMMANDS_H
#include "player.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Carries out MOTION [direct], switch MOTION [direct], queue MOTION, blend MOTION MOTION WEIGHT, tempo FACTOR [OVER], jump PHASE, pause, resume,
   estop, reset, heartbeat SECONDS, or status. Writes a line of at most `size` bytes, its end included, into `reply`;
   returns 0, or a negative MD_E... */
int md_command(md_player *p, const char *line, char *reply, int size);

/* Collects a line from its letters; returns it once it has ended, or NULL. What is longer than a line is lost, and what comes
   before a > in it (see goals.h). */
typedef struct {
  char text[4 * MD_MOST_JOINTS + 64];
  int length, lost;
} md_line;
const char *md_letter(md_line *line, char letter);

#ifdef __cplusplus
}
#endif
#endif
