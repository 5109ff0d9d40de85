// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A camera's frames; see v4l2_stream.h. Answers of the driver are checked: index of a
 * buffer, size within it, a rising timestamp near now, a rising count.
 */
#include <errno.h>
#include <math.h>
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
#define FUTURE_NS 5000000 /* of timestamps computed from the camera's clock (UVC) */
#define AGE_NS 100000000  /* of frames, beside exposure and … */
#define AGE_PERIODS 3
#define PERIOD_NS 100000000 /* … if their rate is not known */
#define WINDOW 8	    /* frames, beside those that may wait in all buffers */
#define STEP_ROW 3 /* timestamps off the grid, in a row, that are a step of the clock */
#define LEAK (1.0 / 16) /* of lateness, into what is expected */
#define HOLE 256	/* zeros in a row in a JPEG: less than a packet of USB */
#define JUMP_MAX 1000	/* valid step of the count of a damaged frame */

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
	s->clock.lowest_ns = INT64_MAX;
	s->clock.highest_ns = INT64_MIN;
	if (shape->rate_hz > 0)
		s->clock.period_ns = 1e9 / shape->rate_hz;
	atomic_store_explicit(&s->stride, 1, memory_order_relaxed);
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

/*
 * A JPEG from its first marker (SOI) to its last (EOI), which padding may follow.
 *
 *     SOI [ marker, length, … ] [ DHT … ] [ SOS … ] coded RST0 coded RST1 coded … EOI
 *
 * A lost part shows by another SOI, by restarts out of order, or by a hole of zeros: in coded data
 * the shortest code is all zeros, and unless that is the end of a block (EOB), as in the tables
 * of a few cameras, only blocks of noise would have it again and again.
 */
struct jpeg {
	bool zeros_end[4];	/* by the number of the table: its shortest code is EOB */
	bool sequential, dense; /* coded data have no long row of zeros */
	unsigned int restarts;
};

/* Tables of codes: class and number, how many of each length, the symbols. */
static void read_tables(struct jpeg *jpeg, const uint8_t *at, const uint8_t *end)
{
	while (end - at > 17) {
		int n = 0;

		for (int i = 1; i <= 16; i++)
			n += at[i];
		if (*at >> 4)
			jpeg->zeros_end[*at & 3] = n && !at[17];
		at = end - at > 17 + n ? at + 17 + n : end;
	}
}

/* @code of the marker; from @at to @end behind its length. */
static void read_segment(struct jpeg *jpeg, uint8_t code, const uint8_t *at,
			 const uint8_t *end)
{
	if (code == 0xc4)
		read_tables(jpeg, at, end);
	else if (code >= 0xc0 && code <= 0xcf && code != 0xc8 && code != 0xcc)
		jpeg->sequential = code <= 0xc1;
	else if (code == 0xda && end - at > 2)
		jpeg->dense = jpeg->sequential && !jpeg->zeros_end[at[2] & 3];
	jpeg->restarts = 0;
}

static bool is_jpeg(const uint8_t *data, size_t size)
{
	struct jpeg jpeg = {{false, true}, true, true, 0};
	size_t zeros = 0;

	if (size < 4 || data[0] != 0xff || data[1] != 0xd8)
		return false;
	for (size_t i = 2; i + 1 < size; i++) {
		uint8_t code = data[i + 1];

		zeros = data[i] ? 0 : zeros + 1;
		if (zeros > HOLE && jpeg.dense)
			return false;
		if (data[i] != 0xff || code == 0xff)
			continue;
		i++;
		if (code == 0xd9)
			return true;
		if (code == 0xd8 ||
		    (code >= 0xd0 && code <= 0xd7 && (code & 7) != jpeg.restarts++ % 8))
			return false;
		if (code >= 0xc0 && (code < 0xd0 || code > 0xd7)) {
			size_t length =
				i + 2 < size ? data[i + 1] * 256U + data[i + 2] : 0;

			if (length < 2 || length >= size - i)
				return false;
			read_segment(&jpeg, code, data + i + 3, data + i + length + 1);
			i += length;
		}
	}
	return false;
}

/* The timestamp, ns; -1: an impossible one. */
static int64_t timestamp_of(const struct v4l2_buffer *buffer)
{
	if (buffer->timestamp.tv_sec < 0 || buffer->timestamp.tv_sec > 1000000000 ||
	    buffer->timestamp.tv_usec < 0 || buffer->timestamp.tv_usec > 999999)
		return -1;
	return buffer->timestamp.tv_sec * INCISE_NS_PER_S +
	       buffer->timestamp.tv_usec * 1000;
}

/* Largest age of a frame, ns. */
static double age_most(const struct v4l2_stream *s)
{
	double period_ns =
		s->shape.rate_hz > 0 ? INCISE_NS_PER_S / s->shape.rate_hz : PERIOD_NS;

	return s->shape.age_ms > 0
		       ? s->shape.age_ms * 1e6
		       : (double)s->exposure_ns + AGE_PERIODS * period_ns + AGE_NS;
}

/* Whether timestamps that do not fit, the last one of frame s->seq, follow each other. */
static bool has_stepped(struct v4l2_stream *s, int64_t t)
{
	struct v4l2_clock *c = &s->clock;
	double step_ns = (double)(t - c->odd_ns) / (double)(s->seq - c->odd_seq);

	c->odd_row = c->odd_row && step_ns > 0 && step_ns < 1.5 * c->period_ns
			     ? c->odd_row + 1
			     : 1;
	c->odd_ns = t;
	c->odd_seq = s->seq;
	return c->odd_row >= STEP_ROW;
}

