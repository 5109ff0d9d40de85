// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/record/write/frame_pump.c, with a simulated camera, file and vision: every frame is in
 * the file or in a count, whichever of them is slow, ends or hangs.
 */
#include "../unit.h"
#include <semaphore.h>
#include <stdatomic.h>
#include <incise/backend.h>
#include "../../../lib/record/write/frame_pump.h"

#define SIDE 16
#define MS 1000000LL
#define PATIENCE_NS (60000 * MS) /* ends a test that hangs */

/* A frame every 1/hz s of the clock; all wait until they are read. */
struct fake_camera {
	struct incise_camera camera;
	struct incise_clock *clock;
	int64_t from_ns;  /* 0: since the first read */
	int64_t ahead_ns; /* they come so long before their time */
	double hz;
	_Atomic uint64_t next;
	uint64_t last; /* ends at */
	int end;       /* negative errno of the end; 0: no more frames */
	uint64_t lost;
	uint8_t bytes[SIDE * SIDE];
};

static int camera_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	struct fake_camera *c = (struct fake_camera *)camera;
	int64_t now_ns = incise_clock_now(c->clock), t_ns;

	if (c->next == c->last)
		return c->end;
	if (!c->from_ns)
		c->from_ns = now_ns;
	t_ns = c->from_ns + (int64_t)((double)c->next / c->hz * 1e9);
	if (t_ns - c->ahead_ns > now_ns)
		return 0;
	memset(c->bytes, (int)c->next, sizeof(c->bytes));
	*frame = (struct incise_camera_frame){
		.t_ns = t_ns,
		.seq = c->next++,
		.width = SIDE,
		.height = SIDE,
		.stride = SIDE,
		.pixels = INCISE_PIXELS_GREY,
		.data = c->bytes,
		.size = sizeof(c->bytes),
	};
	return 1;
}

static void camera_info(const struct incise_camera *camera,
			struct incise_camera_info *info)
{
	*info = (struct incise_camera_info){
		.rate_hz = ((const struct fake_camera *)camera)->hz,
		.width = SIDE,
		.height = SIDE,
		.pixels = INCISE_PIXELS_GREY,
	};
}

static uint64_t camera_lost(const struct incise_camera *camera)
{
	return ((const struct fake_camera *)camera)->lost;
}

static int camera_cause(struct incise_camera *camera, char *text, size_t size)
{
	return snprintf(text, size, "it was unplugged");
}

static const struct incise_camera_ops camera_ops = {
	.read = camera_read,
	.info = camera_info,
	.lost = camera_lost,
	.cause = camera_cause,
};

/* A file that stalls, fails or hangs at one frame. */
struct fake_file {
	struct incise_frames_writer writer;
	_Atomic uint64_t puts;
	uint64_t at;
	useconds_t stall;
	/* The stall lasts until it has given so many frames. */
	const struct fake_camera *camera;
	uint64_t given;
	int fail;
	sem_t *hang;
	bool wrong; /* a frame that is not whole, or out of order */
	_Atomic int closed;
};

static int file_put(struct incise_frames_writer *writer,
		    const struct incise_camera_frame *frame,
		    struct incise_frames_stored *stored, struct incise_error *err)
{
	struct fake_file *f = (struct fake_file *)writer;
	uint64_t n = f->puts++;

	for (size_t i = 0; i < frame->size; i++)
		f->wrong |= frame->data[i] != (uint8_t)frame->seq;
	if (f->at == n && f->stall)
		usleep(f->stall);
	if (f->at == n && f->camera)
		while (f->camera->next < f->given)
			usleep(1000);
	if (f->at == n && f->hang)
		while (sem_wait(f->hang))
			;
	if (f->at == n && f->fail)
		return incise_error_set(err, f->fail, "the file:");
	*stored = (struct incise_frames_stored){(int64_t)frame->seq * 10, 100, 5, {0}};
	return 0;
}

static int file_close(struct incise_frames_writer *writer, struct incise_error *err)
{
	((struct fake_file *)writer)->closed++;
	return 0;
}

