/* The player. Its limits are proven for sums and products that are rounded one by one, which GCC fuses where it can. */
#ifdef __GNUC__
#pragma GCC optimize("fp-contract=off")
#endif
#include "player.inc"
#include "goals.inc"
