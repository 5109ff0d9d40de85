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
 * A rate that nobody asked for is 1 Mbit/s, what drives have from the factory: most
 * adapters go on the bus with no rate of their own, and the rate must be known to say
 * whether the traffic fits.
 */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include "can_bus.h"
#include "slcan_line.h"

#define NS_PER_S INT64_C(1000000000)
#define ASK_NS 100000000 /* between two questions for the status */
#define DRAIN_POLLS 20	 /* of 5 ms, until the last bytes have gone */
#define BITRATE 1000000
/* Bytes that one call of receive looks at: junk without end must not hold it. */
#define LOOK_MAX 4096
/* Questions that may be refused before no more are asked. */
#define ASKS_MAX 3

struct slcan {
	struct can_bus bus;
	int fd;
	int gone; /* -ENODEV: for good */

	struct slcan_line line;
	unsigned char in[256];
	unsigned int in_at, in_n;
	int64_t in_ns; /* when it was read */

	/* What is left of a line that was written in part. */
	char out[SLCAN_LINE_MAX + 2];
	unsigned int out_at, out_n;

	struct can_filter filter[CAN_BUS_FILTERS];
	int n_filters;

	int64_t asked_ns;
	unsigned int asks;     /* refused */
	bool asking, answers;  /* a question is open; one was answered once */
	unsigned int refusals; /* that may come of the start: C of what is closed … */
	uint8_t flags;
	int state; /* enum can_state; -EOPNOTSUPP: it never told */
};

static struct slcan *of(struct can_bus *bus)
{
	return (struct slcan *)bus;
}

static int64_t slcan_now(struct can_bus *bus)
{
	struct timespec now;

	(void)bus;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * NS_PER_S + now.tv_nsec;
}

/* A line that was pulled out answers EIO; it does not come back on this descriptor. */
static int failed(struct slcan *s, int code)
{
	s->gone = code == EIO || code == ENXIO || code == ENODEV ? -ENODEV : -EIO;
	return s->gone;
}

/* Write what is left. 0, -ENOBUFS (there is still some), or it is gone. */
static int flush(struct slcan *s)
{
	while (s->out_at < s->out_n) {
		ssize_t n = write(s->fd, s->out + s->out_at, s->out_n - s->out_at);

		if (n < 0 && errno == EINTR)
			continue;
		if (n < 0 && errno != EAGAIN)
			return failed(s, errno);
		if (n <= 0)
			return -ENOBUFS;
		s->out_at += (unsigned int)n;
	}
	s->out_at = s->out_n = 0;
	return 0;
}

/* All of it, now or later; -ENOBUFS: none of it. */
static int put(struct slcan *s, const char *text, unsigned int n)
{
	int rc = s->gone ? s->gone : flush(s);

	if (rc)
		return rc;
	memcpy(s->out, text, n);
	s->out_n = n;
	rc = flush(s);
	if (rc == -ENOBUFS) {
		if (s->out_at)
			return 0;
		s->out_n = 0;
	}
	return rc;
}

