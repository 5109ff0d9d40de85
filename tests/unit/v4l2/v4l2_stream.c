// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/v4l2/v4l2_stream.c on a driver that the test plays: every frame that was
 * lost or damaged is counted, what a caller holds is left alone, and what a driver says
 * wrongly is refused.
 */
#include "../unit.h"
#include <pthread.h>
#include <stdatomic.h>
#include "../../../lib/base/random.h"
#include "../../../lib/device/v4l2/v4l2_stream.h"
#include "driver.h"

#define WHERE "rig.conf:1: camera"
#define WAIT_MOST 24 /* of 32 buffers */
#define SPINS 1000   /* of a reader between two looks; a step takes about as long */

static struct v4l2_stream stream;
static struct incise_error err;

static struct v4l2_shape shape_of(enum incise_pixels pixels)
{
	struct v4l2_shape shape = {.pixels = pixels,
				   .width = 16,
				   .height = 8,
				   .stride = 32,
				   .least = 256,
				   .rate_hz = 30};

	driver.is.pixelformat = V4L2_PIX_FMT_YUYV;
	driver.is.sizeimage = 256;
	if (pixels == INCISE_PIXELS_MJPEG) {
		shape.stride = 0;
		shape.least = 0;
		driver.is.pixelformat = V4L2_PIX_FMT_MJPEG;
		driver.is.sizeimage = 100;
	}
	return shape;
}

static int start(enum incise_pixels pixels, int64_t exposure_ns)
{
	struct v4l2_shape shape = shape_of(pixels);

	err = (struct incise_error){0};
	return v4l2_stream_start(&stream, DRIVER_FD, &shape, exposure_ns, WHERE, &err);
}

static void begin(void)
{
	driver_reset();
	assert_int_equal(start(INCISE_PIXELS_YUYV, 0), 0);
}

static void end(void)
{
	v4l2_stream_stop(&stream);
	assert_int_equal(driver.streams, 0);
	assert_int_equal(driver.mapped, 0);
}

static int step(void)
{
	return v4l2_stream_step(&stream, 100, &err);
}

static void losses(uint64_t lost, uint64_t damaged)
{
	assert_true(atomic_load(&stream.lost) == lost);
	assert_true(atomic_load(&stream.damaged) == damaged);
}

/* Of the test that runs. */
static struct incise_camera_frame frame;

TEST(frames_come_in_order_with_their_timestamps)
{
	begin();
	assert_int_equal(v4l2_stream_read(&stream, &frame), 0);
	assert_int_equal(step(), 0);
	for (uint32_t i = 0; i < 100; i++) {
		/* A driver's count may begin anywhere, and runs over. */
		int64_t t_ns = driver_shoot(UINT32_MAX - 50 + i)->t_ns;

		assert_int_equal(step(), 1);
		assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
		assert_true(frame.seq == i);
		/* A timeval has microseconds. */
		assert_true(frame.t_ns == t_ns / 1000 * 1000);
		assert_int_equal(frame.data[0], (uint8_t)(UINT32_MAX - 50 + i));
		assert_int_equal(frame.size, 256);
		assert_int_equal(frame.stride, 32);
		assert_int_equal(v4l2_stream_read(&stream, &frame), 0);
	}
	losses(0, 0);
	end();
}

TEST(what_is_held_is_not_written_to)
{
	struct incise_camera_frame held, next;

	begin();
	driver_shoot(7);
	assert_int_equal(step(), 1);
	assert_int_equal(v4l2_stream_read(&stream, &held), 1);
	/* More frames than there are buffers: what has no room is passed over. */
	for (uint32_t i = 1; i <= 50; i++) {
		driver_shoot(7 + i);
		assert_int_equal(step(), 1);
		assert_int_equal(held.data[0], 7);
		assert_int_equal(held.data[255], 7);
	}
	losses(50 - WAIT_MOST, 0);
	for (uint32_t i = 50 - WAIT_MOST + 1; i <= 50; i++) {
		assert_int_equal(v4l2_stream_read(&stream, &next), 1);
		assert_true(next.seq == i && next.data[0] == 7 + i);
	}
	assert_int_equal(v4l2_stream_read(&stream, &next), 0);
	assert_true(next.data[0] == 57);
	/* All buffers but the one held are with the driver again. */
	assert_int_equal(step(), 0);
	for (uint32_t i = 0; i < driver.given; i++)
		assert_int_equal(driver.queued[i],
				 driver.memory + i * DRIVER_BYTES != next.data);
	end();
}

