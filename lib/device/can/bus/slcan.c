// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A CAN bus behind a serial adapter that speaks slcan, on a tty; see slcan_protocol.h.
 *
 *   open   CR C Sn O       n: 0 … 8, 10 kbit/s … 1 Mbit/s
 *   send   t…, each 100 ms followed by F, the query for the controller's status
 *   close  C
 *
 * Nothing here waits for an answer: many adapters give none, and the other end may be another
 * program, for example python-can on a pty.
 *
 * The bit rate is the requested one, or follows the tty, as in "/dev/ttyACM0@500000". The
 * default is 1 Mbit/s, the factory setting of drives: most adapters have no rate of their own,
 * and the load of the bus must be computed from a known one.
 */
#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#include <linux/can/error.h>
#include "../../../base/monotonic.h"
#include "../../../rig/tty.h"
#include "can_bus.h"
#include "slcan_protocol.h"

#define NS_PER_S INT64_C(1000000000)
#define BITRATE 1000000
#define START_COMMANDS 4
#define RECEIVE_BYTES_MAX 4096 /* of one call of receive, so that endless junk ends it */
#define DRAIN_POLLS 20	       /* of 5 ms, until the last bytes have gone */
#define SEND_MAX (SLCAN_LINE_MAX + 2) /* bytes sent at once: a frame and a query */

/* The serial line, opened exclusively. Lines go out whole or not at all. */
struct slcan_tty {
	int fd;
	int gone; /* -ENODEV, -EIO; permanent */
	/* The rest of a line that was written in part; out_n of 0: no rest. */
	char out[SEND_MAX];
	unsigned int out_at, out_n;
};

struct slcan {
	struct can_bus bus;
	struct slcan_tty tty;

	struct slcan_line line;
	unsigned char in[256];
	unsigned int in_at, in_n;
	int64_t in_ns; /* time of reading them */

	struct can_filter filter[CAN_BUS_FILTERS];
	int n_filters;

	struct slcan_status status;
};

/* An unplugged line returns EIO; it does not come back on this descriptor. */
static int tty_failed(struct slcan_tty *tty, int code)
{
	tty->gone = code == EIO || code == ENXIO || code == ENODEV ? -ENODEV : -EIO;
	return tty->gone;
}

/* Write the rest of a line. 0, -ENOBUFS (not all went out), -ENODEV, -EIO. */
static int tty_flush(struct slcan_tty *tty)
{
	while (tty->out_at < tty->out_n) {
		ssize_t n =
			write(tty->fd, tty->out + tty->out_at, tty->out_n - tty->out_at);

		if (n < 0 && errno == EINTR)
			continue;
		if (n < 0 && errno != EAGAIN)
			return tty_failed(tty, errno);
		if (n <= 0)
			return -ENOBUFS;
		tty->out_at += (unsigned int)n;
	}
	tty->out_at = tty->out_n = 0;
	return 0;
}

/* Send all of @n bytes, now or later. 0; -ENOBUFS: no byte; -ENODEV, -EIO. */
static int tty_send(struct slcan_tty *tty, const char *text, unsigned int n)
{
	int rc = tty->gone ? tty->gone : tty_flush(tty);

	if (rc)
		return rc;
	memcpy(tty->out, text, n);
	tty->out_n = n;
	rc = tty_flush(tty);
	if (rc == -ENOBUFS) {
		if (tty->out_at)
			return 0;
		tty->out_n = 0;
	}
	return rc;
}

/* Returns the number of bytes read; 0: no bytes yet; -ENODEV, -EIO. */
static ssize_t tty_read(struct slcan_tty *tty, void *bytes, size_t size)
{
	ssize_t n;

	if (tty->gone)
		return tty->gone;
	do
		n = read(tty->fd, bytes, size);
	while (n < 0 && errno == EINTR);
	if (n < 0)
		return errno == EAGAIN ? 0 : tty_failed(tty, errno);
	/* VMIN is 1: no byte means end of file. */
	return n ? n : tty_failed(tty, EIO);
}

/*
 * Send @last and wait until the adapter has read it, 100 ms at most. Then flush the rest, as
 * close() of a tty may wait 30 s for it; but only then, as flushing a pty also discards bytes
 * that its reader has not read yet.
 */
static void tty_close(struct slcan_tty *tty, const char *last, unsigned int n)
{
	bool sent = false, gone = false;
	int left = 0;

	for (int i = 0; i < DRAIN_POLLS && !gone && !tty->gone; i++) {
		sent = sent || !tty_send(tty, last, n);
		gone = sent && !tty_flush(tty) &&
		       (ioctl(tty->fd, TIOCOUTQ, &left) < 0 || !left);
		if (!gone)
			nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
	}
	if (!gone)
		tcflush(tty->fd, TCOFLUSH);
	ioctl(tty->fd, TIOCNXCL);
	close(tty->fd);
}

