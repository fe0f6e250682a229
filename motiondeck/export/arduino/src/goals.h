/* Goals of a computer, which plays the board as a rig: a line for each tick, beside the commands of commands.h.

   A line is a mark, a number for each joint, one more, and the lowest 24 bits of the CRC-32 of all letters before. A number
   has four letters from '?' to '~' of 6 bits each, the lowest first; an angle is counted in steps of MD_STEP from the
   middle, and the lowest bit is an alert. 0 is an angle that was not measured.

       >  goals; the number is 1 while the computer's emergency stop is on
       <  the answer, after the tick that has taken them: angles, and MD_TAKEN and what else holds

   The goals pass the limits of the joints as those of a motion do. The first ones are come to slowly. */
#ifndef MOTIONDECK_GOALS_H
#define MOTIONDECK_GOALS_H
#include "player.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MD_STEP 20e-6f /* rad */
#ifdef MD_FIXED
#define MD_UNKNOWN MD(63) /* an angle that was not measured, or what is further away */
#else
#define MD_UNKNOWN 80.0f
#endif
enum { MD_TAKEN = 1, MD_OWN_STOP = 2 }; /* goals are taken; the emergency stop is on, and not for the computer's */
enum { MD_LINE = 4 * MD_MOST_JOINTS + 10 }; /* letters of a line with its end */

typedef struct {
  int taken;    /* 1: until the first goals come, 2: since then, 0: not at all */
  int off;      /* whether the servos are to be without torque */
  int asked;    /* whether an answer is due */
  int stopping; /* whether the emergency stop is on for the computer's */
  md_number within, silent; /* s that goals may be missing, and that they are */
  md_number goals[MD_MOST_JOINTS];
} md_goals;

/* Takes goals from now on, or (within 0) no longer: the joints brake and are held. They are so too when none have come for
   so many s. */
int md_follow(md_player *p, md_goals *g, md_number within);
/* Whether a line is one of goals, and whole. */
int md_take_goals(md_player *p, md_goals *g, const char *line);
/* As md_step, for goals where they are taken. */
const md_number *md_step_towards(md_player *p, md_goals *g);
/* Carries out what md_command does, besides: goals SECONDS, off and on. While goals are taken no motion is played. */
int md_command_among(md_player *p, md_goals *g, const char *line, char *reply, int size);
/* Writes the answer, of MD_LINE letters at most: the angles of the joints, MD_UNKNOWN for one that is not, and an alert of each
   (or NULL). */
void md_answer(md_player *p, md_goals *g, const md_number *angles, const uint8_t *alerts, char *line);

#ifdef __cplusplus
}
#endif
#endif
