/* Plays commands from standard input on a figure; writes the targets before and after the limits of each tick.

   replay FIGURE TICKS < "a MEASURED..." or "n", then lines of TICK KIND MOTION VALUE VALUE JOINTS. At the end comes a byte for
   each command: 1 if it was accepted. */
#include <stdio.h>
#include <stdlib.h>

#include "player.h"

static int give(md_player *p, char kind, int motion, md_number value, md_number other, unsigned long long joints) {
  switch (kind) {
    case 's': return md_switch(p, motion, value != 0);
    case 'q': return md_queue(p, motion);
    case 't': return md_tempo(p, value, other);
    case 'm': return md_blend(p, motion, (int)MD_FLOAT(other), value);
    case 'j': return md_jump(p, value);
    case 'p': return md_pause(p);
    case 'g': return md_resume(p);
    case 'e': return md_stop(p), 0;
    case 'r': return md_reset(p);
    case 'b': return md_beat(p, value);
    case 'k': return md_lock(p, value, motion);
    case 'u': return md_unlock(p);
    case 'l': return md_layer(p, joints, motion, value, other);
    case 'v': return md_live(p, motion, value, other);
    case 'h': return md_heartbeat(p, value), 0;
  }
  return -100;
}

int main(int count, char **words) {
  FILE *file = count == 3 ? fopen(words[1], "rb") : 0;
  static uint32_t figure[1 << 18];
  static md_number measured[MD_MOST_JOINTS];
  static unsigned char accepted[100000];
  static md_player player;
  if (!file || !fread(figure, 4, 1 << 18, file)) return 2;
  fclose(file);
  int ticks = atoi(words[2]), given = 0, due, motion, joints = md_joints(figure);
  double value, other;
  unsigned long long mask;
  char kind;
  if (scanf(" %c", &kind) != 1) return 2;
  for (int j = 0; kind == 'a' && j < joints; j++, measured[j - 1] = MD(value))
    if (scanf("%lf", &value) != 1) return 2;
  int begun = md_begin(&player, figure, kind == 'a' ? measured : 0);
  if (begun) return fprintf(stderr, "md_begin: %d\n", begun), 3;
#define MORE (scanf("%d %c %d %lf %lf %llu", &due, &kind, &motion, &value, &other, &mask) == 6)
  int more = MORE;
  for (int tick = 0; tick < ticks; tick++) {
    for (; more && due <= tick; more = MORE)
      accepted[given++] = !give(&player, kind, motion, MD(value), MD(other), mask);
    const md_number *safe = md_step(&player);
    fwrite(md_targets(&player), sizeof(md_number), (size_t)joints, stdout);
    fwrite(safe, sizeof(md_number), (size_t)joints, stdout);
  }
  fwrite(accepted, 1, (size_t)given, stdout);
  return 0;
}
