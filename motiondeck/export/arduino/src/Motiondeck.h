/* A figure of Motiondeck for a sketch: the player, its commands as lines of text, the figure, and the servos of its rig
   file. Include it in one file alone, or the figure is in memory twice. */
#ifndef MOTIONDECK_H
#define MOTIONDECK_H
#include <Arduino.h>

#include "commands.h"
#include "figure.h"
/* A servo: the joint that it turns, whether it is the second one of that joint, its operating mode, its position where
   the joint is at 0, and pulses for a radian. */
typedef struct {
  uint8_t joint, second, id, mode;
  int32_t zero;
  float per_radian;
} md_servo;
#include "servos.h"

/* Carries out the commands that have come over USB, and answers each with a line. */
static inline void md_take_commands(md_player *player, md_line *line) {
  char reply[128];
  while (Serial.available() > 0) {
    const char *command = md_letter(line, (char)Serial.read());
    if (!command) continue;
    md_command(player, command, reply, sizeof reply);
    Serial.println(reply);
  }
}

/* Whether the tick that is due at a time, us, has come; the next one is then due. Late ticks are not caught up with. */
static inline bool md_tick_is_due(uint32_t *due) {
  if ((int32_t)(micros() - *due) < 0) return false;
  *due += (uint32_t)(1e6f / md_rate(figure));
  if ((int32_t)(micros() - *due) > 0) *due = micros();
  return true;
}
#endif
