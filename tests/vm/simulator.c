// SPDX-License-Identifier: GPL-2.0-or-later
/* See simulator.h. */
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "simulator.h"

int module_load(const char *file, const char *parameters)
{
	int fd = open(file, O_RDONLY | O_CLOEXEC);
	int ret;

	if (fd < 0)
		return -errno;
	ret = syscall(SYS_finit_module, fd, parameters, 0) ? -errno : 0;
	close(fd);
	return ret;
}

int module_unload(const char *name)
{
	return syscall(SYS_delete_module, name, O_NONBLOCK) ? -errno : 0;
}

static int simulator_open(const char *file, int flags)
{
	char path[256];
	int fd;

	snprintf(path, sizeof(path), INCISE_SIM_DIR "/%s", file);
	fd = open(path, flags | O_CLOEXEC);
	return fd < 0 ? -errno : fd;
}

int simulator_write_bytes(const char *file, const void *bytes, size_t size)
{
	int fd = simulator_open(file, O_WRONLY);
	const char *from = bytes;
	ssize_t done = 0;

	if (fd < 0)
		return fd;
	do {
		done = write(fd, from, size);
		if (done > 0) {
			from += done;
			size -= done;
		}
	} while (done > 0 && size);
	done = done < 0 ? -errno : 0;
	close(fd);
	return done;
}

int simulator_write(const char *file, const char *command, ...)
{
	char text[8192];
	va_list rest;

	va_start(rest, command);
	vsnprintf(text, sizeof(text), command, rest);
	va_end(rest);
	return simulator_write_bytes(file, text, strlen(text));
}

int64_t simulator_number_of(const char *file, const char *number, const char *name)
{
	char text[16384] = "\n", key[64], *line, *end, *at;
	int fd = simulator_open(file, O_RDONLY);
	size_t size = 1;
	ssize_t got;

	if (fd < 0)
		return INT64_MIN;
	while ((got = read(fd, text + size, sizeof(text) - 1 - size)) > 0)
		size += got;
	close(fd);
	text[size] = '\0';
	line = text;
	if (number) {
		snprintf(key, sizeof(key), "\nnumber=%s ", number);
		line = strstr(text, key);
		if (!line)
			return INT64_MIN;
		end = strchr(line + 1, '\n');
		if (end)
			*end = '\0';
	}
	for (char *c = line; *c; c++)
		if (*c == '\n')
			*c = ' ';
	snprintf(key, sizeof(key), " %s=", name);
	at = strstr(line, key);
	return at ? strtoll(at + strlen(key), NULL, 10) : INT64_MIN;
}

int64_t simulator_number(const char *file, const char *name)
{
	return simulator_number_of(file, NULL, name);
}

long simulator_edges(struct incise_sim_edge *edge, size_t max)
{
	int fd = simulator_open("edges", O_RDONLY);
	size_t n = 0;
	ssize_t got;

	if (fd < 0)
		return fd;
	while (n < max && (got = read(fd, edge + n, (max - n) * sizeof(*edge))) > 0)
		n += got / sizeof(*edge);
	close(fd);
	return n;
}

/* The file of the chip with the simulator's label. */
static int chip_open(void)
{
	for (int i = 0; i < 16; i++) {
		struct gpiochip_info info = {0};
		char path[32];
		int fd;

		snprintf(path, sizeof(path), "/dev/gpiochip%d", i);
		fd = open(path, O_RDWR | O_CLOEXEC);
		if (fd < 0)
			continue;
		if (!ioctl(fd, GPIO_GET_CHIPINFO_IOCTL, &info) &&
		    !strcmp(info.label, INCISE_SIM_LABEL))
			return fd;
		close(fd);
	}
	return -ENODEV;
}

int lines_request(const unsigned int *lines, unsigned int n, uint64_t flags)
{
	struct gpio_v2_line_request request = {0};
	int chip = chip_open();
	int ret;

	if (chip < 0)
		return chip;
	for (unsigned int i = 0; i < n; i++)
		request.offsets[i] = lines[i];
	strcpy(request.consumer, "incise-test");
	request.config.flags = flags;
	request.num_lines = n;
	ret = ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request) ? -errno : request.fd;
	close(chip);
	return ret;
}

int lines_set(int fd, uint64_t mask, uint64_t levels)
{
	struct gpio_v2_line_values values = {.bits = levels, .mask = mask};

	return ioctl(fd, GPIO_V2_LINE_SET_VALUES_IOCTL, &values) ? -errno : 0;
}
