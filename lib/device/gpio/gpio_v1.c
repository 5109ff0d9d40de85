// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * GPIO lines by libgpiod 1.x; see gpio_lines.h.
 */
#include <errno.h>
#include <gpiod.h>
#include <stdlib.h>
#include <string.h>
#include "gpio_lines.h"

#define CONSUMER "incise"

struct gpio_lines {
	struct gpiod_chip *chip;
	struct gpiod_line *out[INCISE_LINES_OUT];
	struct gpiod_line_bulk in;
	int name[INCISE_LINES]; /* of the inputs, in their order in the bulk */
};

static int take_outputs(struct gpio_lines *lines, const int *line, unsigned int idle)
{
	for (int i = 0; i < INCISE_LINES_OUT; i++) {
		if (line[i] < 0)
			continue;
		lines->out[i] = gpiod_chip_get_line(lines->chip, (unsigned int)line[i]);
		if (!lines->out[i] ||
		    gpiod_line_request_output(lines->out[i], CONSUMER, idle >> i & 1))
			return -1;
	}
	return 0;
}

static int take_inputs(struct gpio_lines *lines, const int *line)
{
	gpiod_line_bulk_init(&lines->in);
	for (int i = INCISE_LINES_OUT; i < INCISE_LINES; i++) {
		struct gpiod_line *in;

		if (line[i] < 0)
			continue;
		in = gpiod_chip_get_line(lines->chip, (unsigned int)line[i]);
		if (!in)
			return -1;
		lines->name[gpiod_line_bulk_num_lines(&lines->in)] = i;
		gpiod_line_bulk_add(&lines->in, in);
	}
	return gpiod_line_bulk_num_lines(&lines->in)
		       ? gpiod_line_request_bulk_input(&lines->in, CONSUMER)
		       : 0;
}

int gpio_chip_called(const char *path, const char *name)
{
	struct gpiod_chip *chip = gpiod_chip_open(path);
	int is;

	if (!chip)
		return -errno;
	is = !strcmp(gpiod_chip_name(chip), name) ||
	     !strcmp(gpiod_chip_label(chip), name);
	gpiod_chip_close(chip);
	return is;
}

struct gpio_lines *gpio_lines_open(const char *path, const int *line, unsigned int idle)
{
	struct gpio_lines *lines = calloc(1, sizeof(*lines));
	int code;

	if (!lines)
		return NULL;
	lines->chip = gpiod_chip_open(path);
	if (lines->chip && !take_outputs(lines, line, idle) && !take_inputs(lines, line))
		return lines;
	code = errno;
	gpio_lines_close(lines);
	errno = code;
	return NULL;
}

int gpio_lines_write(struct gpio_lines *lines, enum incise_actuator_line line, bool high)
{
	if (!lines->out[line])
		return 0;
	return gpiod_line_set_value(lines->out[line], high) ? -errno : 0;
}

int gpio_lines_read(struct gpio_lines *lines)
{
	unsigned int n = gpiod_line_bulk_num_lines(&lines->in);
	int value[INCISE_LINES], bits = 0;

	if (!n)
		return 0;
	if (gpiod_line_get_value_bulk(&lines->in, value))
		return -errno;
	for (unsigned int i = 0; i < n; i++)
		if (value[i])
			bits |= 1 << lines->name[i];
	return bits;
}

void gpio_lines_close(struct gpio_lines *lines)
{
	/* This releases the lines too. */
	if (lines->chip)
		gpiod_chip_close(lines->chip);
	free(lines);
}