static void read_three(void)
{
	struct incise_camera_frame frame;

	for (int i = 0; i < 3; i++)
		assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
	assert_int_equal(frame.seq, 2);
}

/* v4l2loopback, which was outrun, goes on with a buffer that came back a moment before. */
TEST(what_comes_back_while_it_waits_is_the_drivers)
{
	begin();
	for (uint32_t i = 0; i < 3; i++) {
		driver_shoot(i);
		assert_int_equal(step(), 1);
	}
	driver.meanwhile = read_three;
	driver_shoot(9)->index = 1;
	assert_int_equal(step(), 1);
	losses(6, 0);
	assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
	assert_true(frame.seq == 9 && frame.data == driver.memory + DRIVER_BYTES);
	/* The one that is held is not. */
	driver_shoot(10)->index = 1;
	assert_int_equal(step(), -EIO);
	end();
}

TEST(four_buffers_suffice)
{
	driver_reset();
	driver.count = 4;
	assert_int_equal(start(INCISE_PIXELS_YUYV, 0), 0);
	for (uint32_t i = 0; i < 40; i++) {
		driver_shoot(i);
		assert_int_equal(step(), 1);
		if (i % 3)
			assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
	}
	end();
}

TEST(as_many_wait_as_there_is_room)
{
	/* Of so many buffers so many frames: all but a quarter, and but 3 at most. */
	static const struct {
		uint32_t buffers, waiting;
	} cases[] = {{4, 1}, {5, 2}, {8, 5}, {12, 9}, {13, 10}, {16, 12}, {32, 24}};

	for (size_t k = 0; k < sizeof(cases) / sizeof(cases[0]); k++) {
		uint32_t n = cases[k].waiting;

		driver_reset();
		driver.count = cases[k].buffers;
		assert_int_equal(start(INCISE_PIXELS_YUYV, 0), 0);
		for (uint32_t i = 0; i < n; i++) {
			driver_shoot(i);
			assert_int_equal(step(), 1);
		}
		losses(0, 0);
		driver_shoot(n);
		assert_int_equal(step(), 1);
		losses(1, 0);
		/* The oldest was. */
		for (uint32_t i = 1; i <= n; i++) {
			assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
			assert_true(frame.seq == i && frame.data[0] == i);
		}
		assert_int_equal(v4l2_stream_read(&stream, &frame), 0);
		end();
	}
}

/* One thread steps and one reads: all there were come in order, or are lost. */
static atomic_bool ended;

static void *read_all(void *argument)
{
	uint64_t *taken = argument, next = 0;
	struct incise_camera_frame frame;
	unsigned int seed = 1;
	bool last = false;

	for (;;) {
		/* About as fast as the other, so that what is taken is often what is passed over. */
		for (int i = rand_r(&seed) % SPINS; i > 0; i--)
			atomic_load(&ended);
		if (v4l2_stream_read(&stream, &frame) == 1) {
			if (frame.seq < next || frame.data[0] != (uint8_t)frame.seq)
				abort();
			next = frame.seq + 1;
			++*taken;
		} else if (last) {
			return NULL;
		} else {
			last = atomic_load(&ended);
		}
	}
}

TEST(two_threads_take_each_once)
{
	/* Of few buffers they meet at the same frame more often. */
	static const uint32_t buffers[] = {4, 32};

	for (int k = 0; k < 2; k++) {
		uint64_t taken = 0;
		pthread_t reader;

		driver_reset();
		driver.count = buffers[k];
		assert_int_equal(start(INCISE_PIXELS_YUYV, 0), 0);
		atomic_store(&ended, false);
		assert_int_equal(pthread_create(&reader, NULL, read_all, &taken), 0);
		for (uint32_t i = 0; i < 20000; i++) {
			driver_shoot(i);
			assert_int_equal(step(), 1);
		}
		atomic_store(&ended, true);
		assert_int_equal(pthread_join(reader, NULL), 0);
		assert_true(taken + atomic_load(&stream.lost) == 20000);
		/* The last one at least: it is there when the reader ends. */
		assert_true(taken > 0);
		end();
	}
}

