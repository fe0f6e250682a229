// Writes the goals of all joints as lines of text, for any board or program that drives the servos:
//   goals 123 -45 ... in milliradians, in the order of the figure's joints, md_rate(figure) times a second.
// Takes commands on the same line, as `motiondeck send` spells them, e.g. "waltz", "tempo 0.5" or "estop".
#include <Motiondeck.h>

static md_player player;
static md_line line;
static uint32_t due; // us

void setup() {
  Serial.begin(115200);
  while (md_begin(&player, figure, NULL) < 0) delay(1000); // a damaged figure plays nothing
  due = micros();
}

void loop() {
  md_take_commands(&player, &line);
  if (!md_tick_is_due(&due)) return;
  const float *angles = md_step(&player);
  Serial.print("goals");
  for (int joint = 0; joint < FIGURE_JOINTS; joint++) {
    Serial.print(' ');
    Serial.print((long)lroundf(1000.0f * angles[joint]));
  }
  Serial.println();
}
