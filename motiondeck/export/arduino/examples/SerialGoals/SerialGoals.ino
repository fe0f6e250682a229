// Writes the goals of all joints as lines of text, for any board or program that drives the servos:
//   goals 123 -45 ... in milliradians, in the order of the figure's joints, md_rate(figure) times a second.
// Takes commands on the same line, as `motiondeck send` spells them, e.g. "waltz", "tempo 0.5" or "estop", and the goals
// of a computer (goals.h). It measures nothing: it answers the computer with the goals that it has written. After "off" it
// writes none.
#include <Motiondeck.h>

static md_player player;
static md_goals goals;
static md_line line;
static uint32_t due; // us

void setup() {
  Serial.begin(MD_BAUD);
  while (md_begin(&player, figure, NULL) < 0) delay(1000); // a damaged figure plays nothing
  due = micros();
}

void loop() {
  md_take_lines(&player, &goals, &line, &due);
  if (!md_tick_is_due(&due)) return;
  const md_number *angles = md_step_towards(&player, &goals);
  md_tell(&player, &goals, angles, NULL);
  if (goals.off) return;
  Serial.print("goals");
  for (int joint = 0; joint < FIGURE_JOINTS; joint++) {
    Serial.print(' ');
    Serial.print((long)lroundf(1000.0f * MD_FLOAT(angles[joint])));
  }
  Serial.println();
}