static int slcan_send(struct can_bus *bus, const struct can_frame *frame)
{
	struct slcan *s = of(bus);
	char text[SLCAN_LINE_MAX + 2];
	size_t n = slcan_line_put(text, frame);
	int64_t now = slcan_now(bus);
	bool ask = s->asks < ASKS_MAX && now - s->asked_ns >= ASK_NS;
	int rc;

	if (!n)
		return -EINVAL;
	if (ask) {
		text[n++] = 'F';
		text[n++] = '\r';
	}
	rc = put(s, text, (unsigned int)n);
	if (rc == -ENOBUFS)
		bus->counts.full++;
	if (rc)
		return rc;
	bus->counts.sent++;
	if (ask) {
		s->asked_ns = now;
		s->asking = true;
	}
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

static void error_frame(struct slcan *s, struct can_frame *frame, canid_t what,
			uint8_t controller)
{
	memset(frame, 0, sizeof(*frame));
	frame->can_id = CAN_ERR_FLAG | what;
	frame->can_dlc = CAN_ERR_DLC;
	frame->data[1] = controller;
	s->bus.counts.errors++;
}

/* True: it is another one than before, and *controller says so as an error frame does. */
static bool state_is(struct slcan *s, int state, uint8_t *controller)
{
	int before = s->state;

	s->state = state;
	if (state == before || (before < 0 && state == CAN_STATE_ERROR_ACTIVE))
		return false;
	if (state == CAN_STATE_ERROR_PASSIVE)
		*controller |= CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;
	else if (state == CAN_STATE_ERROR_WARNING)
		*controller |= CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING;
	else if (state == CAN_STATE_ERROR_ACTIVE)
		*controller |= CAN_ERR_CRTL_ACTIVE;
	return true;
}

/* What is new in the status becomes an error frame. */
static bool take_flags(struct slcan *s, uint8_t flags, struct can_frame *frame)
{
	uint8_t fresh = flags & ~s->flags, controller = 0;
	canid_t what = 0;

	s->flags = flags;
	s->asking = false;
	s->answers = true;
	/* Bus-off is told by those that tell states: the flags do not know it. */
	if (s->state != CAN_STATE_BUS_OFF &&
	    state_is(s,
		     flags & SLCAN_PASSIVE   ? CAN_STATE_ERROR_PASSIVE
		     : flags & SLCAN_WARNING ? CAN_STATE_ERROR_WARNING
					     : CAN_STATE_ERROR_ACTIVE,
		     &controller))
		what |= CAN_ERR_CRTL;
	if (fresh & (SLCAN_OVERRUN | SLCAN_RX_FULL)) {
		what |= CAN_ERR_CRTL;
		controller |= CAN_ERR_CRTL_RX_OVERFLOW;
		s->bus.counts.overflow++;
	}
	if (fresh & SLCAN_TX_FULL) {
		what |= CAN_ERR_CRTL;
		controller |= CAN_ERR_CRTL_TX_OVERFLOW;
	}
	if (fresh & SLCAN_BUS_ERROR)
		what |= CAN_ERR_BUSERROR;
	if (!what)
		return false;
	error_frame(s, frame, what, controller);
	return true;
}

static bool take_state(struct slcan *s, int state, struct can_frame *frame)
{
	bool was_off = s->state == CAN_STATE_BUS_OFF;
	uint8_t controller = 0;

	if (!state_is(s, state, &controller))
		return false;
	error_frame(s, frame,
		    (state == CAN_STATE_BUS_OFF ? CAN_ERR_BUSOFF : CAN_ERR_CRTL) |
			    (was_off ? CAN_ERR_RESTARTED : 0),
		    controller);
	return true;
}

/* A frame was refused, or what was sent at the start, or a question that it does not know. */
static bool take_refusal(struct slcan *s, struct can_frame *frame)
{
	if (s->refusals) {
		s->refusals--;
		return false;
	}
	if (s->asking && !s->answers) {
		s->asking = false;
		s->asks++;
		return false;
	}
	error_frame(s, frame, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_OVERFLOW);
	return true;
}

/* True: *frame is one for the caller. */
static bool take(struct slcan *s, unsigned char byte, struct can_frame *frame)
{
	struct slcan_told told;

	switch (slcan_line_take(&s->line, byte, &told)) {
	case SLCAN_FRAME:
		if (!passes(s, told.frame.can_id))
			return false;
		s->bus.counts.received++;
		*frame = told.frame;
		return true;
	case SLCAN_REFUSED:
		return take_refusal(s, frame);
	case SLCAN_FLAGS:
		return take_flags(s, told.flags, frame);
	case SLCAN_STATE:
		return take_state(s, told.state, frame);
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
	if (s->gone)
		return s->gone;
	do
		n = read(s->fd, s->in, sizeof(s->in));
	while (n < 0 && errno == EINTR);
	if (n < 0)
		return errno == EAGAIN ? 0 : failed(s, errno);
	/* VMIN is 1: no byte is the end, not a pause. */
	if (!n)
		return failed(s, EIO);
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
		struct pollfd poll = {.fd = s->fd,
				      .events =
					      (short)(POLLIN | (s->out_n ? POLLOUT : 0))};
		int64_t now = slcan_now(bus), left = until_ns > now ? until_ns - now : 0;
		struct timespec timeout = {left / NS_PER_S, left % NS_PER_S};

		if (s->in_at < s->in_n)
			return 0;
		if (s->gone)
			return s->gone;
		if (ppoll(&poll, 1, &timeout, NULL) < 0)
			return -errno;
		/* The rest of a line goes out meanwhile; if that fails, receive says so. */
		if (poll.revents & POLLOUT)
			flush(s);
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
	return of(bus)->state;
}

/*
 * Off the bus; the adapter must have read that before the line goes. What it does not take
 * is thrown away: to close a tty may wait 30 s for it.
 */
static void slcan_close(struct can_bus *bus)
{
	struct slcan *s = of(bus);
	bool told = false, read = false;
	int left = 0;

	for (int i = 0; i < DRAIN_POLLS && !read && !s->gone; i++) {
		told = told || !put(s, "C\r", 2);
		read = told && !flush(s) && (ioctl(s->fd, TIOCOUTQ, &left) < 0 || !left);
		if (!read)
			nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
	}
	if (!read)
		tcflush(s->fd, TCOFLUSH);
	ioctl(s->fd, TIOCNXCL);
	close(s->fd);
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

static int refuse(const struct can_bus_request *request, int code,
		  struct incise_error *err)
{
	const char *where = request->where, *device = request->device;

	switch (code) {
	case ENOENT:
	case ENXIO:
	case ENODEV:
		return incise_error_set(err, ENODEV,
					"%s: %s is not there: is the adapter plugged in? "
					"/dev/serial/by-id lists those that are",
					where, device);
	case EACCES:
	case EPERM:
		return incise_error_set(
			err, EACCES,
			"%s: no right to open %s: join the group that owns "
			"it, which mostly is dialout",
			where, device);
	case EBUSY:
	case EWOULDBLOCK:
		return incise_error_set(
			err, EBUSY,
			"%s: another program has %s open: end it first, or "
			"drive from one place only",
			where, device);
	case ENOTTY:
	case EINVAL:
		return incise_error_set(
			err, EINVAL,
			"%s: %s is no serial line: expected the tty of an "
			"adapter that speaks slcan, such as /dev/ttyACM0",
			where, device);
	case ENOMEM:
		return incise_error_set(err, ENOMEM, "%s: out of memory", where);
	default:
		return incise_error_set(err, EIO, "%s: %s: %s", where, device,
					strerror(code));
	}
}

/*
 * Bytes as they are, 8N1, no flow control. The speed is left as stty set it: over USB it
 * mostly means nothing, and where it does only the user knows. But 9600, which a port has
 * when nobody set it, carries no cycle, and 115200 is what such adapters have.
 */
static int set_raw(int fd)
{
	struct termios t;

	if (tcgetattr(fd, &t) < 0)
		return -ENOTTY;
	cfmakeraw(&t);
	t.c_cflag |= CLOCAL | CREAD;
	t.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS);
	t.c_iflag &= ~(tcflag_t)(IXOFF | IXANY | INPCK);
	t.c_cc[VMIN] = 1;
	t.c_cc[VTIME] = 0;
	if (cfgetospeed(&t) == B9600)
		cfsetspeed(&t, B115200);
	return tcsetattr(fd, TCSANOW, &t) < 0 ? -errno : 0;
}

/* A descriptor that is ours alone, or -errno. */
static int open_line(const char *device)
{
	struct stat is;
	int fd, rc;

	/* To open what is no line may wait, or do what nobody asked for. */
	if (stat(device, &is) < 0)
		return -errno;
	if (!S_ISCHR(is.st_mode))
		return -ENOTTY;
	fd = open(device, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	if (fd < 0)
		return -errno;
	/* TIOCEXCL does not keep root out; the lock does, of those that ask for it. */
	if (!isatty(fd))
		rc = -ENOTTY;
	else if (flock(fd, LOCK_EX | LOCK_NB) < 0 || ioctl(fd, TIOCEXCL) < 0)
		rc = -errno;
	else
		rc = set_raw(fd);
	if (rc) {
		close(fd);
		return rc;
	}
	/* What lies there is of another time. */
	tcflush(fd, TCIOFLUSH);
	return fd;
}

static int slcan_open(struct can_bus **bus, const struct can_bus_request *request,
		      struct incise_error *err)
{
	uint32_t bitrate = request->bitrate ? request->bitrate : BITRATE;
	char start[] = "\rC\rS0\rO\r";
	int number = rate_number(bitrate), rc;
	struct slcan *s;

	if (number < 0)
		return incise_error_set(
			err, EINVAL,
			"%s: no adapter has %u bit/s: choose 10000, 20000, 50000, 100000, "
			"125000, 250000, 500000, 800000 or 1000000, as the drive has it",
			request->where, bitrate);
	s = calloc(1, sizeof(*s));
	if (!s)
		return refuse(request, ENOMEM, err);
	s->fd = open_line(request->device);
	if (s->fd < 0) {
		rc = refuse(request, -s->fd, err);
		free(s);
		return rc;
	}
	s->bus.ops = &slcan_ops;
	s->bus.bitrate = bitrate;
	strncpy(s->bus.name, request->device, sizeof(s->bus.name) - 1);
	s->state = -EOPNOTSUPP;
	s->asked_ns = slcan_now(&s->bus);
	s->refusals = 4;
	start[4] = (char)('0' + number);
	rc = put(s, start, sizeof(start) - 1);
	if (rc) {
		rc = rc == -ENOBUFS
			     ? incise_error_set(err, EIO,
						"%s: %s takes no bytes: unplug the "
						"adapter and plug it in again",
						request->where, request->device)
			     : refuse(request, -rc, err);
		tcflush(s->fd, TCOFLUSH);
		close(s->fd);
		free(s);
		return rc;
	}
	*bus = &s->bus;
	return 0;
}

const struct can_transport can_transport_slcan = {.name = "slcan", .open = slcan_open};
