// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A CAN bus behind a serial adapter that speaks slcan, on a tty; see slcan_line.h.
 *
 *   open   CR C Sn O       n: 0 … 8, 10 kbit/s … 1 Mbit/s
 *   send   t…, and F with it each 100 ms, which asks for the status of the controller
 *   close  C
 *
 * Nothing here waits for an answer: many adapters give none, and what is at the other end
 * may be another program, such as python-can on a pty. What does come is taken as it is.
 *
 * The rate is that of the request, or stands behind the tty, as in "/dev/ttyACM0@500000".
 * One that nobody asked for is 1 Mbit/s, what drives have from the factory: most
 * adapters go on the bus with no rate of their own, and the rate must be known to say
 * whether the traffic fits.
 */
#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <linux/can/error.h>
#include "../../../base/monotonic.h"
#include "can_bus.h"
#include "slcan_line.h"
#include "slcan_status.h"
#include "slcan_tty.h"

#define NS_PER_S INT64_C(1000000000)
#define BITRATE 1000000
#define START_COMMANDS 4
/* Bytes that one call of receive looks at: junk without end must not hold it. */
#define LOOK_MAX 4096

struct slcan {
	struct can_bus bus;
	struct slcan_tty tty;

	struct slcan_line line;
	unsigned char in[256];
	unsigned int in_at, in_n;
	int64_t in_ns; /* when it was read */

	struct can_filter filter[CAN_BUS_FILTERS];
	int n_filters;

	struct slcan_status status;
};

static struct slcan *of(struct can_bus *bus)
{
	return (struct slcan *)bus;
}

static INCISE_REALTIME int64_t slcan_now(struct can_bus *bus)
{
	(void)bus;
	return incise_monotonic_ns();
}

static int slcan_send(struct can_bus *bus, const struct can_frame *frame)
{
	struct slcan *s = of(bus);
	char text[SLCAN_TTY_PUT_MAX];
	size_t n = slcan_line_put(text, frame);
	int64_t now = slcan_now(bus);
	bool ask = slcan_status_due(&s->status, now);
	int rc;

	if (!n)
		return -EINVAL;
	if (ask) {
		text[n++] = 'F';
		text[n++] = '\r';
	}
	rc = slcan_tty_put(&s->tty, text, (unsigned int)n);
	if (rc == -ENOBUFS)
		bus->counts.full++;
	if (rc)
		return rc;
	bus->counts.sent++;
	if (ask)
		slcan_status_asked(&s->status, now);
	return 0;
}

static bool passes(const struct slcan *s, canid_t id)
{
	for (int i = 0; i < s->n_filters; i++) {
		const struct can_filter *f = &s->filter[i];
		bool same = !((id ^ f->can_id) & f->can_mask & ~CAN_INV_FILTER);

		if (same == !(f->can_id & CAN_INV_FILTER))
			return true;
	}
	return !s->n_filters;
}

/* True: *frame is one for the caller. */
static bool take(struct slcan *s, unsigned char byte, struct can_frame *frame)
{
	enum slcan_kind kind;
	struct slcan_told told;

	kind = slcan_line_take(&s->line, byte, &told);
	switch (kind) {
	case SLCAN_FRAME:
		if (!passes(s, told.frame.can_id))
			return false;
		s->bus.counts.received++;
		*frame = told.frame;
		return true;
	case SLCAN_REFUSED:
	case SLCAN_FLAGS:
	case SLCAN_STATE:
		if (!slcan_status_take(&s->status, kind, &told, frame))
			return false;
		s->bus.counts.errors++;
		if (frame->data[1] & CAN_ERR_CRTL_RX_OVERFLOW)
			s->bus.counts.overflow++;
		return true;
	case SLCAN_BROKEN:
		s->bus.counts.broken++;
		return false;
	case SLCAN_NONE:
	case SLCAN_OTHER:
		break;
	}
	return false;
}

/* 1 (there are bytes), 0 or -ENODEV. */
static int fill(struct slcan *s)
{
	ssize_t n;

	if (s->in_at < s->in_n)
		return 1;
	n = slcan_tty_read(&s->tty, s->in, sizeof(s->in));
	if (n <= 0)
		return (int)n;
	s->in_at = 0;
	s->in_n = (unsigned int)n;
	s->in_ns = slcan_now(&s->bus);
	return 1;
}

static int slcan_receive(struct can_bus *bus, struct can_frame *frame, int64_t *t_ns)
{
	struct slcan *s = of(bus);

	for (int looked = 0; looked < LOOK_MAX; looked++) {
		int rc = fill(s);

		if (rc <= 0)
			return rc;
		if (take(s, s->in[s->in_at++], frame)) {
			*t_ns = s->in_ns;
			return 1;
		}
	}
	return 0;
}

static int slcan_wait(struct can_bus *bus, int64_t until_ns)
{
	struct slcan *s = of(bus);

	for (;;) {
		struct pollfd poll = {.fd = s->tty.fd,
				      .events = (short)(POLLIN |
							(s->tty.out_n ? POLLOUT : 0))};
		int64_t now = slcan_now(bus), left = until_ns > now ? until_ns - now : 0;
		struct timespec timeout = {left / NS_PER_S, left % NS_PER_S};

		if (s->in_at < s->in_n)
			return 0;
		if (s->tty.gone)
			return s->tty.gone;
		if (ppoll(&poll, 1, &timeout, NULL) < 0)
			return -errno;
		/* The rest of a line goes out meanwhile; if that fails, receive says so. */
		if (poll.revents & POLLOUT)
			slcan_tty_flush(&s->tty);
		if (poll.revents & ~POLLOUT || !left)
			return 0;
	}
}

