// Writes the goals of all joints as lines of text, for any board or program that drives the servos:
//   goals 123 -45 ... in milliradians, in the order of the figure's joints, md_rate(figure) times a second.
// Takes commands on the same line, as `motiondeck send` spells them, e.g. "waltz", "tempo 0.5" or "estop".
#include <Motiondeck.h>

static md_player player;
static md_line line;
static uint32_t due, period; // us

static void take_commands() {
  char reply[128];
  while (Serial.available() > 0) {
    const char *command = md_letter(&line, (char)Serial.read());
    if (!command) continue;
    md_command(&player, command, reply, sizeof reply);
    Serial.println(reply);
  }
}

void setup() {
  Serial.begin(115200);
  while (md_begin(&player, figure, NULL) < 0) delay(1000); // a damaged figure plays nothing
  period = (uint32_t)(1e6f / md_rate(figure));
  due = micros();
}

void loop() {
  take_commands();
  if ((int32_t)(micros() - due) < 0) return;
  due += period;
  if ((int32_t)(micros() - due) > 0) due = micros(); // late: no tick is caught up with
  const float *angles = md_step(&player);
  Serial.print("goals");
  for (int joint = 0; joint < FIGURE_JOINTS; joint++) {
    Serial.print(' ');
    Serial.print((long)lroundf(1000.0f * angles[joint]));
  }
  Serial.println();
}
