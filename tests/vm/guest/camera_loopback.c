// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/v4l2 held against what was really shot: this program feeds v4l2loopback and
 * takes the frames back through the camera. Prints "ok …" and "not ok …".
 *
 *   feed ─▶ /dev/video8 ─▶ v4l2_camera ─▶ the same bytes, timestamp and number
 *
 * v4l2loopback writes to a buffer whether somebody holds it or not, so at most seven frames
 * are shot between two that are read.
 */
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>
#include <linux/videodev2.h>
#include "../../clock.h"
#include "../../../lib/rig/backends.h"
#include "../../../lib/rig/thread.h"
#include "../../../lib/sim/sim.h"
#include "../tap.h"

extern const struct incise_backend incise_camera_v4l2;

#define WIDTH 320
#define HEIGHT 240
#define SIZE (WIDTH * HEIGHT * 2)
#define BUFFERS 8
#define PATIENCE_NS 5000000000LL

static const char *path;

struct feeder {
	int fd;
	uint32_t fourcc, width, height;
	size_t size;
	uint8_t *buffer[BUFFERS];
	size_t length;
	int n;	      /* frames shot */
	int64_t t_ns; /* timestamp of the last one */
};

/* Every byte of every frame is another one. */
static uint8_t pixel(int picture, size_t at)
{
	uint32_t mixed = (uint32_t)picture * 2654435761u + (uint32_t)at * 40503u;

	return (uint8_t)(mixed >> 24 ^ mixed >> 11);
}

static bool feeder_open(struct feeder *f)
{
	struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
	struct v4l2_requestbuffers asked = {.count = BUFFERS,
					    .type = V4L2_BUF_TYPE_VIDEO_OUTPUT,
					    .memory = V4L2_MEMORY_MMAP};
	int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;

	f->n = 0;
	f->fd = open(path, O_RDWR);
	format.fmt.pix.width = f->width;
	format.fmt.pix.height = f->height;
	format.fmt.pix.pixelformat = f->fourcc;
	format.fmt.pix.field = V4L2_FIELD_NONE;
	if (f->fd < 0 || ioctl(f->fd, VIDIOC_S_FMT, &format) ||
	    ioctl(f->fd, VIDIOC_REQBUFS, &asked) || asked.count != BUFFERS)
		return false;
	for (uint32_t i = 0; i < BUFFERS; i++) {
		struct v4l2_buffer buffer = {.index = i,
					     .type = V4L2_BUF_TYPE_VIDEO_OUTPUT,
					     .memory = V4L2_MEMORY_MMAP};

		if (ioctl(f->fd, VIDIOC_QUERYBUF, &buffer) || buffer.length < f->size)
			return false;
		f->length = buffer.length;
		f->buffer[i] = mmap(NULL, buffer.length, PROT_READ | PROT_WRITE,
				    MAP_SHARED, f->fd, buffer.m.offset);
		if (f->buffer[i] == MAP_FAILED)
			return false;
	}
	return !ioctl(f->fd, VIDIOC_STREAMON, &type);
}

/* @frame: NULL: one of pixel(). @stamp_ns: 0: the kernel's. */
static bool feeder_shoot(struct feeder *f, const uint8_t *picture, int64_t stamp_ns)
{
	struct v4l2_buffer buffer = {.index = (uint32_t)(f->n % BUFFERS),
				     .type = V4L2_BUF_TYPE_VIDEO_OUTPUT,
				     .memory = V4L2_MEMORY_MMAP,
				     .field = V4L2_FIELD_NONE};

	if (f->n >= BUFFERS && ioctl(f->fd, VIDIOC_DQBUF, &buffer))
		return false;
	for (size_t i = 0; i < f->size; i++)
		f->buffer[buffer.index][i] = picture ? picture[i] : pixel(f->n, i);
	buffer.bytesused = (uint32_t)f->size;
	buffer.timestamp.tv_sec = stamp_ns / 1000000000;
	buffer.timestamp.tv_usec = stamp_ns % 1000000000 / 1000;
	if (ioctl(f->fd, VIDIOC_QBUF, &buffer))
		return false;
	f->t_ns = buffer.timestamp.tv_sec * 1000000000LL +
		  buffer.timestamp.tv_usec * 1000LL;
	f->n++;
	return true;
}

