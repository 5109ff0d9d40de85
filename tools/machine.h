/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The machine that a bench ran on: what its figures are worth nothing without.
 */
#ifndef INCISE_MACHINE_H
#define INCISE_MACHINE_H

#include <jansson.h>

struct machine {
	char cpu[128], compiler[128], kernel[200], vectors[16];
};

void machine_init(struct machine *m);

/* {"cpu", "compiler", "kernel", "vectors"} */
json_t *machine_json(const struct machine *m);

#endif
