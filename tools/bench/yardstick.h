/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Fixed work that times are held against, so that one can be compared with that of another
 * day: if it was the machine that was slower, so were they. Three of them, as no machine is
 * slower evenly: where two processors share a core, what fills the core takes half as long
 * again while the other one is busy, and what waits for itself as long as before.
 *
 *   chain   each step waits for the one before: bound by latency
 *   wide    steps that do not wait for each other: bound by how many the core does at once
 *   memory  a walk at random through half a MiB: bound by the second cache
 *
 * Changing them makes older reports incomparable.
 */
#ifndef INCISE_YARDSTICK_H
#define INCISE_YARDSTICK_H

enum yardstick { YARDSTICK_CHAIN, YARDSTICK_WIDE, YARDSTICK_MEMORY, YARDSTICKS };

/* Time of some tens of microseconds of it, right after a run that is not timed. */
double yardstick_ns(enum yardstick yardstick);

#endif