static void feeder_close(struct feeder *f)
{
	int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;

	ioctl(f->fd, VIDIOC_STREAMOFF, &type);
	for (int i = 0; i < BUFFERS; i++)
		munmap(f->buffer[i], f->length);
	close(f->fd);
}

static struct incise_camera *open_camera(enum incise_pixels pixels)
{
	const struct incise_camera_setup setup = {.pixels = pixels};
	const struct incise_backend_request request = {
		.arguments = path, .where = "rig.conf:1: camera", .camera = &setup};
	struct incise_error err = {0};
	struct incise_camera *camera = incise_camera_v4l2.open(&request, &err);

	if (!camera)
		note("%s", err.text);
	return camera;
}

/* Read until frame @seq is there. */
static int await(struct incise_camera *camera, struct incise_camera_frame *frame,
		 uint64_t seq)
{
	const struct timespec nap = {.tv_nsec = 200000};
	int64_t end = now_ns() + PATIENCE_NS;
	int rc = 0;

	while (rc >= 0 && now_ns() < end) {
		rc = incise_camera_read(camera, frame);
		if (rc == 1 && frame->seq >= seq)
			return 1;
		nanosleep(&nap, NULL);
	}
	return rc;
}

static bool same(const struct incise_camera_frame *frame, int picture)
{
	if (frame->size != SIZE || frame->width != WIDTH || frame->stride != WIDTH * 2)
		return false;
	for (size_t i = 0; i < SIZE; i++)
		if (frame->data[i] != pixel(picture, i))
			return false;
	return true;
}

static void a_hundred(struct feeder *f, struct incise_camera *camera)
{
	struct incise_camera_frame frame = {0};
	int bytes = 0, timestamps = 0, numbers = 0;

	for (int i = 0; i < 100; i++) {
		if (!feeder_shoot(f, NULL, 0) || await(camera, &frame, (uint64_t)i) != 1)
			break;
		bytes += same(&frame, i);
		timestamps += frame.t_ns == f->t_ns;
		numbers += frame.seq == (uint64_t)i;
	}
	check(numbers == 100, "%d of 100 pictures, in order", numbers);
	check(bytes == 100, "%d of 100 are the same byte by byte", bytes);
	check(timestamps == 100, "%d of 100 have the stamp of the shot", timestamps);
	check(incise_camera_lost(camera) == 0, "none is lost");
}

/* Count the frames up to @last; each is as it was shot, and they are in order. */
static int take_all(struct incise_camera *camera, int first, int last)
{
	struct incise_camera_frame frame = {0};
	int taken = 0;

	while (await(camera, &frame, (uint64_t)first) == 1) {
		if (!same(&frame, (int)frame.seq))
			return -1;
		taken++;
		first = (int)frame.seq + 1;
		if ((int)frame.seq == last)
			return taken;
	}
	return -1;
}

/* Frames that nobody reads wait, as long as there is room. */
static void not_read(struct feeder *f, struct incise_camera *camera)
{
	uint64_t before = incise_camera_lost(camera);
	int exact = 0;

	for (int i = 0; i < 20; i++) {
		const struct timespec nap = {.tv_nsec = 20000000};
		int first = f->n;
		bool shot = true;

		for (int k = 0; k < 5; k++)
			shot = shot && feeder_shoot(f, NULL, 0);
		nanosleep(&nap, NULL);
		exact += shot && take_all(camera, first, f->n - 1) == 5;
	}
	check(exact == 20, "%d of 20 times all of five that waited are read", exact);
	check(incise_camera_lost(camera) == before, "and none is lost");
}