TEST(all_that_is_lost_is_counted)
{
	begin();
	driver_shoot(0);
	driver_shoot(1);
	driver_shoot(5);			       /* 2, 3, 4 */
	driver_shoot(6)->flags |= V4L2_BUF_FLAG_ERROR; /* damaged */
	driver_shoot(7)->bytesused = 255;	       /* too short */
	driver_shoot(8)->bytesused = DRIVER_BYTES + 1; /* more than there can be */
	driver_shoot(9)->bytesused = 0;
	driver_shoot(12); /* 10, 11 */
	for (int i = 0; i < 8; i++) {
		assert_int_equal(step(), 1);
		v4l2_stream_read(&stream, &frame);
	}
	assert_true(frame.seq == 12);
	losses(3 + 4 + 2, 4);
	end();
}

TEST(damage_that_a_driver_does_not_count)
{
	begin();
	/* Before the first one; its count may be anything. */
	driver_shoot(99999999)->flags |= V4L2_BUF_FLAG_ERROR;
	driver_shoot(40);
	driver_shoot(40)->flags |= V4L2_BUF_FLAG_ERROR;
	driver_shoot(3000000)->flags |= V4L2_BUF_FLAG_ERROR;
	driver_shoot(41);
	for (int i = 0; i < 5; i++) {
		assert_int_equal(step(), 1);
		v4l2_stream_read(&stream, &frame);
	}
	/* 0 damaged, 1, 2 and 3 damaged, 4. */
	assert_true(frame.seq == 4);
	losses(3, 3);
	end();
}

TEST(stamps_that_cannot_be_are_damage)
{
	static const struct {
		int64_t from_now_ns, from_last_ns;
		bool good;
	} cases[] = {
		{0, 0, true},
		{0, 20000000, true},
		{-10000000, 0, true},
		{0, 1000, false},	  /* within a period */
		{40000000, 0, false},	  /* to come, before the end of the frame too */
		{1000000000, 0, false},	  /* to come */
		{-20000000000, 0, false}, /* long ago, and before the last one */
		{0, -1, false},		  /* the same as before */
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct driver_frame *shot;
		int64_t last;

		begin();
		last = driver_shoot(0)->t_ns;
		assert_int_equal(step(), 1);
		assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
		shot = driver_shoot(1);
		shot->t_ns += cases[i].from_now_ns;
		if (cases[i].from_last_ns)
			shot->t_ns = last + cases[i].from_last_ns +
				     (cases[i].from_last_ns < 0);
		assert_int_equal(step(), 1);
		if (v4l2_stream_read(&stream, &frame) != cases[i].good ||
		    frame.seq != cases[i].good)
			fail_msg("case %zu", i);
		losses(!cases[i].good, !cases[i].good);
		end();
	}
}

TEST(the_middle_of_the_exposure_is_reported)
{
	static const struct {
		uint32_t source;
		int64_t shift_ns;
	} cases[] = {
		{V4L2_BUF_FLAG_TSTAMP_SRC_SOE, 4000000},
		{V4L2_BUF_FLAG_TSTAMP_SRC_EOF, -4000000},
	};

	for (size_t i = 0; i < 2; i++) {
		struct driver_frame *shot;

		driver_reset();
		assert_int_equal(start(INCISE_PIXELS_YUYV, 8000000), 0);
		shot = driver_shoot(0);
		shot->t_ns = shot->t_ns / 1000 * 1000;
		shot->flags |= cases[i].source;
		assert_int_equal(step(), 1);
		assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
		assert_true(frame.t_ns == shot->t_ns + cases[i].shift_ns);
		end();
	}
}

TEST(a_jpeg_is_whole_from_first_to_last_marker)
{
	static const struct {
		uint8_t bytes[8];
		uint32_t size;
		bool good;
	} cases[] = {
		{{0xff, 0xd8, 1, 2, 0xff, 0xd9}, 6, true},
		{{0xff, 0xd8, 1, 0xff, 0xd9, 0, 0}, 7, true},  /* padded */
		{{0xff, 0xd8, 1, 2, 3, 0xff, 0xd9}, 6, false}, /* cut */
		{{0, 0xd8, 1, 2, 0xff, 0xd9}, 6, false},
		{{0xff, 0xd8, 0xff}, 3, false},
		{{0xff, 0xd8, 0xd9, 0}, 4, false},
		{{0xff, 0xd8, 1, 0xff, 0xd8, 0xff, 0xd9}, 7, false}, /* two in one */
		{{0xff, 0xd8, 0xff, 0xd0, 0xff, 0xd1, 0xff, 0xd9}, 8, true},
		{{0xff, 0xd8, 0xff, 0xd0, 0xff, 0xd2, 0xff, 0xd9},
		 8,
		 false}, /* restart */
		{{0xff, 0xd8, 0xff, 0xe0, 0, 2, 0xff, 0xd9}, 8, true},
		{{0xff, 0xd8, 0xff, 0xe0, 0, 9, 0xff, 0xd9}, 8, false},
		{{0xff, 0xd8, 0xff, 0xe0, 0xff, 0xd9}, 6, false},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		driver_reset();
		assert_int_equal(start(INCISE_PIXELS_MJPEG, 0), 0);
		memcpy(driver.memory, cases[i].bytes, 8);
		driver_shoot(0)->bytesused = cases[i].size;
		assert_int_equal(step(), 1);
		if (v4l2_stream_read(&stream, &frame) != cases[i].good)
			fail_msg("case %zu", i);
		if (cases[i].good)
			assert_true(frame.size == cases[i].size && !frame.stride);
		losses(!cases[i].good, !cases[i].good);
		end();
	}
}

