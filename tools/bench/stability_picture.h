/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Pictures of incise bench stability: NAME-map, NAME-guard, NAME-integrators.
 */
#ifndef INCISE_STABILITY_PICTURE_H
#define INCISE_STABILITY_PICTURE_H

#include "bench_guard.h"
#include "bench_integrators.h"
#include "ratios.h"

/* Simulated limits over the curves of theory. */
void stability_picture_map(const struct ratios *exact, const char *folder,
			   const char *name);

/* How far and how hard with the guard; which caps are bounded behind a late actuator. */
void stability_picture_guard(const struct guard_bench *bench, const char *folder,
			     const char *name);

/* Error over run time. */
void stability_picture_integrators(const struct integrator_bench *bench,
				   const char *folder, const char *name);

#endif
