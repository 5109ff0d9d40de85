// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An A/D converter of Linux IIO, set up for sampling; see iio_source.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "iio_rate.h"
#include "iio_source.h"
#include "iio_trigger.h"

#define CODE_BITS_MAX 31 /* of incise_force_sample.code */

struct iio_channel *iio_source_voltage(const struct iio_device *device, int channel)
{
	unsigned int n = iio_device_get_channels_count(device);
	char id[24];
	size_t length;

	snprintf(id, sizeof(id), "voltage%d", channel);
	length = strlen(id);
	for (unsigned int i = 0; i < n; i++) {
		struct iio_channel *c = iio_device_get_channel(device, i);
		const char *is = iio_channel_get_id(c);

		if (!iio_channel_is_output(c) && iio_channel_is_scan_element(c) &&
		    !strncmp(is, id, length) && (!is[length] || is[length] == '-'))
			return c;
	}
	return NULL;
}

bool iio_source_volts(const struct iio_channel *channel, const struct iio_format *format,
		      double *full_scale_V, double *offset_V)
{
	double scale_mV = 0, offset = 0;

	if (iio_channel_attr_read_double(channel, "scale", &scale_mV) < 0 ||
	    !isfinite(scale_mV) || scale_mV <= 0)
		return false;
	if (iio_channel_attr_read_double(channel, "offset", &offset) < 0 ||
	    !isfinite(offset))
		offset = 0;
	/* Codes of a signed channel were moved up by half the range. */
	if (format->is_signed)
		offset -= ldexp(1, (int)format->bits - 1);
	*full_scale_V = ldexp(scale_mV, (int)format->bits) / 1e3;
	*offset_V = offset * scale_mV / 1e3;
	return true;
}

/* What there is, for a message: "incise-sim-adc (iio:device0), …". */
static void list(const struct iio_context *context, bool triggers, char *text,
		 size_t size)
{
	unsigned int n = iio_context_get_devices_count(context);
	size_t used = 0;

	text[0] = '\0';
	for (unsigned int i = 0; i < n && used < size; i++) {
		const struct iio_device *device = iio_context_get_device(context, i);
		const char *name = iio_device_get_name(device);

		if (iio_device_is_trigger(device) != triggers)
			continue;
		used += (size_t)snprintf(text + used, size - used, "%s%s (%s)",
					 used ? ", " : "", name ? name : "?",
					 iio_device_get_id(device));
	}
	if (!*text)
		snprintf(text, size, "none");
}

static int find_device(struct iio_source *s, const char *name, struct incise_error *err)
{
	char known[200];

	s->context = iio_create_local_context();
	if (!s->context)
		return incise_error_set(
			err, errno ? errno : ENODEV,
			"%s: this kernel shows no IIO devices: %s; load the "
			"driver of your converter",
			s->where, strerror(errno));
	s->device = iio_context_find_device(s->context, name);
	if (s->device && !iio_device_is_trigger(s->device))
		return 0;
	list(s->context, false, known, sizeof(known));
	return incise_error_set(err, ENODEV,
				"%s: there is no IIO device \"%.60s\"; there are: %s",
				s->where, name, known);
}

/* A line for what was refused; @what: "set its clock". */
static int refused(const struct iio_source *s, int rc, const char *what,
		   struct incise_error *err)
{
	const char *id = iio_device_get_id(s->device);

	if (rc == -EACCES || rc == -EPERM)
		return incise_error_set(err, EACCES,
					"%s: may not %s of %s; join the group that may "
					"(udev/ has the rules), or be root",
					s->where, what, id);
	if (rc == -EBUSY)
		return incise_error_set(err, EBUSY,
					"%s: %s is in use by another program; end it",
					s->where, id);
	return incise_error_set(err, -rc, "%s: cannot %s of %s: %s", s->where, what, id,
				strerror(-rc));
}

