/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The parts of incise bench stability. They measure and report, and the reports are drawn.
 */
#ifndef INCISE_STABILITY_PARTS_H
#define INCISE_STABILITY_PARTS_H

#include "bench.h"
#include "closed_loop.h"

/* The device: light, in a loop of 1 kHz. */
#define DEVICE_KG 0.05
#define N_S2_PER_MM_KG 1e-3		    /* 1 kg = 1 N s²/m */
#define DEVICE (DEVICE_KG * N_S2_PER_MM_KG) /* N s²/mm */
#define PERIOD_S 1e-3

/* Scenes to lean on, by shape and force of stability_rest.c, which leans in so many ways. */
#define LEAN_SHAPES 5
#define LEAN_FORCES 9
#define LEAN_WAYS 5

struct lean_case {
	int shape, force;
	struct closed_loop loop; /* the device, the tracker and the actuator */
};

/* The widest swing of all leans, and the lean. */
struct lean_end {
	double swing_mm, shaken_mm; /* shaken: by noise */
	struct closed_loop loop;
};

/* Make the files of shapes and models, once before all plans. */
void lean_files(void);

/* Its plan, on a device of that damping, or NULL with the reason. */
struct incise_plan *lean_plan(const struct lean_case *lean, double gain,
			      double damping_N_s_mm, struct incise_scene **scene,
			      struct incise_error *err);

/* Lean with so many forces in each way, or until the first that swings. The swing is NaN where all runs left the surface. */
void lean_all(struct incise_plan *plan, const struct lean_case *lean, int sizes,
	      bool first, struct lean_end *most);

void stability_rest(struct bench_run *run);
void stability_integrators(struct bench_run *run);

extern const struct bench_table stability_rest_table, stability_integrator_table;

#endif
