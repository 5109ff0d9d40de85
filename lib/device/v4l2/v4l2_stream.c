// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A camera's pictures; see v4l2_stream.h. What the driver says of one is believed only as
 * far as it can be: an index of a buffer that it has, a size within it, a stamp that
 * rises and is near now, a count that rises.
 */
#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <incise/clock.h>
#include <linux/videodev2.h>
#include "../../base/monotonic.h"
#include "v4l2_file.h"
#include "v4l2_stream.h"

#define NONE (-1)
#define ASKED 32       /* buffers: 24 wait: 0.4 s at 60 Hz for a reader that is held up */
#define FEWEST 4       /* one waits, one is held, one returned, one the driver's */
#define ERRORS_MOST 10 /* in a row, that taking a picture may fail */
#define ERROR_MS 10    /* of rest after each */
#define DAMAGED_ROW 30 /* damaged pictures in a row: it is of no use */
#define SILENT_NS 5000000000LL /* without any picture; or so many periods: */
#define SILENT_PERIODS 20
#define STALE_NS 10000000000LL /* age of a picture that is not believed */
/*
 * A driver may reckon a stamp: from the camera's own clock (UVC), or for the end of a
 * picture that it hands out before (vivid). Another clock is off by more.
 */
#define FUTURE_NS 300000000
#define JUMP_MOST 1000 /* step of the count that a damaged picture may make */

static struct v4l2_buffer buffer_at(uint32_t index)
{
	return (struct v4l2_buffer){.index = index,
				    .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
				    .memory = V4L2_MEMORY_MMAP};
}

static bool is_monotonic(const struct v4l2_buffer *buffer)
{
	return (buffer->flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) ==
	       V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
}

static int other_clock(const struct v4l2_stream *s, int code, struct incise_error *err)
{
	return incise_error_set(
		err, code,
		"%s: the camera's driver does not stamp its pictures with "
		"CLOCK_MONOTONIC, so that they have no time beside the force; use "
		"another camera or driver",
		s->where);
}

static int gone(const struct v4l2_stream *s, struct incise_error *err)
{
	return incise_error_set(
		err, ENODEV, "%s: the camera was unplugged; plug it in and begin again",
		s->where);
}

static int queue(struct v4l2_stream *s, int i, struct incise_error *err)
{
	struct v4l2_buffer buffer = buffer_at((uint32_t)i);
	int rc = v4l2_ask(s->fd, VIDIOC_QBUF, &buffer);

	s->slot[i].queued = !rc;
	if (rc == -ENODEV)
		return gone(s, err);
	return rc ? incise_error_set(err, EIO,
				     "%s: the camera's driver takes a buffer no more: "
				     "%s; unplug and plug it",
				     s->where, strerror(-rc))
		  : 0;
}

static int map(struct v4l2_stream *s, int i, struct incise_error *err)
{
	struct v4l2_buffer buffer = buffer_at((uint32_t)i);
	int rc = v4l2_ask(s->fd, VIDIOC_QUERYBUF, &buffer);
	void *data;

	if (rc)
		return incise_error_set(err, -rc,
					"%s: the camera's driver tells nothing of buffer "
					"%d: %s",
					s->where, i, strerror(-rc));
	if (!is_monotonic(&buffer))
		return other_clock(s, EPROTO, err);
	if (!buffer.length || buffer.length < s->shape.least)
		return incise_error_set(err, EPROTO,
					"%s: the camera's driver has buffers of %u bytes "
					"for pictures of %zu",
					s->where, buffer.length, s->shape.least);
	data = mmap(NULL, buffer.length, PROT_READ, MAP_SHARED, s->fd, buffer.m.offset);
	if (data == MAP_FAILED)
		return incise_error_set(err, errno,
					"%s: the camera's memory cannot be mapped: %s",
					s->where, strerror(errno));
	s->slot[i].data = data;
	s->slot[i].length = buffer.length;
	return 0;
}

