// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A force channel on a DAQ card under comedi; see comedi_force.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../../base/monotonic.h"
#include "comedi_card.h"
#include "comedi_force.h"
#include "comedi_stamps.h"
#include "daq_feed.h"

#define QUIET_MS 20 /* between looks at a card whose store fills slowly */
#define DEAD_NS 3e9 /* of no sample at all, and ten periods */
#define PERIODS_DEAD 10
#define RESTARTS 5 /* in a row without a sample */
#define BLOCK_BYTES 8192

struct comedi_force {
	struct daq_feed feed; /* first */
	struct comedi_card card;
	struct comedi_stamps stamps;
	/* The thread's. */
	int64_t heard_ns; /* when a sample came, or a command was started */
	bool gap;	  /* the command was started again and no sample came yet */
	int restarts;
	unsigned int rest; /* bytes of a sample that has come in part */
	_Alignas(8) unsigned char block[BLOCK_BYTES];
};

/* Samples that would have come while no command ran; an overflow lost one at least. */
static void count_gap(struct comedi_force *f, int64_t last_ns, int64_t t_ns)
{
	double steps = round((double)(t_ns - last_ns) / f->card.period_ns);

	if (last_ns >= 0)
		daq_feed_lose(&f->feed, steps >= 2 ? (uint64_t)steps - 1 : 1);
	f->gap = false;
}

/* @last: no more was waiting behind it. */
static void pass_on(struct comedi_force *f, size_t bytes, bool last)
{
	size_t size = f->card.wide ? sizeof(lsampl_t) : sizeof(sampl_t);
	size_t n = bytes / size;

	comedi_stamps_block(&f->stamps, f->heard_ns, n, last);
	for (size_t i = 0; i < n; i++) {
		int64_t last_ns = f->stamps.last_ns;
		int64_t t_ns = comedi_stamps_next(&f->stamps);
		lsampl_t wide = 0;
		sampl_t narrow = 0;

		if (f->card.wide)
			memcpy(&wide, f->block + i * sizeof(wide), sizeof(wide));
		else
			memcpy(&narrow, f->block + i * sizeof(narrow), sizeof(narrow));
		if (f->gap)
			count_gap(f, last_ns, t_ns);
		/* Bits above those of the converter are no part of the sample. */
		daq_feed_put(&f->feed, t_ns,
			     (int32_t)((wide | narrow) &
				       ((UINT32_C(1) << f->card.bits) - 1)));
	}
	f->rest = (unsigned int)(bytes - n * size);
	memmove(f->block, f->block + n * size, f->rest);
}

/* 0 or -errno. */
static int restart(struct comedi_force *f)
{
	if (++f->restarts > RESTARTS)
		return -EIO;
	comedi_cancel(f->card.device, f->card.subdevice);
	f->rest = 0;
	f->gap = true;
	f->heard_ns = incise_monotonic_ns();
	comedi_stamps_begin(&f->stamps, f->heard_ns);
	return comedi_card_start(&f->card);
}

/* What a read gave; 0, or -errno when that was the end. */
static int judge(struct comedi_force *f, ssize_t got)
{
	double dead_ns = DEAD_NS + PERIODS_DEAD * f->card.period_ns;

	if (got > 0) {
		f->heard_ns = incise_monotonic_ns();
		f->restarts = 0;
		pass_on(f, f->rest + (size_t)got, f->rest + (size_t)got < BLOCK_BYTES);
		return 0;
	}
	/* The command has ended: for want of room, or by itself. */
	if (got == 0 || got == -EPIPE)
		return restart(f);
	if (got == -EINTR)
		return 0;
	if (got != -EAGAIN)
		return got == -ENODEV || got == -ENXIO ? -ENODEV : -EIO;
	/* A card that waits for its store to fill may be asked for what it has. */
	comedi_poll(f->card.device, f->card.subdevice);
	return (double)(incise_monotonic_ns() - f->heard_ns) > dead_ns ? -EIO : 0;
}

static void *run(void *argument)
{
	struct comedi_force *f = argument;
	int fd = comedi_fileno(f->card.device), rc = 0;

	while (!rc && daq_feed_wait(&f->feed, fd, QUIET_MS) != DAQ_STOP) {
		ssize_t got = read(fd, f->block + f->rest, BLOCK_BYTES - f->rest);

		rc = judge(f, got < 0 ? -errno : got);
	}
	daq_feed_end(&f->feed, rc,
		     f->restarts > RESTARTS
			     ? "its command ends as soon as it begins; see dmesg"
			     : "no sample comes any more, or none that can be read; see "
			       "dmesg, and begin again");
	return NULL;
}

static void comedi_force_close(struct incise_force *force)
{
	struct comedi_force *f = (struct comedi_force *)force;

	daq_feed_stop(&f->feed);
	comedi_card_close(&f->card);
	daq_feed_free(&f->feed);
	free(f);
}

static const struct incise_force_ops comedi_force_ops = {
	.read = daq_feed_read,
	.info = daq_feed_info,
	.lost = daq_feed_lost,
	.close = comedi_force_close,
	.cause = daq_feed_cause,
};

static int start(struct comedi_force *f, struct incise_error *err)
{
	struct incise_force_info *info = &f->feed.info;
	int fd = comedi_fileno(f->card.device), rc;

	info->rate_hz = 1e9 / f->card.period_ns;
	info->bits = f->card.bits;
	info->full_scale_V = f->card.full_scale_V;
	info->offset_V = f->card.offset_V;
	snprintf(info->name, sizeof(info->name), "%.36s channel %d, by arrival",
		 comedi_get_board_name(f->card.device), f->card.setup.channel);
	comedi_stamps_init(&f->stamps, f->card.period_ns);
	rc = daq_feed_init(&f->feed);
	if (!rc && fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK) < 0)
		rc = -errno;
	if (!rc) {
		f->heard_ns = incise_monotonic_ns();
		comedi_stamps_begin(&f->stamps, f->heard_ns);
		rc = comedi_card_start(&f->card);
	}
	if (!rc)
		rc = daq_feed_start(&f->feed, run, f);
	return rc ? incise_error_set(err, -rc, "%s: %s does not start: %s; see dmesg",
				     f->card.where, f->card.path, strerror(-rc))
		  : 0;
}

void *comedi_force_open(const struct incise_backend_request *request,
			struct incise_error *err)
{
	struct comedi_force *f = aligned_alloc(_Alignof(struct comedi_force), sizeof(*f));
	int rc;

	if (!f) {
		incise_error_set(err, ENOMEM, "%s: out of memory", request->where);
		return NULL;
	}
	memset(f, 0, sizeof(*f));
	f->feed.force.ops = &comedi_force_ops;
	f->feed.stop = -1;
	f->card.where = request->where;
	rc = daq_feed_setup(request, &f->card.setup, err);
	rc = rc ? rc : comedi_card_open(&f->card, request->arguments, err);
	rc = rc ? rc : start(f, err);
	f->card.where = NULL; /* the caller's */
	if (!rc)
		return &f->feed.force;
	comedi_force_close(&f->feed.force);
	errno = -rc;
	return NULL;
}
