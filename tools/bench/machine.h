/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The machine that a bench ran on, and the build: what its figures are worth nothing without.
 */
#ifndef INCISE_MACHINE_H
#define INCISE_MACHINE_H

#include <jansson.h>
#include <stdbool.h>

struct machine {
	char version[32]; /* of incise */
	char compiler[128], flags[256];
	char cpu[128], vectors[16];
	char kernel[200];
	char hypervisor[32]; /* empty: none that it tells of */
	char governor[32];   /* of the processor that is timed on; empty: none */
	char date[32];	     /* "2026-11-21T20:49:33Z" */
	bool realtime;	     /* a kernel with PREEMPT_RT */
	int processors;	     /* that are granted to this process */
	int timed_on;
	double memory_MB, load_average;
};

/* Call it first: the load average is to be that of before. */
void machine_init(struct machine *m);

/* An object, as in incise-bench(1). */
json_t *machine_json(const struct machine *m);

#endif
