// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A force channel on an A/D converter of Linux IIO: samples with the kernel's timestamps.
 *
 *   trigger ─▶ converter ─▶ kernel's buffer (half a second) ─▶ thread, every 5 ms ─▶ feed
 */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/daq_feed.h"
#include "../../rig/thread.h"
#include "iio_source.h"

/* Nanoseconds since boot; more than this (146 years) is impossible. */
#define TIMESTAMP_MAX (INT64_MAX / 2)

/* --- channel --- */

#define BLOCKS_PER_S 200
#define BLOCKS 100    /* in the buffer of the kernel: half a second */
#define QUIET_MS 100  /* between two checks whether it is still there */
#define CHECK_MS 1000 /* between two checks of the scale */
#define DEAD_NS 3e9   /* without a sample, and ten periods */
#define PERIODS_DEAD 10

struct iio_force {
	struct daq_feed feed; /* first */
	struct iio_source source;
	struct incise_pace pace;
	pthread_t watch; /* of the scale, by normal scheduling */
	bool watches;
	atomic_bool changed;
};

/* A read of sysfs may take longer than a sample: the thread that samples leaves it to another one. */
static void *watch_scale(void *argument)
{
	struct iio_force *f = argument;

	while (!f->changed && daq_feed_wait(&f->feed, -1, CHECK_MS) != DAQ_STOP)
		f->changed = iio_source_changed(&f->source);
	return NULL;
}

/*
 * IIO drops samples when its buffer is full, without a word: their times show it. Samples of a
 * converter's own FIFO have the time at which it was read, so that a block has the time of its
 * last one.
 */
static void take_iio_force(struct iio_force *f, int64_t t_ns, int32_t code,
			   int64_t now_ns)
{
	/* An impossible timestamp is replaced by the expected one. */
	if (t_ns < 0 || t_ns > TIMESTAMP_MAX)
		t_ns = f->pace.last_ns + (int64_t)f->pace.period_ns;
	daq_feed_pace(&f->feed, &f->pace, t_ns, now_ns);
	daq_feed_put(&f->feed, t_ns - incise_pace_spread_ns(&f->pace), code);
}

/* An unplugged device shows when reading, not when waiting. */
static void *run_iio_force(void *argument)
{
	struct iio_force *f = argument;
	int64_t dead_ms =
		(int64_t)((DEAD_NS + PERIODS_DEAD * 1e9 / f->source.rate_hz) / 1e6);
	int64_t quiet_ms = 0, now_ns;
	int got = 0;

	while (daq_feed_wait(&f->feed, f->source.fd, QUIET_MS) != DAQ_STOP) {
		got = iio_source_read(&f->source);
		now_ns = incise_monotonic_ns();
		for (int i = 0; i < got; i++)
			take_iio_force(f, iio_source_timestamp(&f->source, i),
				       iio_source_code(&f->source, i), now_ns);
		quiet_ms = got > 0 ? 0 : quiet_ms + QUIET_MS;
		if (got < 0 && got != -EAGAIN && got != -EINTR)
			break;
		got = quiet_ms > dead_ms ? -ETIME : f->changed ? -ESTALE : 0;
		if (got)
			break;
	}
	daq_feed_end(&f->feed,
		     got == -ENODEV ? -ENODEV
		     : got < 0	    ? -EIO
				    : 0,
		     got == -ETIME ? "no more samples arrived; check that its trigger "
				     "runs, and start again"
		     : got == -ESTALE
			     ? "another program changed its scale, so that the last "
			       "samples may be wrong; end it, and start again"
			     : "its buffer cannot be read any more; see dmesg, "
			       "and start again");
	return NULL;
}

static void force_close(struct incise_force *force)
{
	struct iio_force *f = (struct iio_force *)force;

	daq_feed_stop(&f->feed);
	if (f->watches)
		pthread_join(f->watch, NULL);
	iio_source_stop(&f->source);
	iio_source_close(&f->source);
	daq_feed_free(&f->feed);
	free(f);
}

static const struct incise_force_ops force_ops = {
	.read = daq_feed_read,
	.info = daq_feed_info,
	.lost = daq_feed_lost,
	.close = force_close,
	.cause = daq_feed_cause,
};

static int start_buffer(struct iio_force *f, struct incise_error *err)
{
	const char *id = iio_device_get_id(f->source.device);
	unsigned int block = (unsigned int)(f->source.rate_hz / BLOCKS_PER_S);
	char folder[100];
	int rc;

	block = block ? block : 1;
	snprintf(folder, sizeof(folder), "/sys/bus/iio/devices/%.60s", id);
	rc = iio_source_start(&f->source, folder, block, block * BLOCKS);
	return rc ? incise_error_set(err, -rc,
				     "%s: %s cannot start a buffer of %u samples: %s; "
				     "see dmesg",
				     f->source.where, id, block * BLOCKS, strerror(-rc))
		  : 0;
}

