// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * GPIO lines by libgpiod 2.x; see gpio_lines.h.
 */
#include <errno.h>
#include <gpiod.h>
#include <stdlib.h>
#include <string.h>
#include "gpio_lines.h"

#define CONSUMER "incise"

struct gpio_lines {
	struct gpiod_line_request *request;
	int offset[INCISE_LINES];
	unsigned int in[INCISE_LINES]; /* offsets of the inputs */
	int name[INCISE_LINES];	       /* of them */
	size_t n_in;
};

int gpio_chip_called(const char *path, const char *name)
{
	struct gpiod_chip *chip = gpiod_chip_open(path);
	struct gpiod_chip_info *info = chip ? gpiod_chip_get_info(chip) : NULL;
	int is = chip && info ? 0 : -errno;

	if (info) {
		is = !strcmp(gpiod_chip_info_get_name(info), name) ||
		     !strcmp(gpiod_chip_info_get_label(info), name);
		gpiod_chip_info_free(info);
	}
	if (chip)
		gpiod_chip_close(chip);
	return is;
}

/* Add the settings of all wired lines. Returns 0, or -1 with errno. */
static int describe_gpio_v2(struct gpio_lines *lines, const int *line, unsigned int idle,
			    struct gpiod_line_settings *settings,
			    struct gpiod_line_config *config)
{
	for (int i = 0; i < INCISE_LINES; i++) {
		bool out = i < INCISE_LINES_OUT;
		unsigned int offset = (unsigned int)line[i];

		lines->offset[i] = line[i];
		if (line[i] < 0)
			continue;
		gpiod_line_settings_reset(settings);
		if (gpiod_line_settings_set_direction(settings,
						      out ? GPIOD_LINE_DIRECTION_OUTPUT
							  : GPIOD_LINE_DIRECTION_INPUT))
			return -1;
		if (out && gpiod_line_settings_set_output_value(
				   settings, idle >> i & 1 ? GPIOD_LINE_VALUE_ACTIVE
							   : GPIOD_LINE_VALUE_INACTIVE))
			return -1;
		if (gpiod_line_config_add_line_settings(config, &offset, 1, settings))
			return -1;
		if (out)
			continue;
		lines->name[lines->n_in] = i;
		lines->in[lines->n_in++] = offset;
	}
	return 0;
}

static struct gpiod_line_request *take_gpio_v2(struct gpio_lines *lines,
					       struct gpiod_chip *chip, const int *line,
					       unsigned int idle)
{
	struct gpiod_line_settings *settings = gpiod_line_settings_new();
	struct gpiod_line_config *config = gpiod_line_config_new();
	struct gpiod_request_config *asked = gpiod_request_config_new();
	struct gpiod_line_request *request = NULL;
	int code = ENOMEM;

	if (settings && config && asked) {
		gpiod_request_config_set_consumer(asked, CONSUMER);
		if (!describe_gpio_v2(lines, line, idle, settings, config))
			request = gpiod_chip_request_lines(chip, asked, config);
		code = errno;
	}
	if (asked)
		gpiod_request_config_free(asked);
	if (config)
		gpiod_line_config_free(config);
	if (settings)
		gpiod_line_settings_free(settings);
	errno = code;
	return request;
}

struct gpio_lines *gpio_lines_open(const char *path, const int *line, unsigned int idle)
{
	struct gpio_lines *lines = calloc(1, sizeof(*lines));
	struct gpiod_chip *opened = lines ? gpiod_chip_open(path) : NULL;
	int code;

	if (opened) {
		lines->request = take_gpio_v2(lines, opened, line, idle);
		code = errno;
		gpiod_chip_close(opened);
		errno = code;
	}
	if (lines && lines->request)
		return lines;
	code = errno;
	free(lines);
	errno = code;
	return NULL;
}

int gpio_lines_write(struct gpio_lines *lines, enum incise_actuator_line line, bool high)
{
	if (lines->offset[line] < 0)
		return 0;
	return gpiod_line_request_set_value(
		       lines->request, (unsigned int)lines->offset[line],
		       high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE)
		       ? -errno
		       : 0;
}

int gpio_lines_read(struct gpio_lines *lines)
{
	enum gpiod_line_value value[INCISE_LINES];
	int bits = 0;

	if (!lines->n_in)
		return 0;
	if (gpiod_line_request_get_values_subset(lines->request, lines->n_in, lines->in,
						 value))
		return -errno;
	for (size_t i = 0; i < lines->n_in; i++)
		if (value[i] == GPIOD_LINE_VALUE_ACTIVE)
			bits |= 1 << lines->name[i];
	return bits;
}

void gpio_lines_close(struct gpio_lines *lines)
{
	gpiod_line_request_release(lines->request);
	free(lines);
}
