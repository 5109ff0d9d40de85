// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A force channel on an A/D converter of Linux IIO; see iio_force.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "iio_force.h"
#include "iio_source.h"
#include "iio_spacing.h"
#include "iio_stream.h"
#include "iio_trigger.h"

#define BLOCKS_PER_S 200
#define BLOCKS 100   /* that the kernel has room for: half a second */
#define QUIET_MS 100 /* between looks whether it is still there */
#define DEAD_NS 3e9  /* of no sample at all, and ten periods */
#define PERIODS_DEAD 10

struct iio_force {
	struct daq_feed feed; /* first */
	struct iio_source source;
	struct iio_stream stream;
	struct iio_spacing spacing;
};

/* Waiting does not tell of an unplugged device, reading does. */
static void *run(void *argument)
{
	struct iio_force *f = argument;
	int64_t dead_ms =
		(int64_t)((DEAD_NS + PERIODS_DEAD * 1e9 / f->source.rate_hz) / 1e6);
	int64_t quiet_ms = 0;
	int got = 0;

	while (daq_feed_wait(&f->feed, f->stream.fd, QUIET_MS) != DAQ_STOP) {
		got = iio_stream_read(&f->stream);
		for (int i = 0; i < got; i++)
			iio_spacing_put(&f->spacing, iio_stream_stamp(&f->stream, i),
					iio_stream_code(&f->stream, i));
		quiet_ms = got > 0 ? 0 : quiet_ms + QUIET_MS;
		if (got < 0 && got != -EAGAIN && got != -EINTR)
			break;
		/* Nothing will come behind what is held within the next periods. */
		if (quiet_ms > 2 * QUIET_MS)
			iio_spacing_flush(&f->spacing);
		got = quiet_ms > dead_ms ? -ETIME : 0;
		if (got)
			break;
	}
	iio_spacing_flush(&f->spacing);
	daq_feed_end(&f->feed,
		     got == -ENODEV ? -ENODEV
		     : got < 0	    ? -EIO
				    : 0,
		     got == -ETIME ? "no sample came any more; see that what triggers "
				     "it runs, and begin again"
				   : "its buffer cannot be read any more; see dmesg, and "
				     "begin again");
	return NULL;
}

static void iio_force_close(struct incise_force *force)
{
	struct iio_force *f = (struct iio_force *)force;

	daq_feed_stop(&f->feed);
	iio_stream_stop(&f->stream);
	iio_source_close(&f->source);
	daq_feed_free(&f->feed);
	free(f);
}

static const struct incise_force_ops iio_force_ops = {
	.read = daq_feed_read,
	.info = daq_feed_info,
	.lost = daq_feed_lost,
	.close = iio_force_close,
	.cause = daq_feed_cause,
};

/* The kernel wakes the thread once per block, and has room for many. */
static int start_stream(struct iio_force *f, struct incise_error *err)
{
	const char *id = iio_device_get_id(f->source.device);
	unsigned int block = (unsigned int)(f->source.rate_hz / BLOCKS_PER_S);
	char folder[100];
	int rc;

	block = block ? block : 1;
	snprintf(folder, sizeof(folder), "/sys/bus/iio/devices/%.60s", id);
	f->stream.fd = f->source.fd;
	rc = iio_stream_start(&f->stream, &f->source, folder, block, block * BLOCKS);
	return rc ? incise_error_set(err, -rc,
				     "%s: %s starts no buffer of %u samples: %s; see "
				     "dmesg",
				     f->source.where, id, block * BLOCKS, strerror(-rc))
		  : 0;
}

static int start(struct iio_force *f, struct incise_error *err)
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
	iio_spacing_init(&f->spacing, &f->feed, s->rate_hz);
	rc = daq_feed_init(&f->feed);
	if (rc)
		return incise_error_set(err, -rc, "%s: no room for samples: %s", s->where,
					strerror(-rc));
	rc = start_stream(f, err);
	if (rc)
		return rc;
	rc = daq_feed_start(&f->feed, run, f);
	return rc ? incise_error_set(err, -rc, "%s: no thread to read with: %s", s->where,
				     strerror(-rc))
		  : 0;
}

void *iio_force_open(const struct incise_backend_request *request,
		     struct incise_error *err)
{
	struct iio_force *f;
	int rc;

	if (!*request->arguments) {
		incise_error_set(err, EINVAL,
				 "%s: expected iio:NAME, such as iio:iio:device0; see "
				 "`incise info devices`",
				 request->where);
		return NULL;
	}
	f = aligned_alloc(_Alignof(struct iio_force), sizeof(*f));
	if (!f) {
		incise_error_set(err, ENOMEM, "%s: out of memory", request->where);
		return NULL;
	}
	memset(f, 0, sizeof(*f));
	f->feed.force.ops = &iio_force_ops;
	f->feed.stop = -1;
	f->source.fd = -1;
	f->source.where = request->where;
	f->source.trigger_folder = IIO_TRIGGER_FOLDER;
	rc = daq_feed_setup(request, &f->source.setup, err);
	rc = rc ? rc : iio_source_open(&f->source, request->arguments, err);
	rc = rc ? rc : start(f, err);
	f->source.where = NULL; /* the caller's */
	if (!rc)
		return &f->feed.force;
	iio_force_close(&f->feed.force);
	errno = -rc;
	return NULL;
}
