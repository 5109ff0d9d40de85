/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The lines of one GPIO chip, as levels, over libgpiod: gpio_v1.c for 1.x, gpio_v2.c for 2.x,
 * which have nothing in common.
 */
#ifndef INCISE_GPIO_LINES_H
#define INCISE_GPIO_LINES_H

#include <stdbool.h>
#include <incise/backend.h>

#define GPIO_PATH_MAX 64
#define GPIO_SEVERAL_MAX 200

struct gpio_lines;

/* Whether the chip with this path has a name or label: 1, 0, or a negative errno. */
int gpio_chip_called(const char *path, const char *name);

/*
 * Find the path of the one chip with this name, label or path. Returns 0, -ENOENT, -EACCES, -ENOTUNIQ: several,
 * whose paths are listed.
 */
int gpio_chip_find(const char *name, char path[GPIO_PATH_MAX],
		   char several[GPIO_SEVERAL_MAX]);

/*
 * Request the lines of a chip; the first INCISE_LINES_OUT are outputs, at the levels of @idle.
 *
 * @path: of the chip
 * @line: offsets, -1 without a line, in the order of enum incise_actuator_line
 * @idle: bits 1 << line of outputs that start high
 * Returns NULL with errno: ENOENT (no such chip), EBUSY (a line is taken), EINVAL (no such
 * line), EACCES, ENOMEM …
 */
struct gpio_lines *gpio_lines_open(const char *path, const int *line, unsigned int idle);

/* Set an output's level. Returns 0 or a negative errno. One system call. */
int gpio_lines_write(struct gpio_lines *lines, enum incise_actuator_line line, bool high);

/* Returns levels of the inputs, bits 1 << line, or a negative errno. At most one system call. */
int gpio_lines_read(struct gpio_lines *lines);

/* The lines keep their levels if the chip's driver does so. */
void gpio_lines_close(struct gpio_lines *lines);

#endif
