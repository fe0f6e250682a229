/* Plays targets on the safety envelope in fixed point: all numbers are of 32 bits, from standard input and to standard output.

   JOINTS TICKS, rows of limits, where the joints start, then of each tick whether they brake and their targets. */
#include <math.h>
#include <stdio.h>

#include "player.h"

#include "envelope.c"

int main(void) {
  static EnvelopeLimits limits[MD_MOST_JOINTS];
  static EnvelopeJoint states[MD_MOST_JOINTS];
  static md_real targets[MD_MOST_JOINTS], safe[MD_MOST_JOINTS];
  static long long changed[MD_MOST_JOINTS];
  int32_t size[2], brakes;
  if (fread(size, 4, 2, stdin) != 2 || size[0] > MD_MOST_JOINTS) return 2;
  size_t joints = (size_t)size[0];
  if (fread(limits, sizeof *limits, joints, stdin) != joints || fread(targets, 4, joints, stdin) != joints) return 2;
  for (size_t j = 0; j < joints; j++) states[j].p = states[j].goal = targets[j], states[j].matched = R(1.0);
  while (size[1]-- && fread(&brakes, 4, 1, stdin) == 1 && fread(targets, 4, joints, stdin) == joints) {
    if (brakes)
      envelope_brake((int)joints, limits, states, safe);
    else
      envelope_tick((int)joints, limits, states, safe, targets, changed, 0);
    fwrite(safe, 4, joints, stdout);
  }
  return 0;
}
