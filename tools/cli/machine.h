/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The machine and the build of a bench, without which its figures are worth nothing.
 */
#ifndef INCISE_MACHINE_H
#define INCISE_MACHINE_H

#include <jansson.h>

/* The first line of a small file that begins with @key, without it; else unchanged. */
void machine_line(const char *path, const char *key, char *line, int size);

/* An object, as in incise-bench(1). Call it first, to get the load average before the run. */
json_t *machine_json(void);

/* The processor that variants are timed on: the last one, as interrupts are more often the
 * first one's. */
int machine_cpu(void);

#endif
