/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise_sim.ko from user space: loading it, its files in debugfs (driver/sim/incise_sim.h
 * says what they take) and its lines through the GPIO character device. Functions return 0
 * or what they say, or a negative errno.
 */
#ifndef INCISE_VM_SIMULATOR_H
#define INCISE_VM_SIMULATOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../../driver/sim/incise_sim.h"

/* Load a module from a file, with parameters "name=value ..."; unload it, never by force. */
int module_load(const char *file, const char *parameters);
int module_unload(const char *name);

/* Write a command to a file of the simulator: "inputs", "carriage", "adc/control" ... */
__attribute__((format(printf, 2, 3))) int simulator_write(const char *file,
							  const char *command, ...);
int simulator_write_bytes(const char *file, const void *bytes, size_t size);

/* The number after "name=" in a file; INT64_MIN where there is none. */
int64_t simulator_number(const char *file, const char *name);

/* The same on the line of a file that starts with "number=NUMBER". */
int64_t simulator_number_of(const char *file, const char *number, const char *name);

/* Drains up to @max edges; returns how many there were. */
long simulator_edges(struct incise_sim_edge *edge, size_t max);

/*
 * Requests lines; returns a file descriptor. @flags are GPIO_V2_LINE_FLAG_*. Bits of masks
 * and levels are in the order of @lines.
 */
int lines_request(const unsigned int *lines, unsigned int n, uint64_t flags);
int lines_set(int fd, uint64_t mask, uint64_t levels);

#endif