/*
 * The file of a device opens once at a time: so it is known whether somebody samples. What
 * a program left running that was killed is ended, as nothing can be set meanwhile. The file
 * stays open: it is what samples are read from.
 */
static int check_alone(struct iio_source *s, struct incise_error *err)
{
	char path[80];

	snprintf(path, sizeof(path), "/dev/%.60s", iio_device_get_id(s->device));
	s->fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
	if (s->fd < 0)
		return refused(s, -errno, "open the file", err);
	if (iio_device_buffer_attr_write(s->device, "enable", "0") == -EACCES)
		return refused(s, -EACCES, "change the settings", err);
	return 0;
}

static int take_channels(struct iio_source *s, struct incise_error *err)
{
	const char *id = iio_device_get_id(s->device);
	const struct iio_data_format *data;

	s->voltage = iio_source_voltage(s->device, s->setup.channel);
	if (!s->voltage)
		return incise_error_set(
			err, ENODEV,
			"%s: %s has no voltage%d that a buffer can have; see `ls "
			"/sys/bus/iio/devices/%s/scan_elements` and set "
			"force_setup.channel",
			s->where, id, s->setup.channel, id);
	s->stamp = iio_device_find_channel(s->device, "timestamp", false);
	if (!s->stamp || !iio_channel_is_scan_element(s->stamp) ||
	    iio_format_of(&s->stamp_format, iio_channel_get_data_format(s->stamp), 64))
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: %s has no time stamps in its buffer, so losses "
			"could not be told; use another converter",
			s->where, id);
	data = iio_channel_get_data_format(s->voltage);
	if (iio_format_of(&s->format, data, CODE_BITS_MAX))
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: samples of %s are %u bits of %u, shifted by %u, "
			"%u-fold: only 1 to %d bits of 8, 16, 32 or 64, once, are "
			"read",
			s->where, id, data->bits, data->length, data->shift, data->repeat,
			CODE_BITS_MAX);
	return 0;
}

static int set_clock(struct iio_source *s, struct incise_error *err)
{
	static const char key[] = "current_timestamp_clock";
	char is[40] = "";
	ssize_t rc = iio_device_attr_write(s->device, key, "monotonic");

	if (rc < 0)
		return refused(s, (int)rc, "set the clock of time stamps", err);
	rc = iio_device_attr_read(s->device, key, is, sizeof(is));
	/* Linux 6.1 gives a NUL behind the end of the line, of which libiio takes one. */
	is[strcspn(is, "\n")] = '\0';
	if (rc < 0 || strcmp(is, "monotonic") != 0)
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: time stamps of %s stay on the clock \"%s\", and "
			"cannot be put beside the tracker's; use another "
			"converter",
			s->where, iio_device_get_id(s->device), is);
	return 0;
}

static int set_volts(struct iio_source *s, struct incise_error *err)
{
	if (iio_source_volts(s->voltage, &s->format, &s->full_scale_V, &s->offset_V))
		return 0;
	if (s->setup.full_scale_V <= 0)
		return incise_error_set(
			err, EINVAL,
			"%s: the driver of %s does not say what its codes "
			"stand for; set force_setup.full_scale_V",
			s->where, iio_device_get_id(s->device));
	s->full_scale_V = s->setup.full_scale_V;
	s->offset_V = s->format.is_signed ? -s->full_scale_V / 2 : 0;
	return 0;
}

/* The trigger that @name names; @rc 0, or of setting it. */
static int use_trigger(struct iio_source *s, const char *name)
{
	struct iio_device *trigger = iio_context_find_device(s->context, name);
	int rc;

	if (!trigger || !iio_device_is_trigger(trigger))
		return -ENODEV;
	rc = iio_device_set_trigger(s->device, trigger);
	if (rc < 0)
		return rc;
	s->trigger_set = true;
	snprintf(s->trigger_used, sizeof(s->trigger_used), "%s", name);
	return 0;
}

