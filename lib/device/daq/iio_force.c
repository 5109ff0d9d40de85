// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A force channel on an A/D converter of Linux IIO: samples with the kernel's timestamps.
 *
 *   trigger ─▶ converter ─▶ kernel's buffer (half a second) ─▶ thread, every 5 ms ─▶ feed
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../rig/backends.h"
#include "../../rig/daq_feed.h"
#include "iio_source.h"

/*
 * --- spacing ---
 *
 * Missing samples, found by the kernel's timestamps: IIO silently drops samples when its
 * buffer is full.
 *
 *   timestamps   |    |    |                   |    |       gap of 4 T: 3 lost
 *   timestamps   |    |    |        | |    |    |    |      late by 0.9 T: none
 *
 * A timestamp later than 1.5 T is held until the next one has come: a sample is not later
 * than its successor less T. The period T is the nominal one until the timestamps have
 * drifted from it by half a period; then it is the average so far.
 */

/* Nanoseconds since boot; more than this (146 years) is impossible. */
#define TIMESTAMP_MAX (INT64_MAX / 2)
/* Periods in a gap; longer ones are counted as this. */
#define GAP_MAX 1e12

struct spacing {
	struct daq_feed *feed;
	int64_t period_ns; /* nominal */
	bool started, holds;
	int64_t first_ns, last_ns; /* timestamps, without lateness */
	uint64_t n;		   /* periods between these two */
	int64_t held_ns;	   /* the sample that is held */
	int32_t held_code;
};

/* @rate_hz > 0 */
static void spacing_init(struct spacing *spacing, struct daq_feed *feed, double rate_hz)
{
	*spacing = (struct spacing){
		.feed = feed,
		.period_ns = llround(1e9 / rate_hz),
	};
}

static double period(const struct spacing *s)
{
	double nominal = (double)s->period_ns;
	double span = (double)(s->last_ns - s->first_ns);

	if (fabs(span - nominal * (double)s->n) < nominal / 2)
		return nominal;
	/* Wrong timestamps of a device must not become a period. */
	return fmin(fmax(span / (double)s->n, nominal * 0.8), nominal * 1.25);
}

/* @true_ns: the timestamp without lateness. */
static void pass(struct spacing *s, int64_t t_ns, int64_t true_ns, int32_t code)
{
	double steps = (double)(true_ns - s->last_ns) / period(s);
	uint64_t lost = 0;

	/* Exactly half a period counts for the shorter gap. */
	if (steps > 1.5)
		lost = (uint64_t)ceil(fmin(steps, GAP_MAX) - 0.5) - 1;
	daq_feed_lose(s->feed, lost);
	daq_feed_put(s->feed, t_ns, code);
	s->n += lost + 1;
	s->last_ns = true_ns;
}

/* Pass on the held sample: no other comes soon. */
static void spacing_flush(struct spacing *s)
{
	if (s->holds)
		pass(s, s->held_ns, s->held_ns, s->held_code);
	s->holds = false;
}

/*
 * Pass a sample to the feed, with the number missing ahead of it; @t_ns may be anything.
 */
static void spacing_put(struct spacing *s, int64_t t_ns, int32_t code)
{
	int64_t T;

	/* An impossible timestamp is replaced by the expected one. */
	if (t_ns < 0 || t_ns > TIMESTAMP_MAX)
		t_ns = s->holds ? s->held_ns + s->period_ns : s->last_ns + s->period_ns;
	if (!s->started) {
		s->started = true;
		s->first_ns = s->last_ns = t_ns;
		daq_feed_put(s->feed, t_ns, code);
		return;
	}
	T = (int64_t)period(s);
	if (s->holds) {
		int64_t true_ns = t_ns - T < s->held_ns ? t_ns - T : s->held_ns;

		/* Timestamps may run backwards. */
		pass(s, s->held_ns, true_ns > s->last_ns ? true_ns : s->last_ns,
		     s->held_code);
		s->holds = false;
	}
	if (t_ns - s->last_ns <= T + T / 2) {
		pass(s, t_ns, t_ns, code);
		return;
	}
	s->holds = true;
	s->held_ns = t_ns;
	s->held_code = code;
}

/* --- channel --- */

#define BLOCKS_PER_S 200
#define BLOCKS 100   /* in the buffer of the kernel: half a second */
#define QUIET_MS 100 /* between two checks whether it is still there */
#define DEAD_NS 3e9  /* without a sample, and ten periods */
#define PERIODS_DEAD 10

struct iio_force {
	struct daq_feed feed; /* first */
	struct iio_source source;
	struct spacing spacing;
};

/* An unplugged device shows when reading, not when waiting. */
static void *run_iio_force(void *argument)
{
	struct iio_force *f = argument;
	int64_t dead_ms =
		(int64_t)((DEAD_NS + PERIODS_DEAD * 1e9 / f->source.rate_hz) / 1e6);
	int64_t quiet_ms = 0;
	int got = 0;

	while (daq_feed_wait(&f->feed, f->source.fd, QUIET_MS) != DAQ_STOP) {
		got = iio_source_read(&f->source);
		for (int i = 0; i < got; i++)
			spacing_put(&f->spacing, iio_source_timestamp(&f->source, i),
				    iio_source_code(&f->source, i));
		quiet_ms = got > 0 ? 0 : quiet_ms + QUIET_MS;
		if (got < 0 && got != -EAGAIN && got != -EINTR)
			break;
		/* No successor of the held sample comes within the next periods. */
		if (quiet_ms > 2 * QUIET_MS)
			spacing_flush(&f->spacing);
		got = quiet_ms > dead_ms	       ? -ETIME
		      : iio_source_changed(&f->source) ? -ESTALE
						       : 0;
		if (got)
			break;
	}
	spacing_flush(&f->spacing);
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
	spacing_init(&f->spacing, &f->feed, s->rate_hz);
	rc = daq_feed_init(&f->feed);
	if (rc)
		return incise_error_set(err, -rc, "%s: no memory for samples: %s",
					s->where, strerror(-rc));
	rc = start_buffer(f, err);
	if (rc)
		return rc;
	rc = daq_feed_start(&f->feed, run_iio_force, f);
	return rc ? incise_error_set(err, -rc, "%s: no thread to read it: %s", s->where,
				     strerror(-rc))
		  : 0;
}

static void *force_open(const struct incise_backend_request *request,
			struct incise_error *err)
{
	struct iio_force *f;
	int rc;

	if (!*request->arguments) {
		incise_error_set(err, EINVAL,
				 "%s: expected iio:NAME, for example iio:iio:device0; "
				 "see `incise info devices`",
				 request->where);
		return NULL;
	}
	f = aligned_alloc(_Alignof(struct iio_force), sizeof(*f));
	if (!f) {
		incise_error_set(err, ENOMEM, "%s: out of memory", request->where);
		return NULL;
	}
	memset(f, 0, sizeof(*f));
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

const struct incise_backend incise_force_iio = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "force",
	.name = "iio",
	.open = force_open,
	.scan = force_scan,
};

INCISE_MODULE(incise_force_iio);