static int take_buffers(struct v4l2_stream *s, struct incise_error *err)
{
	struct v4l2_requestbuffers asked = {.count = ASKED,
					    .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
					    .memory = V4L2_MEMORY_MMAP};
	int rc = v4l2_ask(s->fd, VIDIOC_REQBUFS, &asked);
	uint32_t n;

	if (rc)
		return incise_error_set(err, -rc,
					rc == -EBUSY
						? "%s: another program uses the camera; "
						  "end that one: %s"
						: "%s: the camera gives no memory: %s",
					s->where, strerror(-rc));
	if (asked.count < FEWEST)
		return incise_error_set(err, EPROTO,
					"%s: the camera's driver has %u buffers, and "
					"fewer than %d lose pictures; give it more",
					s->where, asked.count, FEWEST);
	n = asked.count < V4L2_BUFFERS_MOST ? asked.count : V4L2_BUFFERS_MOST;
	for (s->n = 0; s->n < (int)n; s->n++) {
		rc = map(s, s->n, err);
		if (rc)
			return rc;
	}
	return 0;
}

int v4l2_stream_start(struct v4l2_stream *s, int fd, const struct v4l2_shape *shape,
		      int64_t exposure_ns, const char *where, struct incise_error *err)
{
	int type = V4L2_BUF_TYPE_VIDEO_CAPTURE, rc;

	memset(s, 0, sizeof(*s));
	s->fd = fd;
	s->shape = *shape;
	s->exposure_ns = exposure_ns;
	s->where = where;
	s->held = NONE;
	rc = take_buffers(s, err);
	for (int i = 0; i < s->n && !rc; i++)
		rc = queue(s, i, err);
	if (rc)
		return rc;
	rc = v4l2_ask(fd, VIDIOC_STREAMON, &type);
	if (rc)
		return incise_error_set(err, -rc,
					rc == -ENOSPC ? "%s: the bus has no room for the "
							"camera's pictures; lower size "
							"or rate_hz in camera_setup: %s"
						      : "%s: the camera does not "
							"begin: %s",
					where, strerror(-rc));
	s->runs = true;
	s->seen_ns = incise_monotonic_ns();
	return 0;
}

void v4l2_stream_stop(struct v4l2_stream *s)
{
	struct v4l2_requestbuffers none = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
					   .memory = V4L2_MEMORY_MMAP};
	int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;

	/* Nothing can be done about a device that does not stop. */
	if (s->runs)
		v4l2_ask(s->fd, VIDIOC_STREAMOFF, &type);
	for (int i = 0; i < s->n; i++)
		munmap(s->slot[i].data, s->slot[i].length);
	if (s->n)
		v4l2_ask(s->fd, VIDIOC_REQBUFS, &none);
	s->n = 0;
	s->runs = false;
}

/* Buffers that the reader is done with go back to the driver. */
static int take_back(struct v4l2_stream *s, struct incise_error *err)
{
	unsigned int set =
		atomic_exchange_explicit(&s->returned, 0, memory_order_acquire);
	int rc = 0;

	for (int i = 0; i < s->n && !rc; i++)
		if (set >> i & 1)
			rc = queue(s, i, err);
	return rc;
}

/* A JPEG from its first marker to its last, which may have padding behind it. */
static bool is_jpeg(const uint8_t *data, size_t size)
{
	if (size < 4 || data[0] != 0xff || data[1] != 0xd8)
		return false;
	for (size_t i = size - 1; i > 2; i--)
		if (data[i] == 0xd9 && data[i - 1] == 0xff)
			return true;
	return false;
}

/* The stamp, ns; -1: it is none that can be. */
static int64_t stamp_of(const struct v4l2_stream *s, const struct v4l2_buffer *buffer,
			int64_t now)
{
	int64_t t;

	if (buffer->timestamp.tv_sec < 0 || buffer->timestamp.tv_sec > 1000000000 ||
	    buffer->timestamp.tv_usec < 0 || buffer->timestamp.tv_usec > 999999)
		return -1;
	t = buffer->timestamp.tv_sec * INCISE_NS_PER_S + buffer->timestamp.tv_usec * 1000;
	return t > s->stamp_ns && t <= now + FUTURE_NS && t >= now - STALE_NS ? t : -1;
}

/*
 * A picture is stamped when its exposure begins, or when its last pixel is there:
 *
 *     SOE                        EOF
 *      ├─ exposure ─┼─ readout ───┤      The readout is not known here: what it makes the
 *           middle                       second kind late, a measured delay takes off.
 */
static int64_t to_middle(const struct v4l2_stream *s, const struct v4l2_buffer *buffer)
{
	bool begin = (buffer->flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) ==
		     V4L2_BUF_FLAG_TSTAMP_SRC_SOE;

	return begin ? s->exposure_ns / 2 : -s->exposure_ns / 2;
}