static const struct incise_frames_writer_ops file_ops = {file_put, file_close};

/* A vision that is slow, and finds no handle in every third frame. */
struct fake_vision {
	struct incise_vision vision;
	useconds_t takes;
	/* The first look takes until it has so many frames. */
	const struct fake_file *file;
	uint64_t puts;
};

static int vision_measure(struct incise_vision *vision,
			  const struct incise_camera_frame *frame,
			  struct incise_vision_result *result)
{
	struct fake_vision *v = (struct fake_vision *)vision;

	if (v->takes)
		usleep(v->takes);
	/* A file that waits for vision makes it give up after a minute. */
	for (int ms = 0; v->file && v->file->puts < v->puts && ms < 60000; ms++)
		usleep(1000);
	if (frame->data[5] % 3 == 2)
		return -EBADMSG;
	*result = (struct incise_vision_result){
		.found = true,
		.length_px = 100.0 + frame->data[5],
		.sd_px = 0.25,
		.depth_mm = 3,
		.quality = 0.5,
	};
	return 0;
}

static const struct incise_vision_ops vision_ops = {.measure = vision_measure};

static struct incise_clock *clock;
static struct fake_camera camera;
static struct fake_file file;
static struct fake_vision vision;
static struct incise_frame_pump *pump;
/* Memory that a hanging thread may use is never freed. */
static struct incise_frame_pump *left;
static struct incise_frame_pump_stats stats;
static struct incise_frame_record record[200];

static int on(struct incise_clock *new)
{
	clock = new;
	camera = (struct fake_camera){
		.camera = {&camera_ops}, .clock = clock, .lost = 7 /* before */};
	file = (struct fake_file){.writer = {&file_ops}, .at = UINT64_MAX};
	vision = (struct fake_vision){.vision = {&vision_ops}};
	pump = NULL;
	return 0;
}

static int on_real_clock(void **state)
{
	return on(incise_clock_new_real());
}

static int on_simulated_clock(void **state)
{
	return on(incise_clock_new_simulated(1000 * MS));
}

static int end(void **state)
{
	if (pump != left)
		incise_frame_pump_free(pump);
	incise_clock_free(clock);
	return 0;
}

/* Of a camera of @hz that gives @last frames. */
static void begin(double hz, uint64_t last, bool looks)
{
	camera.hz = hz;
	camera.last = last;
	pump = incise_frame_pump_new(
		&(struct incise_frame_pump_setup){
			.camera = &camera.camera,
			.clock = clock,
			.vision = looks ? &vision.vision : NULL,
			.writer = &file.writer,
		},
		&err);
	succeeds(pump);
}

/* Until the camera has given its last and all of it went through. */
static void await_last(void)
{
	do {
		usleep(1000);
		incise_frame_pump_stats(pump, &stats);
	} while (stats.written + stats.dropped + stats.unwritten < camera.last);
}

