/* A figure of Motiondeck for a sketch: the player, its commands as lines of text, the figure, and the servos of its rig
   file. Include it in one file alone, or the figure is in memory twice. */
#ifndef MOTIONDECK_H
#define MOTIONDECK_H
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
#endif
