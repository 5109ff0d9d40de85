// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rate of an IIO converter; see iio_rate.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "iio_rate.h"

#define KEY "sampling_frequency"
/* What is taken for the rate that was asked for: converters divide a clock of theirs. */
#define TOLERANCE 0.01

/* One place that has a rate: a device, or a channel of one. */
struct place {
	const struct iio_device *device;
	const struct iio_channel *channel;
};

static bool there(const struct place *place)
{
	return place->channel ? iio_channel_find_attr(place->channel, KEY) != NULL
			      : place->device &&
					iio_device_find_attr(place->device, KEY) != NULL;
}

static int set(const struct place *place, double rate_hz)
{
	long long mHz = llround(rate_hz * 1e3);
	char text[40];
	ssize_t rc;

	/* Without "." where there is no need: some drivers take whole numbers only. */
	if (mHz % 1000)
		snprintf(text, sizeof(text), "%lld.%03lld", mHz / 1000, mHz % 1000);
	else
		snprintf(text, sizeof(text), "%lld", mHz / 1000);
	rc = place->channel ? iio_channel_attr_write(place->channel, KEY, text)
			    : iio_device_attr_write(place->device, KEY, text);
	return rc < 0 ? (int)rc : 0;
}

static double get(const struct place *place)
{
	double rate_hz = 0;
	int rc = place->channel
			 ? iio_channel_attr_read_double(place->channel, KEY, &rate_hz)
			 : iio_device_attr_read_double(place->device, KEY, &rate_hz);

	return rc < 0 || !isfinite(rate_hz) ? 0 : rate_hz;
}

/* "5000 10000 20000", where the driver tells. */
static void available(const struct place *place, char *text, size_t size)
{
	ssize_t rc = place->channel ? iio_channel_attr_read(place->channel,
							    KEY "_available", text, size)
				    : iio_device_attr_read(place->device,
							   KEY "_available", text, size);

	if (rc < 0)
		snprintf(text, size, "unknown");
	text[size - 1] = '\0';
}

int iio_rate_set(struct iio_source *s, const struct iio_device *trigger,
		 struct incise_error *err)
{
	struct place of_trigger = {trigger, NULL}, own = {s->device, NULL}, *at = &own;
	double asked = s->setup.rate_hz;
	char known[160];
	int rc;

	if (!there(&own))
		own.channel = s->voltage;
	if (there(&of_trigger))
		at = &of_trigger;
	else if (!there(&own))
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: neither %s nor its trigger has a rate; name a timer in "
			"force_setup.trigger",
			s->where, iio_device_get_id(s->device));
	rc = set(at, asked);
	if (rc == -EACCES)
		return incise_error_set(
			err, EACCES,
			"%s: may not set the rate of %s; join the group that "
			"may (udev/ has the rules), or be root",
			s->where, iio_device_get_id(at->device));
	s->rate_hz = get(at);
	if (fabs(s->rate_hz - asked) > asked * TOLERANCE) {
		available(at, known, sizeof(known));
		return incise_error_set(
			err, EINVAL,
			"%s: %s does not take %.9g Hz%s%s and runs at %.9g Hz; set "
			"force_setup.rate_hz (available: %s)",
			s->where, iio_device_get_id(at->device), asked, rc ? ": " : "",
			rc ? strerror(-rc) : "", s->rate_hz, known);
	}
	/* A trigger cannot be faster than the converter's own rate. */
	if (at == &own || !there(&own))
		return 0;
	set(&own, asked);
	if (get(&own) < s->rate_hz * (1 - TOLERANCE)) {
		available(&own, known, sizeof(known));
		return incise_error_set(
			err, EINVAL,
			"%s: %s converts at %.9g Hz, its trigger at %.9g Hz; set "
			"force_setup.rate_hz (available: %s)",
			s->where, iio_device_get_id(s->device), get(&own), s->rate_hz,
			known);
	}
	return 0;
}
