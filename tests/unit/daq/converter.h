/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A converter and two triggers in place of libiio: the functions of that name here are what
 * the objects under test are linked to. Attributes are text, as in sysfs.
 */
#ifndef INCISE_TEST_DAQ_CONVERTER_H
#define INCISE_TEST_DAQ_CONVERTER_H

#include <errno.h>
#include <iio.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ATTRIBUTES 12

struct attribute {
	const char *key; /* NULL: the end */
	char text[64];
	int error;  /* of writing it */
	bool stuck; /* a write changes nothing */
	bool line;  /* its end comes with it */
};

struct iio_channel {
	const char *id, *name;
	bool output, no_scan;
	long index;
	struct iio_data_format format;
	struct attribute attributes[ATTRIBUTES];
};

struct iio_device {
	const char *id, *name;
	bool trigger;
	int n_channels;
	struct iio_channel channels[9];
	struct attribute attributes[ATTRIBUTES];
};

struct iio_context {
	int error; /* of making one */
	int made;
	int n_devices;
	struct iio_device devices[4];
};

static struct iio_context world;

/* /dev/null is the file of the first one. */
static inline void world_reset(void)
{
	world = (struct iio_context){
		.n_devices = 3,
		.devices = {
			{.id = "null",
			 .name = "adc",
			 .n_channels = 3,
			 .channels = {{.id = "voltage0",
				       .output = true,
				       .format = {16, 12, 0, .repeat = 1}},
				      {.id = "voltage0",
				       .index = 0,
				       .format = {16, 12, 0, .repeat = 1},
				       .attributes = {{"scale", "1.220703125"},
						      {"offset", "-2048"}}},
				      {.id = "timestamp",
				       .index = 1,
				       .format = {64, 64, 0, true, .repeat = 1}}},
			 .attributes = {{"current_timestamp_clock", "realtime"},
					{"trigger/current_trigger", "own"},
					{"sampling_frequency", "1000"}}},
			{.id = "trigger0", .name = "own", .trigger = true},
			{.id = "trigger1",
			 .name = "timer",
			 .trigger = true,
			 .attributes = {{"sampling_frequency", "100"}}},
		}};
}

static struct attribute *attribute_of(struct attribute *all, const char *key)
{
	for (int i = 0; i < ATTRIBUTES && all[i].key; i++)
		if (!strcmp(all[i].key, key))
			return &all[i];
	return NULL;
}

static struct attribute *device_attribute(const struct iio_device *d, const char *key)
{
	return attribute_of(((struct iio_device *)d)->attributes, key);
}

static struct attribute *channel_attribute(const struct iio_channel *c, const char *key)
{
	return attribute_of(((struct iio_channel *)c)->attributes, key);
}

static ssize_t get(const struct attribute *a, char *to, size_t size)
{
	size_t length;

	if (!a)
		return -ENOENT;
	length = strnlen(a->text, size - 2);
	memcpy(to, a->text, length);
	strcpy(to + length, a->line ? "\n" : "");
	return (ssize_t)strlen(to) + 1;
}

static int get_double(const struct attribute *a, double *to)
{
	char *end;

	if (!a)
		return -ENOENT;
	*to = strtod(a->text, &end);
	return *end || end == a->text ? -EINVAL : 0;
}

static ssize_t set(struct attribute *a, const char *text)
{
	if (!a)
		return -ENOENT;
	if (a->error)
		return -a->error;
	if (!a->stuck)
		snprintf(a->text, sizeof(a->text), "%s", text);
	return (ssize_t)strlen(text) + 1;
}

struct iio_context *iio_create_local_context(void)
{
	errno = world.error;
	world.made += !world.error;
	return world.error ? NULL : &world;
}

void iio_context_destroy(struct iio_context *c)
{
	c->made--;
}

unsigned int iio_context_get_devices_count(const struct iio_context *c)
{
	return (unsigned int)c->n_devices;
}

struct iio_device *iio_context_get_device(const struct iio_context *c, unsigned int i)
{
	return (struct iio_device *)&c->devices[i];
}

struct iio_device *iio_context_find_device(const struct iio_context *c, const char *name)
{
	for (int i = 0; i < c->n_devices; i++)
		if (!strcmp(c->devices[i].id, name) ||
		    (c->devices[i].name && !strcmp(c->devices[i].name, name)))
			return (struct iio_device *)&c->devices[i];
	return NULL;
}

const char *iio_device_get_id(const struct iio_device *d)
{
	return d->id;
}

const char *iio_device_get_name(const struct iio_device *d)
{
	return d->name;
}

bool iio_device_is_trigger(const struct iio_device *d)
{
	return d->trigger;
}

unsigned int iio_device_get_channels_count(const struct iio_device *d)
{
	return (unsigned int)d->n_channels;
}

struct iio_channel *iio_device_get_channel(const struct iio_device *d, unsigned int i)
{
	return (struct iio_channel *)&d->channels[i];
}

struct iio_channel *iio_device_find_channel(const struct iio_device *d, const char *id,
					    bool output)
{
	for (int i = 0; i < d->n_channels; i++)
		if (!strcmp(d->channels[i].id, id) && d->channels[i].output == output)
			return (struct iio_channel *)&d->channels[i];
	return NULL;
}

const char *iio_device_find_attr(const struct iio_device *d, const char *key)
{
	const struct attribute *a = device_attribute(d, key);

	return a ? a->key : NULL;
}

ssize_t iio_device_attr_read(const struct iio_device *d, const char *key, char *to,
			     size_t size)
{
	return get(device_attribute(d, key), to, size);
}

int iio_device_attr_read_double(const struct iio_device *d, const char *key, double *to)
{
	return get_double(device_attribute(d, key), to);
}

ssize_t iio_device_attr_write(const struct iio_device *d, const char *key,
			      const char *text)
{
	return set(device_attribute(d, key), text);
}

ssize_t iio_device_buffer_attr_write(const struct iio_device *d, const char *key,
				     const char *text)
{
	return set(device_attribute(d, key), text);
}

int iio_device_set_trigger(const struct iio_device *d, const struct iio_device *trigger)
{
	ssize_t rc = set(device_attribute(d, "trigger/current_trigger"), trigger->name);

	return rc < 0 ? (int)rc : 0;
}

const char *iio_channel_get_id(const struct iio_channel *c)
{
	return c->id;
}

const char *iio_channel_get_name(const struct iio_channel *c)
{
	return c->name;
}

bool iio_channel_is_output(const struct iio_channel *c)
{
	return c->output;
}

bool iio_channel_is_scan_element(const struct iio_channel *c)
{
	return !c->no_scan;
}

long iio_channel_get_index(const struct iio_channel *c)
{
	return c->index;
}

const struct iio_data_format *iio_channel_get_data_format(const struct iio_channel *c)
{
	return &c->format;
}

const char *iio_channel_find_attr(const struct iio_channel *c, const char *key)
{
	const struct attribute *a = channel_attribute(c, key);

	return a ? a->key : NULL;
}

ssize_t iio_channel_attr_read(const struct iio_channel *c, const char *key, char *to,
			      size_t size)
{
	return get(channel_attribute(c, key), to, size);
}

int iio_channel_attr_read_double(const struct iio_channel *c, const char *key, double *to)
{
	return get_double(channel_attribute(c, key), to);
}

ssize_t iio_channel_attr_write(const struct iio_channel *c, const char *key,
			       const char *text)
{
	return set(channel_attribute(c, key), text);
}

#endif
