// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * GPIO lines by the second character-device interface of Linux (5.10 on); see gpio_lines.h. All lines
 * are one request, whose number i is bit i of its values.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include <linux/gpio.h>
#include "gpio_lines.h"

struct gpio_lines {
	int fd;
	uint64_t bit[INCISE_LINES]; /* of the request's values; 0 without a line */
	uint64_t in;		    /* of all inputs */
};

/* Returns a file, or -1 with errno. */
static int open_chip(const char *path, struct gpiochip_info *info)
{
	int fd = open(path, O_RDWR | O_CLOEXEC | O_NONBLOCK);

	if (fd < 0 || ioctl(fd, GPIO_GET_CHIPINFO_IOCTL, info) >= 0)
		return fd;
	close(fd);
	errno = ENODEV;
	return -1;
}

int gpio_chip_called(const char *path, const char *name)
{
	struct gpiochip_info info;
	int fd = open_chip(path, &info);

	if (fd < 0)
		return -errno;
	close(fd);
	return !strcmp(info.name, name) || !strcmp(info.label, name);
}

/* Outputs are an exception among inputs: their direction and their level are attributes. */
static void describe_lines(struct gpio_lines *lines, const int *line, unsigned int idle,
			   struct gpio_v2_line_request *request)
{
	struct gpio_v2_line_config *config = &request->config;
	struct gpio_v2_line_config_attribute *out = &config->attrs[0],
					     *level = &config->attrs[1];

	strcpy(request->consumer, "incise");
	config->flags = GPIO_V2_LINE_FLAG_INPUT;
	config->num_attrs = 2;
	out->attr.id = GPIO_V2_LINE_ATTR_ID_FLAGS;
	out->attr.flags = GPIO_V2_LINE_FLAG_OUTPUT;
	level->attr.id = GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES;
	for (int i = 0; i < INCISE_LINES; i++) {
		if (line[i] < 0)
			continue;
		lines->bit[i] = UINT64_C(1) << request->num_lines;
		request->offsets[request->num_lines++] = (uint32_t)line[i];
		if (i >= INCISE_LINES_OUT) {
			lines->in |= lines->bit[i];
			continue;
		}
		out->mask |= lines->bit[i];
		if (idle >> i & 1)
			level->attr.values |= lines->bit[i];
	}
	level->mask = out->mask;
}

struct gpio_lines *gpio_lines_open(const char *path, const int *line, unsigned int idle)
{
	struct gpio_v2_line_request request = {0};
	struct gpiochip_info info;
	struct gpio_lines *lines = calloc(1, sizeof(*lines));
	int chip = lines ? open_chip(path, &info) : -1;
	int code = errno;

	if (chip >= 0) {
		describe_lines(lines, line, idle, &request);
		code = ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request) < 0 ? errno : 0;
		close(chip);
		lines->fd = request.fd;
		if (!code)
			return lines;
	}
	free(lines);
	errno = code;
	return NULL;
}

int gpio_lines_write(struct gpio_lines *lines, enum incise_actuator_line line, bool high)
{
	struct gpio_v2_line_values values = {.mask = lines->bit[line],
					     .bits = high ? lines->bit[line] : 0};

	if (!values.mask)
		return 0;
	return ioctl(lines->fd, GPIO_V2_LINE_SET_VALUES_IOCTL, &values) < 0 ? -errno : 0;
}

int gpio_lines_read(struct gpio_lines *lines)
{
	struct gpio_v2_line_values values = {.mask = lines->in};
	int bits = 0;

	if (!values.mask)
		return 0;
	if (ioctl(lines->fd, GPIO_V2_LINE_GET_VALUES_IOCTL, &values) < 0)
		return -errno;
	for (int i = INCISE_LINES_OUT; i < INCISE_LINES; i++)
		if (values.bits & lines->bit[i])
			bits |= 1 << i;
	return bits;
}

void gpio_lines_close(struct gpio_lines *lines)
{
	close(lines->fd);
	free(lines);
}