/* Shot faster than the thread may run: v4l2loopback goes on with the newest one. */
static void dropped(struct feeder *f, struct incise_camera *camera)
{
	struct sched_param fast = {.sched_priority = INCISE_THREAD_PRIORITY + 1};
	struct sched_param usual = {0};
	uint64_t before = incise_camera_lost(camera);
	int first = f->n, taken;
	bool shot = true;

	if (!check(!sched_setscheduler(0, SCHED_FIFO, &fast), "it can be outrun"))
		return;
	for (int i = 0; i < BUFFERS + 5; i++)
		shot = shot && feeder_shoot(f, NULL, 0);
	sched_setscheduler(0, SCHED_OTHER, &usual);
	taken = shot ? take_all(camera, first, f->n - 1) : -1;
	check(taken > 0 && taken < BUFFERS + 5, "outrun, the newest comes, %d in all",
	      taken);
	check(incise_camera_lost(camera) - before == (uint64_t)(BUFFERS + 5 - taken),
	      "%llu of %d dropped by the driver are lost",
	      (unsigned long long)(incise_camera_lost(camera) - before),
	      BUFFERS + 5 - taken);
}

static void another_clock(struct feeder *f, struct incise_camera *camera)
{
	struct incise_camera_frame frame = {0};
	char text[500];

	check(feeder_shoot(f, NULL, now_ns()) &&
		      await(camera, &frame, (uint64_t)f->n) == -EIO,
	      "a picture with a stamp of the feeder's own ends it");
	incise_camera_cause(camera, text, sizeof(text));
	check(strstr(text, "CLOCK_MONOTONIC"), "the cause: %s", text);
}

/* Frames of the simulated rig's camera, through the kernel and back. */
static void virtual_rig(void)
{
	struct feeder f = {.width = 640,
			   .height = 480,
			   .fourcc = V4L2_PIX_FMT_RGB24,
			   .size = 640 * 480 * 3};
	struct incise_clock *clock = incise_clock_new_simulated(0);
	struct incise_camera_frame shot, frame = {0};
	struct incise_camera *source, *camera = NULL;
	struct incise_sim_config config;
	struct incise_sim *sim;
	int exact = 0;

	incise_sim_config_init(&config);
	sim = incise_sim_new(&config, clock, NULL);
	source = incise_sim_camera_new(sim);
	if (check(feeder_open(&f), "the feeder begins in RGB"))
		camera = open_camera(INCISE_PIXELS_RGB);
	/* Two seconds, in which the first cut starts; 100 frames. */
	for (int64_t t = 0; camera && t < 2000; t += 20) {
		incise_clock_wait_until(clock, t * 1000000);
		if (incise_camera_read(source, &shot) != 1 ||
		    !feeder_shoot(&f, shot.data, 0) ||
		    await(camera, &frame, shot.seq) != 1)
			break;
		exact += frame.seq == shot.seq && frame.t_ns == f.t_ns &&
			 frame.size == shot.size && frame.stride == shot.stride &&
			 !memcmp(frame.data, shot.data, shot.size);
	}
	check(exact == 100, "%d of 100 pictures of the virtual rig come exactly", exact);
	if (camera)
		camera->ops->close(camera);
	feeder_close(&f);
	source->ops->close(source);
	incise_sim_free(sim);
	incise_clock_free(clock);
}

int main(int argc, char **argv)
{
	struct incise_camera *camera;
	struct feeder f = {.width = WIDTH,
			   .height = HEIGHT,
			   .fourcc = V4L2_PIX_FMT_YUYV,
			   .size = SIZE};
	cpu_set_t first;

	if (argc != 3)
		return 2;
	path = argv[1];
	/* Virtual time goes on while a page is read from the host. */
	mlockall(MCL_CURRENT | MCL_FUTURE);
	/* On one processor this program can outrun the camera's thread. */
	CPU_ZERO(&first);
	CPU_SET(0, &first);
	sched_setaffinity(0, sizeof(first), &first);
	if (!check(feeder_open(&f), "the feeder begins"))
		return 1;
	camera = open_camera(INCISE_PIXELS_YUYV);
	if (check(camera, "the camera opens")) {
		a_hundred(&f, camera);
		not_read(&f, camera);
		dropped(&f, camera);
		another_clock(&f, camera);
		camera->ops->close(camera);
	}
	feeder_close(&f);
	/* On a device that has had no frame yet. */
	path = argv[2];
	virtual_rig();
	return tap_failures ? 1 : 0;
}
