/* An empty loop with absolute deadlines in C: PERIOD (ns) TICKS PRIORITY; prints how late each tick was, ns, one a line.
   With a priority above 0 it asks for SCHED_FIFO and locked memory, as `play --realtime` does. */
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

int main(int count, char **arguments) {
  if (count != 4) return 2;
  long period = atol(arguments[1]), ticks = atol(arguments[2]), priority = atol(arguments[3]);
  long *late = calloc(ticks, sizeof *late);
  struct timespec next, now;
  if (priority > 0) {
    struct sched_param parameter = {.sched_priority = (int)priority};
    if (sched_setscheduler(0, SCHED_FIFO, &parameter) || mlockall(MCL_CURRENT | MCL_FUTURE)) return 3;
  }
  clock_gettime(CLOCK_MONOTONIC, &next);
  for (long tick = 0; tick < ticks; tick++) {
    next.tv_nsec += period;
    while (next.tv_nsec >= 1000000000L) next.tv_nsec -= 1000000000L, next.tv_sec++;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    clock_gettime(CLOCK_MONOTONIC, &now);
    late[tick] = (now.tv_sec - next.tv_sec) * 1000000000L + now.tv_nsec - next.tv_nsec;
  }
  for (long tick = 0; tick < ticks; tick++) printf("%ld\n", late[tick]);
  return 0;
}
