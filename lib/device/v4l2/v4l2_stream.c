// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A camera's frames; see v4l2_stream.h. Answers of the driver are checked: index of a
 * buffer, size within it, a rising timestamp near now, a rising count.
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
#define ASKED 32       /* buffers; 24 of them may wait, for 0.4 s at 60 Hz */
#define FEWEST 4       /* one waits, one is held, one returned, one the driver's */
#define ERRORS_MAX 10  /* of dequeueing, in a row */
#define ERROR_MS 10    /* of rest after each */
#define DAMAGED_ROW 30 /* damaged frames in a row end the stream */
#define SILENT_NS 5000000000LL /* without a frame; or so many periods: */
#define SILENT_PERIODS 20
#define STALE_NS 10000000000LL /* largest valid age of a frame */
/*
 * A driver may compute a timestamp: from the camera's own clock (UVC), or for the end of
 * a frame that it returns before that (vivid). Other clocks are off by more.
 */
#define FUTURE_NS 300000000
#define JUMP_MAX 1000 /* valid step of the count of a damaged frame */

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
		"%s: the camera's driver has no timestamps of CLOCK_MONOTONIC, so "
		"frames cannot be aligned with the force; use another camera or driver",
		s->where);
}

static int gone(const struct v4l2_stream *s, struct incise_error *err)
{
	return incise_error_set(
		err, ENODEV, "%s: the camera was unplugged; plug it in and start again",
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
				     "%s: the camera's driver accepts no more buffers: "
				     "%s; unplug the camera and plug it in",
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
					"%s: the camera's driver cannot describe "
					"buffer %d: %s",
					s->where, i, strerror(-rc));
	if (!is_monotonic(&buffer))
		return other_clock(s, EPROTO, err);
	if (!buffer.length || buffer.length < s->shape.least)
		return incise_error_set(err, EPROTO,
					"%s: the camera's driver has buffers of %u "
					"bytes for frames of %zu",
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
					rc == -EBUSY ? "%s: another program uses the "
						       "camera; end it: %s"
						     : "%s: the camera's driver has no "
						       "memory: %s",
					s->where, strerror(-rc));
	if (asked.count < FEWEST)
		return incise_error_set(err, EPROTO,
					"%s: the camera's driver has %u buffers, but "
					"fewer than %d lose frames; give it more",
					s->where, asked.count, FEWEST);
	n = asked.count < V4L2_BUFFERS_MAX ? asked.count : V4L2_BUFFERS_MAX;
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
					rc == -ENOSPC ? "%s: the bus has too little "
							"bandwidth for the camera; "
							"lower size or rate_hz in "
							"camera_setup: %s"
						      : "%s: the camera does not "
							"start: %s",
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

	if (s->runs)
		v4l2_ask(s->fd, VIDIOC_STREAMOFF, &type);
	for (int i = 0; i < s->n; i++)
		munmap(s->slot[i].data, s->slot[i].length);
	if (s->n)
		v4l2_ask(s->fd, VIDIOC_REQBUFS, &none);
	s->n = 0;
	s->runs = false;
}

/* Queue buffers that the reader has returned. */
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

/* A JPEG from its first marker to its last, which padding may follow. */
static bool is_jpeg(const uint8_t *data, size_t size)
{
	if (size < 4 || data[0] != 0xff || data[1] != 0xd8)
		return false;
	for (size_t i = size - 1; i > 2; i--)
		if (data[i] == 0xd9 && data[i - 1] == 0xff)
			return true;
	return false;
}

/* The timestamp, ns; -1: an impossible one. */
static int64_t timestamp_of(const struct v4l2_stream *s, const struct v4l2_buffer *buffer,
			    int64_t now)
{
	int64_t t;

	if (buffer->timestamp.tv_sec < 0 || buffer->timestamp.tv_sec > 1000000000 ||
	    buffer->timestamp.tv_usec < 0 || buffer->timestamp.tv_usec > 999999)
		return -1;
	t = buffer->timestamp.tv_sec * INCISE_NS_PER_S + buffer->timestamp.tv_usec * 1000;
	return t > s->timestamp_ns && t <= now + FUTURE_NS && t >= now - STALE_NS ? t
										  : -1;
}

/*
 * Drivers timestamp a frame at the start of its exposure, or when its last pixel has arrived:
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

/* Advance the counts; frames in a gap are lost. */
static int count_v4l2_stream(struct v4l2_stream *s, uint32_t sequence, bool whole,
			     struct incise_error *err)
{
	uint32_t step = s->any ? sequence - s->sequence : 1;

	/* Some drivers do not count damaged frames, or give them any number. */
	if (!whole && (!s->any || !step || step > JUMP_MAX)) {
		s->seq++;
		return 0;
	}
	if (!step || step > INT32_MAX)
		return incise_error_set(
			err, EIO,
			"%s: the camera's driver numbers frame %u after %u, so losses "
			"cannot be detected; use another camera or driver",
			s->where, sequence, s->sequence);
	/* The first frame is number 0. */
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
		"%s: the last %d frames of the camera were all damaged, too short or "
		"had a wrong time; check its cable",
		s->where, DAMAGED_ROW);
}

