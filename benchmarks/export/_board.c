/* Counts the instructions of a player's ticks on an emulated Cortex-M, by SysTick under `-icount shift=0`.

   One SysTick is 40 instructions there. Ticks are of five kinds: a motion plays, a fade runs, the search for the duration
   of a fade goes on with it, a motion is entered, two motions are blended. LAYERS play over all joints but one each. */
#include "player.h"

#include "figure.h"

#define SYSTICK ((volatile uint32_t *)0xE000E010u)
#define STACK_BYTES 16384
#define INSTRUCTIONS 40u
#define PAINT 0xA5A5A5A5u
#ifndef LAYERS
#define LAYERS 0
#endif

extern uint32_t bss_begin[], bss_end[], data_from[], data_begin[], data_end[], stack_top[];
static md_player player;

static int call(int operation, const void *argument) {
  register int r0 __asm__("r0") = operation;
  register const void *r1 __asm__("r1") = argument;
  __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}
/* x / y; a division of the library would be counted as the player's. */
static uint32_t divided(uint32_t x, uint32_t y) {
  uint32_t part = 0;
  for (int bit = 31; bit >= 0; bit--)
    if (x >> bit >= y) x -= y << bit, part |= 1u << bit;
  return part;
}
static void write_number(const char *name, uint32_t value) {
  char text[12], *at = text + 11;
  *at = 0, *--at = '\n';
  do {
    uint32_t rest = divided(value, 10);
    *--at = (char)('0' + value - 10 * rest), value = rest;
  } while (value);
  call(4, name), call(4, " "), call(4, at);
}

static uint32_t step(void) {
  uint32_t before = SYSTICK[2];
  md_step(&player);
  return (before - SYSTICK[2]) & 0xFFFFFFu;
}

static void run(void) {
  static const char *const names[5][2] = {
      {"playing", "playing_worst"}, {"fading", "fading_worst"}, {"searching", "searching_worst"}, {"entering", "entering_worst"},
      {"blending", "blending_worst"}};
  static uint32_t sum[5], count[5], worst[5]; /* of ticks of SysTick */
  md_begin(&player, figure, 0);
  for (int layer = 0; layer < LAYERS; layer++)
    md_layer(&player, ((1ull << md_joints(figure)) - 1) ^ 1ull << layer, layer % md_motions(figure), MD(0.5), MD(1));
  for (int from = 0; from < md_motions(figure); from++)
    for (int to = 0; to < md_motions(figure); to++) {
      int blends = from < to && !md_blend(&player, from, to, MD(0.4));
      if (!blends) md_switch(&player, to, 1);
      for (int tick = blends ? 400 : 100; tick; tick--) {
        int kind = player.blended ? 4 : player.entering >= 0 ? 3 : player.fading ? 1 + !player.found : 0;
        uint32_t cost = step();
        worst[kind] = cost > worst[kind] ? cost : worst[kind];
        sum[kind] += cost, count[kind]++;
      }
    }
  for (int kind = 0; kind < 5; kind++) {
    write_number(names[kind][0], divided(sum[kind], count[kind] ? count[kind] : 1) * INSTRUCTIONS);
    write_number(names[kind][1], worst[kind] * INSTRUCTIONS);
  }
}

int main(void) {
  uint32_t *bottom = stack_top - STACK_BYTES / 4, *at = bottom;
  while (at < (uint32_t *)__builtin_frame_address(0) - 64) *at++ = PAINT;
  SYSTICK[1] = 0xFFFFFFu, SYSTICK[2] = 0, SYSTICK[0] = 5;
  uint32_t before = SYSTICK[2];
  for (uint32_t turn = 10000; turn; turn--) __asm__ volatile("nop\n nop\n nop\n nop\n nop\n nop\n");
  write_number("calibration", ((before - SYSTICK[2]) & 0xFFFFFFu) * INSTRUCTIONS);
  run();
  for (at = bottom; *at == PAINT;) at++;
  write_number("stack", (uint32_t)((char *)stack_top - (char *)at));
  write_number("player", sizeof player);
  call(0x18, (void *)0x20026);
  for (;;) {
  }
}

void reset(void) {
#ifdef __ARM_FP
  *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20;
#endif
  /* volatile, or the compiler calls memcpy and memset */
  for (volatile uint32_t *from = data_from, *to = data_begin; to < data_end;) *to++ = *from++;
  for (volatile uint32_t *to = bss_begin; to < bss_end;) *to++ = 0;
  main();
}
__attribute__((section(".vectors"), used)) static void *const vectors[] = {stack_top, (void *)reset, (void *)reset, (void *)reset};
int *__errno(void) {
  static int number;
  return &number;
}