static struct slcan *slcan_of(struct can_bus *bus)
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
	struct slcan *s = slcan_of(bus);
	char text[SEND_MAX];
	size_t n = slcan_line_format(text, frame);
	int64_t now = slcan_now(bus);
	bool query = slcan_status_due(&s->status, now);
	int rc;

	if (!n)
		return -EINVAL;
	if (query) {
		text[n++] = 'F';
		text[n++] = '\r';
	}
	rc = tty_send(&s->tty, text, (unsigned int)n);
	if (rc == -ENOBUFS)
		bus->counts.full++;
	if (rc)
		return rc;
	bus->counts.sent++;
	if (query)
		slcan_status_queried(&s->status, now);
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

/* Handle a byte. Returns true if *frame is for the caller. */
static bool receive_byte(struct slcan *s, unsigned char byte, struct can_frame *frame)
{
	struct slcan_message message;
	enum slcan_kind kind = slcan_line_receive(&s->line, byte, &message);

	switch (kind) {
	case SLCAN_FRAME:
		if (!passes(s, message.frame.can_id))
			return false;
		s->bus.counts.received++;
		*frame = message.frame;
		return true;
	case SLCAN_REFUSED:
	case SLCAN_FLAGS:
	case SLCAN_STATE:
		if (!slcan_status_update(&s->status, kind, &message, frame))
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

/* Returns 1 (there are bytes), 0, -ENODEV or -EIO. */
static int fill_slcan(struct slcan *s)
{
	ssize_t n;

	if (s->in_at < s->in_n)
		return 1;
	n = tty_read(&s->tty, s->in, sizeof(s->in));
	if (n <= 0)
		return (int)n;
	s->in_at = 0;
	s->in_n = (unsigned int)n;
	s->in_ns = slcan_now(&s->bus);
	return 1;
}

static int slcan_receive(struct can_bus *bus, struct can_frame *frame, int64_t *t_ns)
{
	struct slcan *s = slcan_of(bus);

	for (int i = 0; i < RECEIVE_BYTES_MAX; i++) {
		int rc = fill_slcan(s);

		if (rc <= 0)
			return rc;
		if (receive_byte(s, s->in[s->in_at++], frame)) {
			*t_ns = s->in_ns;
			return 1;
		}
	}
	return 0;
}

static int slcan_wait(struct can_bus *bus, int64_t until_ns)
{
	struct slcan *s = slcan_of(bus);

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
		/* The rest of a line goes out meanwhile; receive reports an error. */
		if (poll.revents & POLLOUT)
			tty_flush(&s->tty);
		if (poll.revents & ~POLLOUT || !left)
			return 0;
	}
}

static int slcan_filter(struct can_bus *bus, const struct can_filter *filter, int n)
{
	struct slcan *s = slcan_of(bus);

	if (n < 0 || n > CAN_BUS_FILTERS)
		return -EINVAL;
	if (n)
		memcpy(s->filter, filter, (size_t)n * sizeof(*filter));
	s->n_filters = n;
	return 0;
}

static int slcan_state(struct can_bus *bus)
{
	return slcan_of(bus)->status.state;
}

static void slcan_close(struct can_bus *bus)
{
	struct slcan *s = slcan_of(bus);

	tty_close(&s->tty, "C\r", 2);
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

/* Returns the number n of Sn, or -1. */
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
		"%s: no adapter supports %.20s bit/s; set the bit rate of the drive: "
		"10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000",
		request->where, rate);
}

/* Split "/dev/ttyACM0@500000". An @ that no digit follows belongs to the path. */
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
			"%s: %s has %u bit/s after its @, but bitrate is %u; remove "
			"one of them",
			request->where, path, *bitrate, request->bitrate);
	return 0;
}

/* Go on the bus. */
static int start_slcan(struct slcan *s, const struct can_bus_request *request,
		       struct incise_error *err)
{
	char text[] = "\rC\rS0\rO\r";
	int rc;

	text[4] = (char)('0' + rate_number(s->bus.bitrate));
	rc = tty_send(&s->tty, text, sizeof(text) - 1);
	if (!rc)
		return 0;
	tty_close(&s->tty, "", 0);
	return incise_error_set(
		err, rc == -ENODEV ? ENODEV : EIO,
		"%s: %s accepts no bytes; unplug the adapter and plug it in again",
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
	/* The adapter may refuse each: C when it is closed, S when it has one rate only … */
	slcan_status_init(&s->status, START_COMMANDS, slcan_now(&s->bus));
	s->tty.fd = incise_tty_open(path, B0);
	rc = s->tty.fd < 0 ? incise_tty_refuse(path, -s->tty.fd, request->where,
					       "the tty of an slcan adapter", err)
			   : start_slcan(s, request, err);
	if (rc) {
		free(s);
		return rc;
	}
	*bus = &s->bus;
	return 0;
}

const struct can_transport can_transport_slcan = {.name = "slcan", .open = slcan_open};