static bool is_whole(const struct v4l2_stream *s, const struct v4l2_buffer *buffer,
		     const struct v4l2_slot *slot)
{
	if (buffer->flags & V4L2_BUF_FLAG_ERROR || buffer->bytesused > slot->length ||
	    !buffer->bytesused || buffer->bytesused < s->shape.least)
		return false;
	return s->shape.pixels != INCISE_PIXELS_MJPEG ||
	       is_jpeg(slot->data, buffer->bytesused);
}

/* Go on with the driver's count, and with ours; a gap is lost. */
static int count(struct v4l2_stream *s, uint32_t sequence, bool whole,
		 struct incise_error *err)
{
	uint32_t step = s->any ? sequence - s->sequence : 1;

	/* Some drivers do not count what is damaged, or leave anything there. */
	if (!whole && (!s->any || !step || step > JUMP_MOST)) {
		s->seq++;
		return 0;
	}
	if (!step || step > INT32_MAX)
		return incise_error_set(
			err, EIO,
			"%s: the camera's driver counts picture %u behind "
			"%u, so that losses cannot be told; use another "
			"camera or driver",
			s->where, sequence, s->sequence);
	/* The first picture is number 0. */
	if (s->any)
		s->seq += step;
	s->any = true;
	s->sequence = sequence;
	atomic_fetch_add_explicit(&s->lost, step - 1, memory_order_relaxed);
	return 0;
}

static int drop_damaged(struct v4l2_stream *s, int i, struct incise_error *err)
{
	atomic_fetch_add_explicit(&s->damaged, 1, memory_order_relaxed);
	atomic_fetch_add_explicit(&s->lost, 1, memory_order_relaxed);
	if (++s->damaged_row < DAMAGED_ROW)
		return queue(s, i, err);
	return incise_error_set(
		err, EIO,
		"%s: the last %d pictures of the camera all came damaged, "
		"too short or with a wrong time; look at its cable",
		s->where, DAMAGED_ROW);
}

/*
 * The queue of those that wait: the thread alone moves the head, and whoever takes the
 * oldest moves the tail over it. A number is thus taken once, and its place, of as many
 * as there are buffers at most, is written again only when it was.
 */
static int waiting_at(const struct v4l2_stream *s, unsigned long long n)
{
	return atomic_load_explicit(&s->waiting[n % V4L2_BUFFERS_MOST],
				    memory_order_relaxed);
}

/* Whether number @tail was there, and not yet taken by the other thread. */
static bool take_tail(struct v4l2_stream *s, unsigned long long tail)
{
	return atomic_compare_exchange_strong_explicit(
		&s->tail, &tail, tail + 1, memory_order_acq_rel, memory_order_relaxed);
}

/*
 * How many may wait. Some drivers keep a few to fill: a quarter is for those, and the
 * reader.
 */
static unsigned int room(const struct v4l2_stream *s)
{
	int others = s->n / 4;

	return (unsigned int)(s->n - (others < FEWEST - 1 ? FEWEST - 1 : others));
}

/* Hand it over; where there is no room the oldest, which nobody has taken, was lost. */
static int publish(struct v4l2_stream *s, int i, struct incise_error *err)
{
	unsigned long long head = atomic_load_explicit(&s->head, memory_order_relaxed);
	unsigned long long tail = atomic_load_explicit(&s->tail, memory_order_acquire);
	int old = NONE;

	if (head - tail >= room(s)) {
		old = waiting_at(s, tail);
		/* Else it was read just now, and there is room. */
		if (!take_tail(s, tail))
			old = NONE;
	}
	s->damaged_row = 0;
	atomic_store_explicit(&s->waiting[head % V4L2_BUFFERS_MOST], (signed char)i,
			      memory_order_relaxed);
	atomic_store_explicit(&s->head, head + 1, memory_order_release);
	if (old == NONE)
		return 0;
	atomic_fetch_add_explicit(&s->lost, 1, memory_order_relaxed);
	return queue(s, old, err);
}

static int take(struct v4l2_stream *s, const struct v4l2_buffer *buffer, int64_t now,
		struct incise_error *err)
{
	struct v4l2_slot *slot;
	int64_t stamp;
	bool whole;
	int rc;

