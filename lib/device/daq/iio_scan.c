// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Which IIO devices have a voltage that can be sampled into a buffer. Attributes are read
 * only.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "iio_force.h"
#include "iio_source.h"

#define KEY "sampling_frequency"

/* How many of its channels would do; the first one in @first. */
static int voltages(const struct iio_device *device, struct iio_channel **first)
{
	unsigned int n = iio_device_get_channels_count(device);
	int count = 0;

	for (unsigned int i = 0; i < n; i++) {
		struct iio_channel *c = iio_device_get_channel(device, i);

		if (iio_channel_is_output(c) || !iio_channel_is_scan_element(c) ||
		    strncmp(iio_channel_get_id(c), "voltage", 7) != 0)
			continue;
		if (!count++)
			*first = c;
	}
	return count;
}

/* Two devices of one name are told apart by their number. */
static bool named_once(const struct iio_context *context, const char *name)
{
	unsigned int n = iio_context_get_devices_count(context);
	int count = 0;

	for (unsigned int i = 0; i < n; i++) {
		const char *other =
			iio_device_get_name(iio_context_get_device(context, i));

		count += other && !strcmp(other, name);
	}
	return count == 1;
}

static void add_text(struct incise_scan_device *device, const struct iio_device *iio,
		     const struct iio_channel *channel, const char *attribute,
		     const char *key)
{
	char text[100];

	if (iio_device_attr_read(iio, attribute, text, sizeof(text)) >= 0 ||
	    iio_channel_attr_read(channel, attribute, text, sizeof(text)) >= 0)
		incise_scan_tell(device, key, "%.99s", text);
}

static void describe(const struct iio_context *context, const struct iio_device *iio,
		     const struct iio_channel *channel, int channels,
		     struct incise_scan_device *device)
{
	const char *id = iio_device_get_id(iio), *name = iio_device_get_name(iio);
	const struct iio_data_format *data = iio_channel_get_data_format(channel);
	double full_scale_V, offset_V;
	struct iio_format format;
	bool stamped = iio_device_find_channel(iio, "timestamp", false);
	bool plain = !iio_format_of(&format, data, 31);

	*device = (struct incise_scan_device){0};
	snprintf(device->device, sizeof(device->device), "iio:%.90s",
		 name && named_once(context, name) ? name : id);
	snprintf(device->what, sizeof(device->what),
		 "IIO converter %.40s, %d channel%s of %u bits", name ? name : id,
		 channels, channels == 1 ? "" : "s", data->bits);
	incise_scan_tell(device, "id", "%.90s", id);
	if (name)
		incise_scan_tell(device, "name", "%.90s", name);
	incise_scan_tell(device, "channels", "%d", channels);
	incise_scan_tell(device, "channel", "%.90s", iio_channel_get_id(channel));
	incise_scan_tell(device, "bits", "%u", data->bits);
	device->usable = stamped && plain;
	if (plain && iio_source_volts(channel, &format, &full_scale_V, &offset_V))
		incise_scan_tell(device, "range_V", "%.6g to %.6g", offset_V,
				 offset_V + full_scale_V);
	add_text(device, iio, channel, KEY, "rate_hz");
	add_text(device, iio, channel, KEY "_available", "rates_available_hz");
	add_text(device, iio, channel, "trigger/current_trigger", "trigger");
	incise_scan_tell(device, "time_stamps", "%s", stamped ? "kernel" : "none");
}

int iio_force_scan(const char *arguments, incise_scan_found *found, void *context,
		   struct incise_error *err)
{
	struct iio_context *iio = iio_create_local_context();
	struct incise_scan_device device;
	struct iio_channel *channel = NULL;
	unsigned int n;
	int rc = 0;

	(void)err;
	/* Without the kernel's part there are no devices either. */
	if (!iio)
		return 0;
	n = iio_context_get_devices_count(iio);
	for (unsigned int i = 0; i < n && !rc; i++) {
		struct iio_device *one = iio_context_get_device(iio, i);
		int channels = voltages(one, &channel);

		if (!channels || iio_device_is_trigger(one) ||
		    (*arguments && iio_context_find_device(iio, arguments) != one))
			continue;
		describe(iio, one, channel, channels, &device);
		rc = found(context, &device);
	}
	iio_context_destroy(iio);
	return rc;
}
