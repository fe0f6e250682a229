/* A figure of Motiondeck for a sketch: the player, its commands as lines of text, the figure, and the servos of its rig
   file. Include it in one file alone, or the figure is in memory twice. */
#ifndef MOTIONDECK_H
#define MOTIONDECK_H
#include <Arduino.h>

#include "commands.h"
#include "figure.h"
#include "goals.h"
/* A servo: the joint that it turns, whether it is the second one of that joint, its operating mode, its position where
   the joint is at 0, and pulses for a radian. */
typedef struct {
  uint8_t joint, second, id, mode;
  int32_t zero;
  float per_radian;
} md_servo;
#include "servos.h"

#define MD_BAUD 1000000 /* of the line to the computer; USB of its own has no baud rate */

/* Takes the goals and commands that have come over USB; a command is answered with a line. Ticks come to lie half a tick after
   the goals, so that none is late. */
static inline void md_take_lines(md_player *player, md_goals *goals, md_line *line, uint32_t *due) {
  char reply[128];
  while (Serial.available() > 0) {
    const char *text = md_letter(line, (char)Serial.read());
    if (!text) continue;
    if (text[0] == '>') {
      if (md_take_goals(player, goals, text)) *due += ((int32_t)(5e5f / md_rate(figure)) - (int32_t)(*due - micros())) / 16;
      continue;
    }
    int refused = md_command_among(player, goals, text, reply, sizeof reply);
    Serial.print(reply);
    Serial.println(!refused && !strncmp(text, "goals", 5) ? " " RIG : "");
  }
}

/* Answers a computer whose goals are taken: where the joints are, rad, MD_UNKNOWN or not, and an alert of each. */
static inline void md_tell(md_player *player, md_goals *goals, const md_number *angles, const uint8_t *alerts) {
  char text[MD_LINE];
  if (!goals->asked) return;
  md_answer(player, goals, angles, alerts, text);
  Serial.println(text);
}

/* Whether the tick that is due at a time, us, has come; the next one is then due. Late ticks are not caught up with. */
static inline bool md_tick_is_due(uint32_t *due) {
  if ((int32_t)(micros() - *due) < 0) return false;
  *due += (uint32_t)(1e6f / md_rate(figure));
  if ((int32_t)(micros() - *due) > 0) *due = micros();
  return true;
}
#endif