/* On a clock that stands still all is written and looked at, however slow vision is. */
TEST(nothing_is_lost_where_time_waits, on_simulated_clock, end)
{
	uint64_t seq = 0;
	int n;

	file.at = 3;
	file.stall = 50000;
	vision.takes = 500;
	begin(100, 200, true);
	for (int i = 0; i < 200; i++) {
		incise_clock_wait_until(clock, 1000 * MS + i * 10 * MS);
		assert_int_equal(incise_frame_pump_step(pump), 1);
		assert_int_equal(incise_frame_pump_step(pump), 0);
		if (i == 199)
			assert_int_equal(incise_frame_pump_stop(pump, PATIENCE_NS, NULL),
					 0);
		while ((n = incise_frame_pump_take(pump, record, 7)) > 0)
			for (int k = 0; k < n; k++, seq++) {
				const struct incise_frame_record *r = &record[k];

				assert_int_equal(r->seq, seq);
				assert_int_equal(r->t_ns, 1000 * MS + seq * 10 * MS);
				assert_int_equal(r->arrival_ns, r->t_ns);
				assert_int_equal(r->pts_ms, seq * 10);
				assert_int_equal(r->bytes, 100);
				assert_int_equal(r->crc, 5);
				if (seq % 256 % 3 == 2) {
					assert_true(isnan(r->length_px) &&
						    isnan(r->sd_px) &&
						    isnan(r->depth_mm));
					assert_true(r->quality == 0);
				} else {
					assert_true(r->length_px == 100.0 + (double)seq);
					assert_true(r->sd_px == 0.25);
					assert_true(r->depth_mm == 3);
					assert_true(r->quality == 0.5);
				}
			}
	}
	assert_int_equal(seq, 200);
	incise_frame_pump_stats(pump, &stats);
	assert_int_equal(stats.read, 200);
	assert_int_equal(stats.written, 200);
	assert_int_equal(stats.bytes, 20000);
	assert_int_equal(stats.lost + stats.dropped + stats.unwritten + stats.unlooked +
				 stats.unrecorded,
			 0);
	assert_false(file.wrong);
	assert_int_equal(file.closed, 1);
	assert_int_equal(incise_frame_pump_step(pump), 0);
}

/* Frames that waited in the camera before the pump started are not recorded, and not lost. */
TEST(what_was_shot_before_is_passed_over, on_simulated_clock, end)
{
	/* Frames 0 … 20 are before. */
	camera.from_ns = 1000 * MS;
	incise_clock_wait_until(clock, 1205 * MS);
	begin(100, 30, false);
	incise_clock_wait_until(clock, 1290 * MS);
	/* It loses while those before are read. */
	for (int i = 0; i < 30; i++) {
		camera.lost += i < 10;
		assert_int_equal(incise_frame_pump_step(pump), 1);
	}
	camera.lost++;
	assert_int_equal(incise_frame_pump_step(pump), 0);
	assert_int_equal(incise_frame_pump_stop(pump, PATIENCE_NS, NULL), 0);
	assert_int_equal(incise_frame_pump_take(pump, record, 30), 9);
	for (int i = 0; i < 9; i++) {
		assert_int_equal(record[i].seq, 21 + i);
		assert_int_equal(record[i].t_ns, (1210 + 10 * i) * MS);
	}
	incise_frame_pump_stats(pump, &stats);
	assert_int_equal(stats.read, 9);
	assert_int_equal(stats.written, 9);
	assert_int_equal(stats.lost + stats.dropped + stats.unwritten, 0);
}

/* A disk that does not answer for 95 frames, of the 150 that the slots bridge. */
TEST(a_stall_is_bridged, on_real_clock, end)
{
	file.at = 5;
	file.camera = &camera;
	file.given = 100;
	begin(60, 120, false);
	await_last();
	assert_int_equal(stats.written, 120);
	assert_int_equal(stats.capacity, 150);
	/* Frames 6 … 98 at least; one more may be on its way. */
	assert_true(stats.waiting_most >= 93);
	assert_int_equal(incise_frame_pump_stop(pump, PATIENCE_NS, NULL), 0);
	for (uint64_t seq = 0; seq < 120; seq++) {
		assert_int_equal(incise_frame_pump_take(pump, record, 1), 1);
		assert_int_equal(record->seq, seq);
		assert_true(record->arrival_ns >= record->t_ns);
		assert_true(isnan(record->length_px) && isnan(record->quality));
	}
	assert_int_equal(incise_frame_pump_take(pump, record, 1), 0);
	assert_false(file.wrong);
}