static int slcan_filter(struct can_bus *bus, const struct can_filter *filter, int n)
{
	struct slcan *s = of(bus);

	if (n < 0 || n > CAN_BUS_FILTERS)
		return -EINVAL;
	if (n)
		memcpy(s->filter, filter, (size_t)n * sizeof(*filter));
	s->n_filters = n;
	return 0;
}

static int slcan_state(struct can_bus *bus)
{
	return of(bus)->status.state;
}

static void slcan_close(struct can_bus *bus)
{
	struct slcan *s = of(bus);

	slcan_tty_close(&s->tty, "C\r", 2);
	free(s);
}

static const struct can_bus_ops slcan_ops = {
	.now = slcan_now,
	.send = slcan_send,
	.receive = slcan_receive,
	.wait = slcan_wait,
	.filter = slcan_filter,
	.state = slcan_state,
	.close = slcan_close,
};

/* The number n of Sn, or -1. */
static int rate_number(uint32_t bitrate)
{
	static const uint32_t rates[] = {10000,	 20000,	 50000,	 100000, 125000,
					 250000, 500000, 800000, 1000000};

	for (int i = 0; i < (int)(sizeof(rates) / sizeof(*rates)); i++)
		if (rates[i] == bitrate)
			return i;
	return -1;
}

static int refuse_rate(const struct can_bus_request *request, const char *rate,
		       struct incise_error *err)
{
	return incise_error_set(
		err, EINVAL,
		"%s: no adapter has %.20s bit/s: choose 10000, 20000, 50000, 100000, "
		"125000, 250000, 500000, 800000 or 1000000, as the drive has it",
		request->where, rate);
}

/*
 * "/dev/ttyACM0@500000" in its parts. An @ that no digit follows is
 * of the path.
 */
static int parse_device(const struct can_bus_request *request, char path[PATH_MAX],
			uint32_t *bitrate, struct incise_error *err)
{
	const char *device = request->device, *at = strrchr(device, '@');
	size_t n = strlen(device);
	unsigned long rate = 0;
	char *end;

	*bitrate = request->bitrate ? request->bitrate : BITRATE;
	if (at && at[1] >= '0' && at[1] <= '9') {
		n = (size_t)(at - device);
		rate = strtoul(at + 1, &end, 10);
		if (*end || rate > BITRATE || rate_number((uint32_t)rate) < 0)
			return refuse_rate(request, at + 1, err);
		*bitrate = (uint32_t)rate;
	}
	if (n >= PATH_MAX)
		return incise_error_set(err, ENODEV,
					"%s: the name of the device is too long",
					request->where);
	memcpy(path, device, n);
	path[n] = '\0';
	if (rate && request->bitrate && request->bitrate != *bitrate)
		return incise_error_set(
			err, EINVAL,
			"%s: %s is given %u bit/s behind its @, and bitrate is %u: take one "
			"of them away",
			request->where, path, *bitrate, request->bitrate);
	return 0;
}

/* Go on the bus. */
static int start(struct slcan *s, const struct can_bus_request *request,
		 struct incise_error *err)
{
	char text[] = "\rC\rS0\rO\r";
	int rc;

	text[4] = (char)('0' + rate_number(s->bus.bitrate));
	rc = slcan_tty_put(&s->tty, text, sizeof(text) - 1);
	if (!rc)
		return 0;
	slcan_tty_close(&s->tty, "", 0);
	return incise_error_set(
		err, rc == -ENODEV ? ENODEV : EIO,
		"%s: %s takes no bytes: unplug the adapter and plug it in "
		"again",
		request->where, s->bus.name);
}

static int slcan_open(struct can_bus **bus, const struct can_bus_request *request,
		      struct incise_error *err)
{
	char path[PATH_MAX], text[16];
	uint32_t bitrate;
	struct slcan *s;
	int rc = parse_device(request, path, &bitrate, err);

	if (rc)
		return rc;
	if (rate_number(bitrate) < 0) {
		snprintf(text, sizeof(text), "%u", bitrate);
		return refuse_rate(request, text, err);
	}
	s = calloc(1, sizeof(*s));
	if (!s)
		return incise_error_set(err, ENOMEM, "%s: out of memory", request->where);
	s->bus.ops = &slcan_ops;
	s->bus.bitrate = bitrate;
	snprintf(s->bus.name, sizeof(s->bus.name), "%.39s", path);
	/* Each may be refused: C where it is closed, S where it has one rate only … */
	slcan_status_begin(&s->status, START_COMMANDS, slcan_now(&s->bus));
	rc = slcan_tty_open(&s->tty, path, request->where, err);
	if (!rc)
		rc = start(s, request, err);
	if (rc) {
		free(s);
		return rc;
	}
	*bus = &s->bus;
	return 0;
}

const struct can_transport can_transport_slcan = {.name = "slcan", .open = slcan_open};
