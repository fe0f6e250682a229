/* Commands of a player as lines of text: see commands.h. */
#include "commands.h"

#include <stdlib.h>
#include <string.h>

enum { MOST_WORDS = 5, LONGEST = 64, UNKNOWN = -100 };

static const char *why(int answer) {
  switch (answer) {
    case MD_E_MOTION: return "there is no such motion";
    case MD_E_VALUE: return "a number is missing or out of its range";
    case MD_E_FULL: return "too many motions wait";
    case MD_E_STOPPED: return "the emergency stop is on: reset releases it";
    case MD_E_MOVING: return "the joints still brake";
    case MD_E_BLEND: return "these motions cannot be blended, or a jump has to wait for the end of a blend";
    case UNKNOWN: return "unknown; one of: MOTION, switch, queue, blend, tempo, jump, pause, resume, estop, reset, heartbeat, status";
    default: return answer < 0 ? "it cannot be done" : "ok";
  }
}

static void append(char *reply, int size, const char *text) {
  size_t length = strlen(reply), room = (size_t)size - 1 - length, more = strlen(text);
  more = more < room ? more : room;
  memcpy(reply + length, text, more);
  reply[length + more] = 0;
}

static void status(const md_player *p, char *reply, int size) {
  static const char *const modes[] = {"playing", "approaching", "held", "emergency stop"};
  int percent = (int)(100.0f * MD_FLOAT(md_phase(p)));
  char digits[6] = {' ', (char)('0' + percent / 100 % 10), (char)('0' + percent / 10 % 10), (char)('0' + percent % 10), '%', 0};
  append(reply, size, modes[md_mode(p)]);
  append(reply, size, ": ");
  append(reply, size, md_motion_name(p->figure, md_playing(p)));
  append(reply, size, digits);
  append(reply, size, "; motions:");
  for (int motion = 0; motion < md_motions(p->figure); motion++) {
    append(reply, size, " ");
    append(reply, size, md_motion_name(p->figure, motion));
  }
}

/* The number that a word is; 0 if there is no such word and it may be left out. MD_E_VALUE for what is no number. */
static int number(const char *word, int needed, md_number *value) {
  char *end;
  *value = 0;
  if (!word) return needed ? MD_E_VALUE : 0;
  double exact = strtod(word, &end);
  *value = exact < 63.0 && exact > -63.0 ? MD(exact) : MD(63);
  return *end || end == word ? MD_E_VALUE : 0;
}

static int carried_out(md_player *p, char *const *words, int count) {
  const char *first = words[0], *second = count > 1 ? words[1] : NULL, *third = count > 2 ? words[2] : NULL;
  md_number value, other;
  if (!strcmp(first, "switch") || !strcmp(first, "queue")) {
    int motion = second ? md_find(p->figure, second) : MD_E_MOTION;
    if (motion < 0) return motion;
    return first[0] == 'q' ? md_queue(p, motion) : md_switch(p, motion, third && !strcmp(third, "direct"));
  }
  if (!strcmp(first, "blend")) {
    int motion = second ? md_find(p->figure, second) : MD_E_MOTION, other_motion = third ? md_find(p->figure, third) : MD_E_MOTION;
    if (motion < 0 || other_motion < 0) return MD_E_MOTION;
    return count != 4 || number(words[3], 1, &value) ? MD_E_VALUE : md_blend(p, motion, other_motion, value);
  }
  if (!strcmp(first, "tempo")) {
    int wrong = number(second, 1, &value) | number(third, 0, &other);
    return wrong ? MD_E_VALUE : md_tempo(p, value, other);
  }
  if (!strcmp(first, "jump")) return number(second, 1, &value) ? MD_E_VALUE : md_jump(p, value);
  if (!strcmp(first, "heartbeat")) {
    if (number(second, 1, &value) || !(value >= 0 && value <= MD(60))) return MD_E_VALUE;
    md_heartbeat(p, value);
    return 0;
  }
  if (!strcmp(first, "pause")) return md_pause(p);
  if (!strcmp(first, "resume")) return md_resume(p);
  if (!strcmp(first, "reset")) return md_reset(p);
  if (!strcmp(first, "estop")) {
    md_stop(p);
    return 0;
  }
  int motion = md_find(p->figure, first);
  return motion < 0 ? UNKNOWN : md_switch(p, motion, second && !strcmp(second, "direct"));
}

int md_command(md_player *p, const char *line, char *reply, int size) {
  char text[LONGEST], *words[MOST_WORDS];
  int count = 0, answer = UNKNOWN;
  strncpy(text, line, sizeof text - 1);
  text[sizeof text - 1] = 0;
  for (char *at = text; *at && count < MOST_WORDS;) {
    while (*at == ' ' || *at == '\t') at++;
    if (!*at) break;
    words[count++] = at;
    while (*at && *at != ' ' && *at != '\t') at++;
    if (*at) *at++ = 0;
  }
  reply[0] = 0;
  if (count == 1 && !strcmp(words[0], "status")) {
    status(p, reply, size);
    return 0;
  }
  if (count) answer = carried_out(p, words, count);
  if (answer < 0) append(reply, size, "refused: ");
  append(reply, size, why(answer));
  return answer;
}

const char *md_letter(md_line *line, char letter) {
  if (letter == '\r') return NULL;
  if (letter == '>') line->length = line->lost = 0;
  if (letter == '\n') {
    int whole = !line->lost && line->length;
    line->text[line->length] = 0;
    line->length = line->lost = 0;
    return whole ? line->text : NULL;
  }
  if (line->length < (int)sizeof line->text - 1)
    line->text[line->length++] = letter;
  else
    line->lost = 1;
  return NULL;
}
