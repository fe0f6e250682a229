/* The C player as WebAssembly, without any library; `python docs/player_wasm.py` makes `player.wasm` of it. */
#include "../player.c"

unsigned md_size(void) { return sizeof(md_player); }

/* The joints at a phase of a motion, whatever plays; they are overwritten by the next ones. */
const float *md_moment(const md_player *p, int motion, float phase) {
  static float angles[MD_MOST_JOINTS];
  const md_motion *m = motion_row(p->figure, motion);
  draw(p, m, (int)(phase * (float)m->steps), angles);
  return angles;
}
/* The satellites of a motion's network, none of keys, and what one responds at a phase, from 0 to 1. */
int md_satellites(const md_player *p, int motion) {
  const md_motion *m = motion_row(p->figure, motion);
  return m->count ? 0 : (int)p->figure[m->keys + 1];
}
float md_response(const md_player *p, int motion, float phase, int satellite) {
  const md_motion *m = motion_row(p->figure, motion);
  int states = 2 * (int)p->figure[m->keys];
  const float *turns = (const float *)(const void *)(p->figure + m->keys + 2);
  float state[2 * MOST_CENTERS], exponent;
  turn_centers(turns, states, phase * (float)m->steps, state);
  exponent = exponent_at(turns + states + 2 * p->joints + satellite * (states + 1), state, states);
  return exponent < LEAST_RESPONSE ? 0.0f : response_of(exponent);
}
float md_present_tempo(const md_player *p) { return p->tempo; }
int md_queued(const md_player *p) { return p->queued; }
int md_is_loop(const md_player *p, int motion) { return (int)motion_row(p->figure, motion)->loop; }
/* What is left of the difference that fades, from 1 to 0. */
float md_fade_left(const md_player *p) { return p->fading ? left_of(&p->fade, p->elapsed).value : 0.0f; }
/* The phase at which the next motion will be entered, as far as is known; below 0 while none is looked for. */
float md_entry_phase(const md_player *p) {
  const md_motion *m = motion_row(p->figure, p->entering == NONE ? 0 : p->entering);
  return p->entering == NONE ? -1.0f : (float)p->entry * m->spacing / m->whole;
}
/* How much phase is left of the present round. */
float md_round_left(const md_player *p) { return (p->track->last - p->track->at) / p->track->motion->whole; }
/* The motion that is blended in, or is to be; or -1. Of one that plays, how many rounds it has gone, on its own. */
int md_blended_with(const md_player *p) { return p->current || p->blended || p->blending ? p->with : NONE; }
float md_rounds(const md_player *p, int motion) {
  const md_track *t = p->track;
  for (int k = 1; k <= p->blended; k++)
    if (motion_index(p, p->track[k].motion) == motion) t = p->track + k;
  return (float)t->at / (float)t->motion->whole;
}
/* Layers: how many, each one's motion and share, and the number of that of some joints which does not end; or -1. */
int md_layers(const md_player *p) { return p->layers; }
int md_layer_motion(const md_player *p, int layer) { return motion_index(p, p->layer[layer].track.motion); }
float md_layer_share(const md_player *p, int layer) { return p->layer[layer].share.share; }
int md_layer_of(const md_player *p, uint64_t joints) {
  for (int k = 0; k < p->layers; k++)
    if (p->layer[k].joints == joints && p->layer[k].share.goal != 0.0f) return k;
  return NONE;
}
/* Whether a joint follows a live value. */
int md_is_live(const md_player *p, int joint) { return p->live[joint].active; }