/* A disk that hangs: frames without a slot are counted, and the end does not wait for it. */
TEST(a_disk_that_hangs_holds_nobody, on_real_clock, end)
{
	static sem_t hang;

	camera.ahead_ns = 3000 * MS; /* all at once */
	sem_init(&hang, 0, 0);
	file.at = 5;
	file.hang = &hang;
	begin(1000, 3000, false);
	do {
		usleep(1000);
		incise_frame_pump_stats(pump, &stats);
	} while (stats.read < 3000 || stats.written < 5);
	assert_error(incise_frame_pump_stop(pump, 20 * MS, &err), ETIMEDOUT, &err, "2");
	incise_frame_pump_stats(pump, &stats);
	/* 5 are in the file, one is in the hand of who hangs and in its slot still. */
	assert_int_equal(stats.written, 5);
	/* Each is counted once. The hang may start before or after the slots are full. */
	assert_in_range(stats.waiting, 2495, 2500);
	assert_int_equal(stats.written + stats.waiting + stats.dropped, 3000);
	assert_int_equal(incise_frame_pump_take(pump, record, 10), 5);
	incise_frame_pump_free(pump);
	left = pump;
	/* It comes back, to nothing that was taken from under it. */
	sem_post(&hang);
	while (!file.closed)
		usleep(1000);
	assert_int_equal(file.puts, 6);
}

TEST(a_full_disk_ends_the_file_alone, on_real_clock, end)
{
	file.at = 20;
	file.fail = ENOSPC;
	begin(1000, 50, false);
	await_last();
	assert_int_equal(stats.read, 50);
	assert_int_equal(stats.written, 20);
	assert_int_equal(stats.unwritten, 30);
	assert_int_equal(stats.file.code, ENOSPC);
	assert_string_equal(stats.file.text, "the file:");
	assert_int_equal(stats.camera.code, 0);
	assert_error(incise_frame_pump_stop(pump, PATIENCE_NS, &err), ENOSPC, &err,
		     "the file:");
	assert_int_equal(file.closed, 1);
}

/* A frame of a wrong shape does not affect the others. */
TEST(a_wrong_frame_is_passed_over, on_real_clock, end)
{
	file.at = 20;
	file.fail = EINVAL;
	begin(1000, 50, true);
	await_last();
	assert_int_equal(stats.written, 49);
	assert_int_equal(stats.unwritten, 1);
	assert_int_equal(stats.file.code, 0);
	assert_int_equal(incise_frame_pump_stop(pump, PATIENCE_NS, NULL), 0);
	assert_int_equal(incise_frame_pump_take(pump, record, 50), 49);
	/* Vision's results stay with their frames behind the gap. */
	for (int i = 0; i < 49; i++) {
		uint64_t seq = (uint64_t)i + (i >= 20);

		assert_int_equal(record[i].seq, seq);
		assert_true(isnan(record[i].length_px) ||
			    record[i].length_px == 100.0 + (double)seq);
	}
}

TEST(a_camera_that_ends_says_why, on_real_clock, end)
{
	camera.end = -ENODEV;
	begin(1000, 50, false);
	do {
		await_last();
	} while (!stats.camera.code);
	assert_int_equal(stats.camera.code, ENODEV);
	assert_string_equal(stats.camera.text, "it was unplugged");
	assert_int_equal(stats.written, 50);
	assert_int_equal(incise_frame_pump_stop(pump, PATIENCE_NS, NULL), 0);
}

/* Vision that is slower than the camera: frames without a depth, but all of them. */
TEST(slow_vision_holds_nobody, on_real_clock, end)
{
	uint64_t looked = 0;

	vision.file = &file;
	vision.puts = 200;
	camera.ahead_ns = 200 * MS; /* all at once */
	begin(1000, 200, true);
	await_last();
	assert_int_equal(stats.written, 200);
	assert_true(stats.unlooked > 0);
	assert_int_equal(incise_frame_pump_stop(pump, PATIENCE_NS, NULL), 0);
	incise_frame_pump_stats(pump, &stats);
	assert_int_equal(incise_frame_pump_take(pump, record, 200), 200);
	for (int i = 0; i < 200; i++) {
		assert_int_equal(record[i].seq, i);
		looked += !isnan(record[i].quality);
		if (!isnan(record[i].length_px))
			assert_true(record[i].length_px == 100.0 + i);
	}
	assert_int_equal(looked, 200 - stats.unlooked);
}