static int use_named(struct iio_source *s, struct incise_error *err)
{
	char known[200];
	int rc = use_trigger(s, s->setup.trigger);

	if (rc == -ENODEV) {
		list(s->context, true, known, sizeof(known));
		return incise_error_set(err, ENODEV,
					"%s: there is no trigger \"%s\"; there are: %s",
					s->where, s->setup.trigger, known);
	}
	if (rc == -EINVAL)
		return incise_error_set(err, EINVAL,
					"%s: %s does not take the trigger \"%s\"; leave "
					"force_setup.trigger out",
					s->where, iio_device_get_id(s->device),
					s->setup.trigger);
	return rc ? refused(s, rc, "set the trigger", err) : 0;
}

/* The named one, ours, or the one that is set; a device without triggers has none. */
static int set_trigger(struct iio_source *s, struct incise_error *err)
{
	static const char key[] = "trigger/current_trigger";
	bool has = iio_device_attr_read(s->device, key, s->trigger_before,
					sizeof(s->trigger_before)) >= 0;

	if (*s->setup.trigger)
		return use_named(s, err);
	if (!has)
		return 0;
	if (*s->trigger && !use_trigger(s, s->trigger)) {
		iio_trigger_sweep(s->trigger_folder);
		return 0;
	}
	/* It takes none but its own. */
	iio_trigger_remove(s->trigger_folder, s->trigger);
	*s->trigger = '\0';
	if (!*s->trigger_before && s->trigger_refused)
		return incise_error_set(
			err, EACCES,
			"%s: nothing starts the conversions of %s, and you may make no "
			"trigger; as root: mkdir %s/incise, and name "
			"force_setup.trigger = \"incise\"",
			s->where, iio_device_get_id(s->device), s->trigger_folder);
	if (!*s->trigger_before)
		return incise_error_set(
			err, ENODEV,
			"%s: nothing starts the conversions of %s; `modprobe "
			"iio-trig-hrtimer` where the kernel has it, or name "
			"force_setup.trigger",
			s->where, iio_device_get_id(s->device));
	snprintf(s->trigger_used, sizeof(s->trigger_used), "%s", s->trigger_before);
	return 0;
}

/* Contexts show what there was when they were made. */
static int with_own_trigger(struct iio_source *s, const char *name,
			    struct incise_error *err)
{
	char before[64];
	int rc;

	if (*s->setup.trigger ||
	    iio_device_attr_read(s->device, "trigger/current_trigger", before,
				 sizeof(before)) < 0)
		return 0;
	rc = iio_trigger_make(s->trigger_folder, s->trigger, sizeof(s->trigger));
	s->trigger_refused = rc == -EACCES || rc == -EPERM;
	if (rc)
		return 0;
	iio_context_destroy(s->context);
	s->context = NULL;
	return find_device(s, name, err);
}

int iio_source_open(struct iio_source *s, const char *name, struct incise_error *err)
{
	const struct iio_device *trigger;
	int rc = find_device(s, name, err);

	rc = rc ? rc : check_alone(s, err);
	rc = rc ? rc : with_own_trigger(s, name, err);
	rc = rc ? rc : take_channels(s, err);
	rc = rc ? rc : set_volts(s, err);
	rc = rc ? rc : set_clock(s, err);
	rc = rc ? rc : set_trigger(s, err);
	if (rc)
		return rc;
	trigger = *s->trigger_used ? iio_context_find_device(s->context, s->trigger_used)
				   : NULL;
	return iio_rate_set(s, trigger, err);
}

void iio_source_close(struct iio_source *s)
{
	if (s->trigger_set) {
		/* An empty line takes it off. */
		const char *before = *s->trigger_before ? s->trigger_before : "\n";

		s->trigger_set =
			iio_device_attr_write(s->device, "trigger/current_trigger",
					      before) < 0; /* the device is gone */
	}
	if (s->context)
		iio_context_destroy(s->context);
	if (s->fd >= 0)
		close(s->fd);
	iio_trigger_remove(s->trigger_folder, s->trigger);
}