/* Coded data of zeros are a hole, unless the frame's own table has a block's end as its shortest code. */
TEST(a_hole_in_a_jpeg)
{
	static const struct {
		uint8_t table[2]; /* number, first symbol; 0xff: no table */
		uint8_t scan[4];  /* components, first one, its tables … */
		size_t zeros;
		bool good;
	} cases[] = {
		{{0xff, 0}, {1, 1, 0x00}, 200, true},
		{{0xff, 0}, {1, 1, 0x00}, 300, false},
		{{0xff, 0}, {1, 2, 0x11}, 300, true},
		{{0x10, 1}, {1, 1, 0x00}, 300, false},
		{{0x10, 0}, {1, 1, 0x00}, 300, true},
		{{0x11, 0}, {1, 1, 0x00}, 300, false},
		{{0x11, 1}, {1, 2, 0x11}, 300, false},
		{{0x00, 0}, {1, 1, 0x00}, 300, false},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		uint8_t bytes[1024] = {0xff, 0xd8}, *at = bytes + 2;

		if (cases[i].table[0] != 0xff) {
			uint8_t table[22] = {0xff, 0xc4, 0, 20, cases[i].table[0], 1};

			table[21] = cases[i].table[1];
			memcpy(at, table, sizeof(table));
			at += sizeof(table);
		}
		memcpy(at, "\xff\xda\0\x08", 4);
		memcpy(at + 4, cases[i].scan, 3);
		memcpy(at + 7, "\0\x3f\0", 3);
		at += 10;
		*at++ = 0x55;
		at += cases[i].zeros;
		memcpy(at, "\x55\xff\xd9", 3);
		driver_reset();
		assert_int_equal(start(INCISE_PIXELS_MJPEG, 0), 0);
		memcpy(driver.memory, bytes, sizeof(bytes));
		driver_shoot(0)->bytesused = (uint32_t)(at + 3 - bytes);
		assert_int_equal(step(), 1);
		if (v4l2_stream_read(&stream, &frame) != cases[i].good)
			fail_msg("case %zu", i);
		end();
	}
}

/* Ways in which a stream ends. */
static void lie_index(void)
{
	driver_shoot(1)->index = 500;
}

static void lie_not_queued(void)
{
	/* the first frame's, which nobody took yet */
	driver_shoot(1)->index = 0;
}

static void lie_clock(void)
{
	driver_shoot(1)->flags = V4L2_BUF_FLAG_TIMESTAMP_COPY;
}

static void count_stands(void)
{
	driver_shoot(0);
}

static void count_falls(void)
{
	driver_shoot(UINT32_MAX);
}

static void unplug(void)
{
	driver.dqbuf_error = ENODEV;
	driver.events = POLLERR | POLLHUP;
}

static void unplug_silently(void)
{
	driver.events = POLLERR;
	driver.querycap_error = ENODEV;
}

static void break_down(void)
{
	driver.events = POLLERR;
}

static void fail_always(void)
{
	driver.dqbuf_error = EIO;
}

static void forget_streaming(void)
{
	driver.dqbuf_error = EINVAL;
}

static void refuse_buffers(void)
{
	driver_shoot(1)->flags |= V4L2_BUF_FLAG_ERROR;
	driver.qbuf_error = EINVAL;
}

static void unplug_at_queueing(void)
{
	driver_shoot(1)->flags |= V4L2_BUF_FLAG_ERROR;
	driver.qbuf_error = ENODEV;
}

