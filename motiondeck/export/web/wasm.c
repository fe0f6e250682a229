/* The C player as WebAssembly, without any library; `python docs/player_wasm.py` makes `player.wasm` of it. */
#include "../player.c"

/* Two of Halley's steps from a guess by the exponent: correct to the last bit or the one beside it. */
float cbrtf(float x) {
  union {
    float value;
    uint32_t bits;
  } guess;
  double root, cube, aim = fabsf(x);
  if (aim < 1.2e-38) return 0.0f;
  guess.value = fabsf(x);
  guess.bits = guess.bits / 3 + 709921077u;
  root = guess.value;
  for (int step = 0; step < 2; step++) {
    cube = root * root * root;
    root *= (cube + 2.0 * aim) / (2.0 * cube + aim);
  }
  return copysignf((float)root, x);
}

size_t strlen(const char *text) {
  const char *end = text;
  while (*end) end++;
  return (size_t)(end - text);
}

int strcmp(const char *one, const char *other) {
  for (; *one && *one == *other; one++) other++;
  return (unsigned char)*one - (unsigned char)*other;
}

unsigned md_size(void) { return sizeof(md_player); }

/* The joints at a phase of a motion, whatever plays; they are overwritten by the next ones. */
const float *md_moment(const md_player *p, int motion, float phase) {
  static float angles[MD_MOST_JOINTS];
  const md_motion *m = motion_row(p->figure, motion);
  draw(p, m, (int)(phase * (float)m->steps), angles);
  return angles;
}
float md_present_tempo(const md_player *p) { return p->tempo; }
int md_queued(const md_player *p) { return p->queued; }