/* Whether the timestamp of frame s->seq, which arrived with this age, may be right. */
static bool fits_clock(struct v4l2_stream *s, int64_t t, int64_t age)
{
	struct v4l2_clock *c = &s->clock;
	double frames = (double)(s->seq - c->seq);
	double late = (double)t - c->grid_ns - frames * c->period_ns;
	double older = (double)age - c->age_ns;
	double most = fmax(c->period_ns / 2, FUTURE_NS);
	bool odd = s->timestamp_ns && c->period_ns > 0 &&
		   ((late < -most && older > most) || (late > most && older < -most));

	/* No step makes a frame too old. */
	if (odd && ((double)age > age_most(s) || !has_stepped(s, t)))
		return false;
	c->odd_row = 0;
	c->grid_ns = (double)t;
	if (s->timestamp_ns && !odd && late > 0 && c->period_ns > 0)
		c->grid_ns -= late * (1 - LEAK);
	c->age_ns += s->timestamp_ns && !odd && older > 0 ? older * LEAK : older;
	c->seq = s->seq;
	return true;
}

/*
 * Follow the least age of a window, in which not all frames have waited for the thread. 0, or
 * -EIO: they are too old.
 */
static int follow_clock(struct v4l2_stream *s, int64_t t, int64_t age,
			struct incise_error *err)
{
	struct v4l2_clock *c = &s->clock;
	double most = age_most(s);

	if (!c->n++) {
		c->first_ns = t;
		c->first_seq = s->seq;
		c->least_ns = age;
	}
	c->least_ns = age < c->least_ns ? age : c->least_ns;
	if (c->n < s->n + WINDOW)
		return 0;
	c->n = 0;
	c->period_ns = (double)(t - c->first_ns) / (double)(s->seq - c->first_seq);
	c->lowest_ns = c->least_ns < c->lowest_ns ? c->least_ns : c->lowest_ns;
	c->highest_ns = c->least_ns > c->highest_ns ? c->least_ns : c->highest_ns;
	atomic_store_explicit(&s->clock_ns, c->highest_ns - c->lowest_ns,
			      memory_order_relaxed);
	if ((double)c->least_ns <= most)
		return 0;
	return incise_error_set(
		err, EIO,
		"%s: timestamps of the camera are %.1f ms old when its frames arrive, "
		"more than %.1f ms: its clock is not the computer's; use another camera "
		"or driver, or set camera_setup.age_ms and calibrate its delay",
		s->where, (double)c->least_ns / 1e6, most / 1e6);
}

/*
 * 1: a timestamp that may be right; 0: a wrong one; -EIO: of a wrong clock. A driver may return a
 * frame before what it says is its end (vivid).
 */
static int judge_timestamp(struct v4l2_stream *s, const struct v4l2_buffer *buffer,
			   int64_t t, int64_t now, struct incise_error *err)
{
	bool at_end = (buffer->flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) ==
		      V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
	double ahead = FUTURE_NS + (at_end ? s->clock.period_ns : 0);
	int rc;

	s->clock.last_ns = now - t;
	if (t < 0 || t <= s->timestamp_ns || (double)(t - now) > ahead ||
	    !fits_clock(s, t, now - t))
		return 0;
	rc = follow_clock(s, t, now - t, err);
	return rc ? rc : 1;
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

/*
 * The number of frames that the driver's count went on by. Some drivers count fields: then it goes
 * on by as many within one period.
 */
static uint32_t frames_of(struct v4l2_stream *s, uint32_t step, int64_t t)
{
	uint32_t stride = atomic_load_explicit(&s->stride, memory_order_relaxed);

	if (stride == 1 && !s->seq && s->shape.rate_hz > 0 && step <= JUMP_MAX &&
	    (double)(t - s->timestamp_ns) < 1.5e9 / s->shape.rate_hz)
		stride = step;
	if (!stride || step % stride)
		stride = 1;
	atomic_store_explicit(&s->stride, stride, memory_order_relaxed);
	return step / stride;
}

/* Advance the counts; frames in a gap are lost. */
static int count_v4l2_stream(struct v4l2_stream *s, uint32_t sequence, bool whole,
			     int64_t t, struct incise_error *err)
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
	if (s->any) {
		step = frames_of(s, step, t);
		s->seq += step;
	}
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
	if (s->wrong_row)
		return incise_error_set(
			err, EIO,
			"%s: the last timestamps of the camera are wrong: the clock is "
			"not the computer's, or stands, or was stepped, and now their "
			"age is %.1f ms; use another camera or driver",
			s->where, (double)s->clock.last_ns / 1e6);
	return incise_error_set(
		err, EIO,
		"%s: the last %d frames of the camera were all damaged or too short; "
		"check its cable",
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
	s->damaged_row = s->wrong_row = 0;
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
	timestamp = timestamp_of(buffer);
	whole = is_whole(s, buffer, slot);
	rc = count_v4l2_stream(s, buffer->sequence, whole, timestamp, err);
	if (!rc && whole) {
		rc = judge_timestamp(s, buffer, timestamp, now, err);
		s->wrong_row += !rc;
		whole = rc > 0;
	}
	if (rc < 0)
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