static void damage_all(void)
{
	for (uint32_t i = 1; i <= 30; i++)
		driver_shoot(i)->flags |= V4L2_BUF_FLAG_ERROR;
}

static void be_ready_and_not(void)
{
	driver.dqbuf_error = EAGAIN;
}

static void fall_silent(void)
{
}

TEST(every_end_has_its_cause)
{
	static const struct {
		void (*make)(void);
		int code;
		const char *says;
	} cases[] = {
		{lie_index, EIO, "number 500"},
		{lie_not_queued, EIO, "number 0"},
		{lie_clock, EIO, "CLOCK_MONOTONIC"},
		{count_stands, EIO, "frame 0"},
		{count_falls, EIO, "4294967295"},
		{unplug, ENODEV, "unplugged"},
		{unplug_silently, ENODEV, "unplugged"},
		{break_down, EIO, NULL},
		{fail_always, EIO, NULL},
		{forget_streaming, EIO, NULL},
		{refuse_buffers, EIO, "buffers"},
		{unplug_at_queueing, ENODEV, "unplugged"},
		{damage_all, EIO, "30"},
		{be_ready_and_not, EIO, "5 s"},
		{fall_silent, EIO, "5 s"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int rc = 0, steps = 0;

		begin();
		driver_shoot(0);
		assert_int_equal(step(), 1);
		cases[i].make();
		/* 5 s in steps of 1 ms at least, and some. */
		while (rc >= 0 && steps++ < 6000)
			rc = step();
		assert_int_equal(rc, -cases[i].code);
		assert_int_equal(err.code, cases[i].code);
		assert_says(err.text, WHERE ": ", cases[i].says);
		/* What came before is whole, and can be had. */
		assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
		assert_int_equal(frame.data[0], 0);
		end();
	}
}

TEST(one_error_ends_nothing)
{
	begin();
	for (int i = 0; i < 20; i++) {
		driver.dqbuf_error = i % 2 ? 0 : EIO;
		driver.interrupted = 3;
		driver_shoot((uint32_t)i);
		assert_int_equal(step(), i % 2);
	}
	driver.dqbuf_error = 0;
	assert_int_equal(v4l2_stream_read(&stream, &frame), 1);
	end();
}

TEST(slow_cameras_may_be_silent_longer)
{
	begin();
	stream.shape.rate_hz = 1;
	for (int i = 0; i < 190; i++)
		assert_int_equal(step(), 0);
	for (int i = 0; i < 20 && !err.code; i++)
		step();
	assert_int_equal(err.code, EIO);
	assert_says(err.text, "20 s");
	end();
}

TEST(why_it_cannot_begin_is_said)
{
	static const struct {
		size_t error; /* field of the driver */
		int value, code;
		const char *says;
	} cases[] = {
		{offsetof(struct driver, buffer_flags), V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN,
		 EPROTO, "CLOCK_MONOTONIC"},
		{offsetof(struct driver, buffer_flags), V4L2_BUF_FLAG_TIMESTAMP_COPY,
		 EPROTO, "CLOCK_MONOTONIC"},
		{offsetof(struct driver, count), 3, EPROTO, "3"},
		{offsetof(struct driver, length), 255, EPROTO, "255"},
		{offsetof(struct driver, reqbufs_error), EBUSY, EBUSY, "program"},
		{offsetof(struct driver, reqbufs_error), ENOMEM, ENOMEM, "memory"},
		{offsetof(struct driver, querybuf_error), EINVAL, EINVAL, "buffer 0"},
		{offsetof(struct driver, map_error), EAGAIN, EAGAIN, "mapped"},
		{offsetof(struct driver, qbuf_error), EINVAL, EIO, "buffers"},
		{offsetof(struct driver, streamon_error), ENOSPC, ENOSPC, "size"},
		{offsetof(struct driver, streamon_error), EIO, EIO, NULL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {

		driver_reset();
		memcpy((char *)&driver + cases[i].error, &cases[i].value, sizeof(int));
		assert_error(start(INCISE_PIXELS_YUYV, 0), cases[i].code, &err,
			     cases[i].says);
		end();
	}
}

/* A number that depends on nothing but how often it was asked for. */
static uint32_t draw(uint32_t below)
{
	static uint64_t state = 7;

	incise_random_step(&state);
	return (uint32_t)(state >> 33) % below;
}

/* --- the clock of a camera that is played --- */

enum trouble { HONEST, OFFSET, DRIFT, STEP, OUTLIERS, TROUBLES };

/* A camera: frames of @period_ns arrive @age_ns later, and a thread that sometimes waits. */
struct camera {
	enum trouble trouble;
	int64_t period_ns, age_ns, jitter_ns, wrong_ns;
	bool known; /* its rate */
	uint32_t stride;
	/* what was done */
	uint64_t lost, outliers;
	int64_t least_ns, most_ns; /* errors of the times that were delivered */
	int64_t last_age_ns;
	int rc, shot;
};

static int64_t ms(double from, double to)
{
	return (int64_t)((from + (to - from) * draw(1000001) * 1e-6) * 1e6);
}

#define CAMERA_FRAMES 600

/* The error of the clock at frame @i. */
static int64_t clock_error(const struct camera *c, int i)
{
	switch (c->trouble) {
	case OFFSET:
		return c->wrong_ns;
	case DRIFT:
		return c->wrong_ns * i / CAMERA_FRAMES;
	case STEP:
		return i < 200 ? 0 : c->wrong_ns;
	case OUTLIERS:
		return i % 25 == 20 ? (i % 50 == 20 ? c->wrong_ns : -c->wrong_ns) : 0;
	default:
		return 0;
	}
}

static void play_camera(struct camera *c)
{
	struct v4l2_shape shape;
	int64_t began_ns, stalled_ns = 0, timestamp = 0;
	uint32_t sequence = draw(UINT32_MAX);

	driver_reset();
	shape = shape_of(INCISE_PIXELS_YUYV);
	shape.rate_hz = c->known ? 1e9 / (double)c->period_ns : 0;
	driver.stands = true;
	err = (struct incise_error){0};
	assert_int_equal(v4l2_stream_start(&stream, DRIVER_FD, &shape, 0, WHERE, &err),
			 0);
	began_ns = driver.now_ns;
	c->least_ns = INT64_MAX;
	c->most_ns = INT64_MIN;
	for (int i = 0; i < CAMERA_FRAMES && c->rc >= 0; i++) {
		int64_t true_ns = began_ns + i * c->period_ns, now_ns;
		int64_t jitter_ns = ms(0, (double)c->jitter_ns / 1e6);
		struct driver_frame *shot;

		sequence += c->stride;
		if (i > 1 && i < CAMERA_FRAMES - 1 && !draw(60) &&
		    clock_error(c, i) == clock_error(c, i - 1)) {
			c->lost++;
			continue;
		}
		/* In 28 periods a driver of 32 buffers loses nothing. */
		if (c->trouble == HONEST && i % 80 == 40)
			stalled_ns = true_ns + ms(0, 28e-6 * (double)c->period_ns);
		now_ns = true_ns + c->age_ns + jitter_ns;
		now_ns = now_ns > stalled_ns ? now_ns : stalled_ns;
		driver.now_ns = now_ns > driver.now_ns ? now_ns : driver.now_ns;
		now_ns = driver.now_ns;
		shot = driver_shoot(sequence);
		shot->flags |= V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
		timestamp = shot->t_ns = true_ns + clock_error(c, i);
		driver.now_ns = now_ns;
		c->outliers += c->trouble == OUTLIERS && clock_error(c, i);
		c->last_age_ns = now_ns - timestamp;
		c->rc = step();
		c->shot = i;
		if (c->rc < 0 || v4l2_stream_read(&stream, &frame) != 1)
			continue;
		c->least_ns = frame.t_ns - true_ns < c->least_ns ? frame.t_ns - true_ns
								 : c->least_ns;
		c->most_ns = frame.t_ns - true_ns > c->most_ns ? frame.t_ns - true_ns
							       : c->most_ns;
	}
}

/* Lateness is no loss, a real loss is one, and a wrong time is found, stated or refused. */
TEST(clocks_of_1000_cameras)
{
	unsigned int refused = 0;

	for (int i = 0; i < 1000; i++) {
		struct camera c = {.trouble = (enum trouble)(i % TROUBLES),
				   .period_ns = ms(5, 60),
				   .known = draw(4),
				   .stride = 1};
		int64_t half_ns = c.period_ns / 2, clock_ns, limit_ns, spread_ns;

		half_ns = half_ns > 5000000 ? half_ns : 5000000;
		c.age_ns = ms(1, 60);
		c.jitter_ns = ms(0, 3);
		c.wrong_ns = ms(-400, 400);
		if (c.known && draw(3) == 0)
			c.stride = 2;
		if (c.trouble == OUTLIERS)
			c.wrong_ns = half_ns + 5000000 + ms(0, 300);
		/* Without a rate none is known before a window has passed. */
		c.known |= c.trouble == OUTLIERS;
		play_camera(&c);
		clock_ns = atomic_load(&stream.clock_ns);
		limit_ns = (c.known ? 3 * c.period_ns : 300000000) + 100000000;
		/* None came of a camera that was refused at once. */
		spread_ns = c.most_ns > c.least_ns ? c.most_ns - c.least_ns : 0;
		if (c.trouble == HONEST || c.trouble == OUTLIERS) {
			if (c.rc != 1)
				fail_msg("camera %d, frame %d: %s", i, c.shot, err.text);
			losses(c.lost + c.outliers, c.outliers);
			assert_true(spread_ns <= 1000 && clock_ns < 5000000);
		} else if (c.rc < 0) {
			/* Only what is wrong is refused. */
			assert_true(c.last_age_ns > limit_ns ||
				    c.last_age_ns < -5000000 ||
				    (c.trouble == STEP && c.wrong_ns < 0));
			assert_non_null(strstr(err.text, "age")
						? err.text
						: strstr(err.text, " old "));
			refused++;
		} else {
			/* The first and the last window hide a part of a drift. */
			if (c.trouble == DRIFT)
				clock_ns += llabs(c.wrong_ns) * 80 / CAMERA_FRAMES;
			assert_true(spread_ns <= clock_ns + half_ns + c.jitter_ns);
			assert_true(c.trouble != OFFSET ||
				    c.last_age_ns - c.jitter_ns <= limit_ns);
			assert_true(c.least_ns >= -limit_ns &&
				    c.most_ns <= c.age_ns + c.jitter_ns + 5000000);
		}
		end();
	}
	assert_in_range(refused, 100, 500);
}

TEST(a_driver_that_lies_at_random_does_no_harm)
{
	unsigned int frames = 0, ends = 0;

	for (int run = 0; run < 300; run++) {
		enum incise_pixels pixels =
			run % 3 ? INCISE_PIXELS_YUYV : INCISE_PIXELS_MJPEG;
		uint64_t taken = 0;
		uint32_t sequence = draw(UINT32_MAX);
		int rc = 0;

		driver_reset();
		assert_int_equal(start(pixels, draw(20000000)), 0);
		for (int i = 0; i < 100 && rc >= 0; i++) {
			struct driver_frame *shot =
				driver_shoot(sequence += 1 + !draw(9));

			if (!draw(10))
				shot->bytesused = draw(5) ? draw(300) : draw(UINT32_MAX);
			if (!draw(10))
				shot->flags |= V4L2_BUF_FLAG_ERROR;
			if (!draw(300))
				shot->index = draw(UINT32_MAX);
			if (!draw(300))
				shot->sequence = draw(UINT32_MAX);
			if (!draw(20))
				shot->t_ns +=
					(int64_t)draw(UINT32_MAX) * 1000 - 2000000000000;
			if (!draw(300))
				shot->flags = draw(UINT32_MAX);
			memset(driver.memory, (int)draw(256), DRIVER_BYTES);
			memcpy(driver.memory, "\xff\xd8\xff\xd9", 4);
			rc = step();
			if (rc < 0 || v4l2_stream_read(&stream, &frame) != 1)
				continue;
			/* All there were are either taken or lost. */
			taken++;
			assert_true(frame.seq + 1 == taken + atomic_load(&stream.lost));
			assert_true((const uint8_t *)frame.data >= driver.memory &&
				    frame.data + frame.size <=
					    driver.memory +
						    DRIVER_BUFFERS * DRIVER_BYTES &&
				    frame.size >= stream.shape.least &&
				    frame.size <= DRIVER_BYTES);
		}
		frames += (unsigned int)taken;
		ends += rc < 0;
		end();
	}
	/* Both happen, or nothing was tried: at these odds most runs are not ended. */
	assert_in_range(frames, 5000, 30000);
	assert_in_range(ends, 30, 270);
}

TEST(more_buffers_than_asked_for_are_not_overrun)
{
	driver_reset();
	driver.count = 33;
	assert_int_equal(start(INCISE_PIXELS_YUYV, 0), 0);
	assert_int_equal(stream.n, 32);
	end();
}
