/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Paper 2's procedure as a script for the scalpel of sim:mouse, at the top of a surface: cut along
 * and across, let it bleed, enlarge the cut with the handle, insert a tube.
 *
 *     blade  ╲__30 mm__╱   ╲_15 mm_╱         handle  ║ ↻        tube  ║
 *   0 s     1 s       2.6 s  4.1 s 5.2 s … 9 s      11 s   14 s      18 s … 22 s
 */
#ifndef INCISE_PROCEDURE_H
#define INCISE_PROCEDURE_H

#include <incise/plan.h>
#include <incise/rig.h>
#include <incise/scene.h>

#define PROCEDURE_S 22.0

/* The rig whose hand follows it: the same script gives the same ticks to the bit. */
#define PROCEDURE_RIG "sim:mouse,clock=simulated,tracker_noise_mm=0"

struct procedure {
	struct incise_rig *rig; /* PROCEDURE_RIG */
	struct incise_plan *plan;
	double handle_mm;
	struct incise_touch top;
	int64_t first_ns;
	bool started;
};

/* The hand is where the script begins. @rig of PROCEDURE_RIG; @plan of the scene. */
void procedure_begin(struct procedure *procedure, struct incise_rig *rig,
		     struct incise_plan *plan, const struct incise_scene *scene);

/* After each tick, in the thread that ticks: the hand goes on, and takes the next tool. */
void procedure_ticked(struct procedure *procedure, const struct incise_tick *tick);

#endif