static int start_iio_force(struct iio_force *f, struct incise_error *err)
{
	const struct iio_source *s = &f->source;
	const char *name = iio_device_get_name(s->device);
	struct incise_force_info *info = &f->feed.info;
	int rc;

	info->rate_hz = s->rate_hz;
	info->bits = (int)s->format.bits;
	info->full_scale_V = s->full_scale_V;
	info->offset_V = s->offset_V;
	snprintf(info->name, sizeof(info->name), "%.30s %s%s%.24s",
		 name ? name : iio_device_get_id(s->device),
		 iio_channel_get_id(s->voltage), *s->trigger_used ? ", " : "",
		 s->trigger_used);
	incise_pace_init(&f->pace, s->rate_hz, INCISE_PACE_OFF, 1);
	rc = daq_feed_init(&f->feed);
	if (rc)
		return incise_error_set(err, -rc, "%s: no memory for samples: %s",
					s->where, strerror(-rc));
	rc = start_buffer(f, err);
	if (rc)
		return rc;
	rc = daq_feed_start(&f->feed, run_iio_force, f);
	if (!rc) {
		rc = incise_thread_start(&f->watch, watch_scale, f, NULL);
		f->watches = !rc;
	}
	return rc ? incise_error_set(err, -rc, "%s: no thread to read it: %s", s->where,
				     strerror(-rc))
		  : 0;
}

static void *force_open(const struct incise_backend_request *request,
			struct incise_error *err)
{
	struct iio_force *f;
	int rc;

	if (!*request->arguments)
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"%s: expected iio:NAME, for example iio:iio:device0; "
			"see `incise info devices`",
			request->where);
	f = incise_device_new(sizeof(*f), request->where, err);
	if (!f)
		return NULL;
	f->feed.force.ops = &force_ops;
	f->feed.stop = -1;
	f->source.fd = -1;
	f->source.where = request->where;
	f->source.trigger_folder = IIO_SOURCE_TRIGGERS;
	rc = daq_feed_setup(request, &f->source.setup, err);
	rc = rc ? rc : iio_source_open(&f->source, request->arguments, err);
	rc = rc ? rc : start_iio_force(f, err);
	f->source.where = NULL; /* the caller's */
	if (!rc)
		return &f->feed.force;
	force_close(&f->feed.force);
	errno = -rc;
	return NULL;
}

/* --- search --- */

#define KEY "sampling_frequency"

/* Count the channels that can be sampled; *first is the first one. */
static int voltages(const struct iio_device *device, struct iio_channel **first)
{
	unsigned int n = iio_device_get_channels_count(device);
	int count = 0;

	for (unsigned int i = 0; i < n; i++) {
		struct iio_channel *c = iio_device_get_channel(device, i);

		if (iio_source_can_sample(c) && !count++)
			*first = c;
	}
	return count;
}

/* Two devices of one name are named by their ids. */
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

static void describe_iio_force(const struct iio_context *context,
			       const struct iio_device *iio,
			       const struct iio_channel *channel, int channels,
			       struct incise_scan_device *device)
{
	const char *id = iio_device_get_id(iio), *name = iio_device_get_name(iio);
	const struct iio_data_format *data = iio_channel_get_data_format(channel);
	double full_scale_V, offset_V;
	struct iio_format format;
	bool stamped = iio_device_find_channel(iio, "timestamp", false);
	bool plain = !iio_format_of(&format, data, 31);
	char names[100];

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
	iio_source_list_channels(iio, names, sizeof(names));
	incise_scan_tell(device, "channel_names", "%s", names);
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

static int force_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	struct iio_context *iio = iio_create_local_context();
	struct incise_scan_device device;
	struct iio_channel *channel = NULL;
	unsigned int n;
	int rc = 0;

	(void)err;
	/* A kernel without IIO has no devices. */
	if (!iio)
		return 0;
	n = iio_context_get_devices_count(iio);
	for (unsigned int i = 0; i < n && !rc; i++) {
		struct iio_device *one = iio_context_get_device(iio, i);
		int channels = voltages(one, &channel);

		if (!channels || iio_device_is_trigger(one) ||
		    (*arguments && iio_context_find_device(iio, arguments) != one))
			continue;
		describe_iio_force(iio, one, channel, channels, &device);
		rc = found(context, &device);
	}
	iio_context_destroy(iio);
	return rc;
}

INCISE_BACKEND(incise_force_iio, "force", "iio", .open = force_open, .scan = force_scan);
