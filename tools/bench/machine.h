/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The machine that a bench ran on, and the build: what its figures are worth nothing without.
 */
#ifndef INCISE_MACHINE_H
#define INCISE_MACHINE_H

#include <jansson.h>
/* An object, as in incise-bench(1). Call it first: the load average is to be that of before. */
json_t *machine_json(void);

#endif