	if (buffer->index >= (uint32_t)s->n || !s->slot[buffer->index].queued)
		return incise_error_set(err, EIO,
					"%s: the camera's driver fills a buffer that it "
					"does not have, number %u; use another driver",
					s->where, buffer->index);
	slot = &s->slot[buffer->index];
	slot->queued = false;
	if (!is_monotonic(buffer))
		return other_clock(s, EIO, err);
	stamp = stamp_of(s, buffer, now);
	whole = stamp >= 0 && is_whole(s, buffer, slot);
	rc = count(s, buffer->sequence, whole, err);
	if (rc)
		return rc;
	if (!whole)
		return drop_damaged(s, (int)buffer->index, err);
	s->stamp_ns = stamp;
	slot->t_ns = stamp + to_middle(s, buffer);
	slot->seq = s->seq;
	slot->size = buffer->bytesused;
	return publish(s, (int)buffer->index, err);
}

static int check_silence(const struct v4l2_stream *s, struct incise_error *err)
{
	int64_t most = SILENT_NS;
	double periods_s = s->shape.rate_hz > 0 ? SILENT_PERIODS / s->shape.rate_hz : 0;

	if (periods_s * 1e9 > (double)most)
		most = (int64_t)(periods_s * 1e9);
	if (incise_monotonic_ns() - s->seen_ns < most)
		return 0;
	return incise_error_set(err, EIO,
				"%s: no picture came from the camera for %.0f s; look at "
				"its cable, and begin again",
				s->where, (double)most / 1e9);
}

/* What the driver answered other than a picture. */
static int no_picture(struct v4l2_stream *s, int rc, short events,
		      struct incise_error *err)
{
	struct v4l2_capability told;

	if (rc == -ENODEV)
		return gone(s, err);
	if (rc == -EAGAIN && !(events & (POLLERR | POLLHUP | POLLNVAL))) {
		/*
		 * Ready, and then not: a driver that goes on so must not take all time.
		 */
		poll(NULL, 0, 1);
		return check_silence(s, err);
	}
	if (rc != -EAGAIN && rc != -EIO)
		s->errors = ERRORS_MOST;
	/* It says so at once as long as it lasts. */
	if (++s->errors < ERRORS_MOST) {
		poll(NULL, 0, ERROR_MS);
		return 0;
	}
	if (v4l2_ask(s->fd, VIDIOC_QUERYCAP, &told) == -ENODEV)
		return gone(s, err);
	return incise_error_set(err, EIO,
				"%s: the camera's driver gives no more pictures: %s; "
				"unplug and plug it",
				s->where, strerror(rc == -EAGAIN ? EIO : -rc));
}

int v4l2_stream_step(struct v4l2_stream *s, int timeout_ms, struct incise_error *err)
{
	struct v4l2_buffer buffer = buffer_at(0);
	struct pollfd ready = {.fd = s->fd, .events = POLLIN};
	int rc = take_back(s, err);

	if (rc)
		return rc;
	rc = poll(&ready, 1, timeout_ms);
	if (rc < 0 && errno == EINTR)
		return 0;
	if (!rc)
		return check_silence(s, err);
	if (rc < 0)
		return no_picture(s, -errno, ready.revents, err);
	/*
	 * What came back meanwhile, too: v4l2loopback, where its feeder is faster than
	 * this thread, goes on with a buffer that was not yet queued.
	 */
	rc = take_back(s, err);
	if (rc)
		return rc;
	rc = v4l2_ask(s->fd, VIDIOC_DQBUF, &buffer);
	if (rc)
		return no_picture(s, rc, ready.revents, err);
	s->errors = 0;
	s->seen_ns = incise_monotonic_ns();
	rc = take(s, &buffer, s->seen_ns, err);
	return rc ? rc : 1;
}

int v4l2_stream_read(struct v4l2_stream *s, struct incise_camera_frame *frame)
{
	unsigned long long tail;
	const struct v4l2_slot *slot;
	int i;

	/* Again only where the thread, which has no room, was there first. */
	do {
		tail = atomic_load_explicit(&s->tail, memory_order_relaxed);
		if (tail == atomic_load_explicit(&s->head, memory_order_acquire))
			return 0;
		i = waiting_at(s, tail);
	} while (!take_tail(s, tail));
	if (s->held != NONE)
		atomic_fetch_or_explicit(&s->returned, 1u << s->held,
					 memory_order_release);
	s->held = i;
	slot = &s->slot[i];
	*frame = (struct incise_camera_frame){
		.t_ns = slot->t_ns,
		.seq = slot->seq,
		.width = s->shape.width,
		.height = s->shape.height,
		.stride = s->shape.stride,
		.pixels = s->shape.pixels,
		.data = slot->data,
		.size = slot->size,
	};
	return 1;
}