/*
 * The queue of waiting buffers: only the thread moves the head; the side that takes the
 * oldest moves the tail over it. So a number is taken once, and its place is written again
 * only after that.
 */
static int waiting_at(const struct v4l2_stream *s, unsigned long long n)
{
	return atomic_load_explicit(&s->waiting[n % V4L2_BUFFERS_MAX],
				    memory_order_relaxed);
}

/* False: the other thread took number @tail. */
static bool take_tail(struct v4l2_stream *s, unsigned long long tail)
{
	return atomic_compare_exchange_strong_explicit(
		&s->tail, &tail, tail + 1, memory_order_acq_rel, memory_order_relaxed);
}

/* Buffers that may wait; the others are for the reader, and for drivers that keep a few. */
static unsigned int capacity(const struct v4l2_stream *s)
{
	int others = s->n / 4;

	return (unsigned int)(s->n - (others < FEWEST - 1 ? FEWEST - 1 : others));
}

/* Add it to the waiting ones; if they are full, the oldest is lost. */
static int publish(struct v4l2_stream *s, int i, struct incise_error *err)
{
	unsigned long long head = atomic_load_explicit(&s->head, memory_order_relaxed);
	unsigned long long tail = atomic_load_explicit(&s->tail, memory_order_acquire);
	int old = NONE;

	if (head - tail >= capacity(s)) {
		old = waiting_at(s, tail);
		/* Else it was read just now, and they are not full. */
		if (!take_tail(s, tail))
			old = NONE;
	}
	s->damaged_row = 0;
	atomic_store_explicit(&s->waiting[head % V4L2_BUFFERS_MAX], (signed char)i,
			      memory_order_relaxed);
	atomic_store_explicit(&s->head, head + 1, memory_order_release);
	if (old == NONE)
		return 0;
	atomic_fetch_add_explicit(&s->lost, 1, memory_order_relaxed);
	return queue(s, old, err);
}

static int take_v4l2_stream(struct v4l2_stream *s, const struct v4l2_buffer *buffer,
			    int64_t now, struct incise_error *err)
{
	struct v4l2_slot *slot;
	int64_t timestamp;
	bool whole;
	int rc;

	if (buffer->index >= (uint32_t)s->n || !s->slot[buffer->index].queued)
		return incise_error_set(err, EIO,
					"%s: the camera's driver returned a buffer "
					"that does not exist, number %u; use another "
					"driver",
					s->where, buffer->index);
	slot = &s->slot[buffer->index];
	slot->queued = false;
	if (!is_monotonic(buffer))
		return other_clock(s, EIO, err);
	timestamp = timestamp_of(s, buffer, now);
	whole = timestamp >= 0 && is_whole(s, buffer, slot);
	rc = count_v4l2_stream(s, buffer->sequence, whole, err);
	if (rc)
		return rc;
	if (!whole)
		return drop_damaged(s, (int)buffer->index, err);
	s->timestamp_ns = timestamp;
	slot->t_ns = timestamp + to_middle(s, buffer);
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
				"%s: no frame arrived from the camera for %.0f s; "
				"check its cable, and start again",
				s->where, (double)most / 1e9);
}

/* Handle an answer of the driver without a frame. */
static int no_frame(struct v4l2_stream *s, int rc, short events, struct incise_error *err)
{
	struct v4l2_capability reported;

	if (rc == -ENODEV)
		return gone(s, err);
	if (rc == -EAGAIN && !(events & (POLLERR | POLLHUP | POLLNVAL))) {
		/* A driver that is ready without a frame must not cause a busy loop. */
		poll(NULL, 0, 1);
		return check_silence(s, err);
	}
	if (rc != -EAGAIN && rc != -EIO)
		s->errors = ERRORS_MAX;
	/* The error may be permanent, and returned at once. */
	if (++s->errors < ERRORS_MAX) {
		poll(NULL, 0, ERROR_MS);
		return 0;
	}
	if (v4l2_ask(s->fd, VIDIOC_QUERYCAP, &reported) == -ENODEV)
		return gone(s, err);
	return incise_error_set(err, EIO,
				"%s: the camera's driver sends no more frames: %s; "
				"unplug the camera and plug it in",
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
		return no_frame(s, -errno, ready.revents, err);
	/*
	 * Again: v4l2loopback, when its feeder is faster than this thread, continues with
	 * a buffer that was not yet queued.
	 */
	rc = take_back(s, err);
	if (rc)
		return rc;
	rc = v4l2_ask(s->fd, VIDIOC_DQBUF, &buffer);
	if (rc)
		return no_frame(s, rc, ready.revents, err);
	s->errors = 0;
	s->seen_ns = incise_monotonic_ns();
	rc = take_v4l2_stream(s, &buffer, s->seen_ns, err);
	return rc ? rc : 1;
}

int v4l2_stream_read(struct v4l2_stream *s, struct incise_camera_frame *frame)
{
	unsigned long long tail;
	const struct v4l2_slot *slot;
	int i;

	/* Again only if the thread dropped the oldest meanwhile. */
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
