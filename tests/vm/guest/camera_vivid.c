// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/v4l2 on a driver of a real kernel: vivid, a webcam that draws its frames, and
 * can be set to damage them, to lose them, to timestamp and count them wrongly and to fail. Its
 * timestamps are those of jiffies. Prints "ok …" and "not ok …".
 *
 *   camera_vivid /dev/video0
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>
#include <incise/scan.h>
#include <linux/videodev2.h>
#include "../../clock.h"
#include "../../../lib/rig/backends.h"
#include "../tap.h"

extern const struct incise_backend incise_camera_v4l2;

#define PATIENCE_NS 10000000000LL
#define JIFFY_NS 4000000

static const char *path;
static bool on_time; /* in virtual time */
static struct incise_error err;

static struct incise_camera *open_camera(const struct incise_camera_setup *setup)
{
	const struct incise_backend_request request = {
		.arguments = path, .where = "rig.conf:1: camera", .camera = setup};
	struct incise_camera *camera;

	err = (struct incise_error){0};
	camera = incise_camera_v4l2.open(&request, &err);
	if (!camera)
		note("%s", err.text);
	return camera;
}

static int await(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	const struct timespec nap = {.tv_nsec = 1000000};
	int64_t end = now_ns() + PATIENCE_NS;
	int rc = 0;

	while (!(rc = incise_camera_read(camera, frame)) && now_ns() < end)
		nanosleep(&nap, NULL);
	return rc;
}

/* The camera's own file, through which it may be set although it is locked. */
static int own_file(void)
{
	DIR *files = opendir("/proc/self/fd");
	struct dirent *entry;
	int fd = -1;

	while (files && (entry = readdir(files)) != NULL) {
		char link[300], target[300];
		ssize_t length;

		snprintf(link, sizeof(link), "/proc/self/fd/%s", entry->d_name);
		length = readlink(link, target, sizeof(target) - 1);
		if (length < 0)
			continue;
		target[length] = '\0';
		if (!strcmp(target, path))
			fd = atoi(entry->d_name);
	}
	if (files)
		closedir(files);
	return fd;
}

static int set_id(int fd, uint32_t id, int value)
{
	struct v4l2_control control = {.id = id, .value = value};

	return ioctl(fd, VIDIOC_S_CTRL, &control) ? -errno : 0;
}

static int get_id(int fd, uint32_t id)
{
	struct v4l2_control control = {.id = id};

	return ioctl(fd, VIDIOC_G_CTRL, &control) ? -errno : control.value;
}

/* One of vivid's own controls has no number in a header; 0, or a negative errno. */
static int set_named(int fd, const char *name, int value)
{
	struct v4l2_queryctrl reported = {.id = V4L2_CTRL_FLAG_NEXT_CTRL};

	while (!ioctl(fd, VIDIOC_QUERYCTRL, &reported)) {
		if (!strcmp((const char *)reported.name, name))
			return set_id(fd, reported.id, value);
		reported.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
	}
	return -ENOENT;
}

/* Take frames; 0, or what is wrong with them. */
static const char *take(struct incise_camera *camera, int n, double period_ns,
			uint64_t *taken, uint64_t *last_seq)
{
	struct incise_camera_frame frame;
	int64_t last_ns = 0;
	uint64_t seq = 0;

	for (int i = 0; i < n; i++) {
		int rc = await(camera, &frame);
		double off;

		if (rc != 1)
			return rc ? "an error" : "no picture";
		/* vivid timestamps the end of a frame, which it hands out before. */
		if ((double)frame.t_ns > (double)now_ns() + period_ns ||
		    frame.t_ns <= last_ns)
			return "a stamp of the future, or of the past";
		if (i && frame.seq <= seq)
			return "a count that does not rise";
		/* The kernel's timer draws them by jiffies. */
		off = (double)(frame.t_ns - last_ns) -
		      period_ns * (double)(frame.seq - seq);
		if (i && on_time && fabs(off) > 2 * JIFFY_NS) {
			note("%.1f ms off", off / 1e6);
			return "a stamp that does not fit its number";
		}
		last_ns = frame.t_ns;
		seq = frame.seq;
		++*taken;
	}
	*last_seq = seq;
	return NULL;
}

/* Read until it ends. */
static int drain(struct incise_camera *camera)
{
	struct incise_camera_frame frame;
	int rc;

	while ((rc = await(camera, &frame)) == 1)
		;
	return rc;
}

static void formats(void)
{
	static const struct {
		enum incise_pixels pixels;
		const char *name;
		int bytes;
	} cases[] = {{INCISE_PIXELS_YUYV, "YUYV", 2},
		     {INCISE_PIXELS_GREY, "GREY", 1},
		     {INCISE_PIXELS_RGB, "RGB24", 3}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_camera_setup setup = {.width = 320,
						    .height = 180,
						    .rate_hz = 30,
						    .pixels = cases[i].pixels};
		struct incise_camera *camera = open_camera(&setup);
		struct incise_camera_frame frame = {0};
		struct incise_camera_info info;
		uint64_t taken = 0, seq = 0;
		const char *wrong;

		if (!check(camera, "%s: it opens", cases[i].name))
			continue;
		incise_camera_info(camera, &info);
		check(info.width == 320 && info.height == 180 &&
			      info.pixels == cases[i].pixels &&
			      fabs(info.rate_hz - 30) < 0.1,
		      "%s: %d x %d at %.2f Hz is told", cases[i].name, info.width,
		      info.height, info.rate_hz);
		wrong = take(camera, 20, 1e9 / info.rate_hz, &taken, &seq);
		check(!wrong, "%s: 20 pictures in order, stamped %s", cases[i].name,
		      wrong ? wrong : "as they are counted");
		check(seq + 1 == taken + incise_camera_lost(camera),
		      "%s: %llu taken and %llu lost are %llu", cases[i].name,
		      (unsigned long long)taken,
		      (unsigned long long)incise_camera_lost(camera),
		      (unsigned long long)seq + 1);
		check(await(camera, &frame) == 1 &&
			      frame.size == (size_t)320 * 180 * cases[i].bytes &&
			      frame.stride == 320 * cases[i].bytes,
		      "%s: rows of %d bytes", cases[i].name, frame.stride);
		camera->ops->close(camera);
	}
}

static void choice(void)
{
	struct incise_camera_setup setup = {
		.width = 630, .height = 350, .rate_hz = 14, .pixels = INCISE_PIXELS_YUYV};
	struct incise_camera *camera = open_camera(&setup);
	struct incise_camera_info info;

	if (check(camera, "a size that is not on offer opens")) {
		incise_camera_info(camera, &info);
		check(info.width == 640 && info.height == 360 &&
			      fabs(info.rate_hz - 15) < 0.1,
		      "630 x 350 at 14 Hz becomes %d x %d at %g", info.width, info.height,
		      info.rate_hz);
		camera->ops->close(camera);
	}
	setup.pixels = INCISE_PIXELS_MJPEG;
	camera = open_camera(&setup);
	check(!camera && err.code == EOPNOTSUPP && strstr(err.text, "YUYV"),
	      "MJPEG, which it has not, is refused");
}

static void controls(void)
{
	struct incise_camera_setup setup = {.width = 320,
					    .height = 180,
					    .rate_hz = 60,
					    .pixels = INCISE_PIXELS_YUYV,
					    .gain = 40};
	struct incise_camera *camera;
	int other = open(path, O_RDWR);
	char text[500];
	int rc;

	set_id(other, V4L2_CID_AUTOGAIN, 1);
	camera = open_camera(&setup);
	if (!check(camera, "a gain of 40 is set"))
		return;
	check(get_id(other, V4L2_CID_AUTOGAIN) == 0 && get_id(other, V4L2_CID_GAIN) == 40,
	      "automatic gain is off, gain is 40");
	rc = set_id(other, V4L2_CID_GAIN, 41);
	check(rc == -EBUSY, "another program cannot set it: %s", strerror(-rc));
	check(!set_id(own_file(), V4L2_CID_GAIN, 41), "the gain drifts");
	check(drain(camera) == -EIO, "the drift ends it");
	incise_camera_cause(camera, text, sizeof(text));
	check(strstr(text, "gain has changed from 40 to 41"), "the cause: %s", text);
	camera->ops->close(camera);
	setup.gain = 0;
	setup.exposure_ms = 5;
	camera = open_camera(&setup);
	check(!camera && err.code == EOPNOTSUPP,
	      "an exposure, which it has not, is refused");
	close(other);
}

/* Damage that vivid does to frames on demand: all of it is counted. */
static void losses(void)
{
	static const struct incise_camera_setup setup = {
		.width = 320, .height = 180, .rate_hz = 30, .pixels = INCISE_PIXELS_YUYV};
	struct incise_camera *camera = open_camera(&setup);
	struct incise_camera_info info;
	uint64_t taken = 0, seq = 0;
	const char *wrong;
	int fd, rc;

	if (!check(camera, "it opens again"))
		return;
	incise_camera_info(camera, &info);
	fd = own_file();
	wrong = take(camera, 3, 1e9 / info.rate_hz, &taken, &seq);
	rc = set_named(fd, "Inject V4L2_BUF_FLAG_ERROR", 1);
	if (!wrong)
		wrong = take(camera, 5, 1e9 / info.rate_hz, &taken, &seq);
	incise_camera_info(camera, &info);
	check(!rc && !wrong && info.damaged == 1, "one damaged picture is counted");
	check(seq + 1 == taken + incise_camera_lost(camera), "and is among the lost");
	rc = set_named(fd, "Percentage of Dropped Buffers", 50);
	wrong = take(camera, 40, 1e9 / info.rate_hz, &taken, &seq);
	check(!rc && !wrong && incise_camera_lost(camera) > 10,
	      "every other picture dropped: %llu lost",
	      (unsigned long long)incise_camera_lost(camera));
	check(seq + 1 == taken + incise_camera_lost(camera),
	      "taken and lost are all there were");
	set_named(fd, "Percentage of Dropped Buffers", 0);
	rc = set_named(fd, "Inject Fatal Streaming Error", 1);
	check(!rc && drain(camera) == -EIO, "a fatal error ends it");
	camera->ops->close(camera);
}

static void wraps(void)
{
	static const struct incise_camera_setup setup = {
		.width = 320, .height = 180, .rate_hz = 60, .pixels = INCISE_PIXELS_GREY};
	int other = open(path, O_RDWR);
	struct incise_camera *camera;
	uint64_t taken = 0, seq = 0;
	const char *wrong = "not open";

	/* It starts 128 before the count runs over. */
	if (!set_named(other, "Wrap Sequence Number", 1)) {
		camera = open_camera(&setup);
		if (camera) {
			wrong = take(camera, 150, 1e9 / 60, &taken, &seq);
			check(!wrong && seq + 1 == taken + incise_camera_lost(camera),
			      "a count that runs over: %s", wrong ? wrong : "goes on");
			camera->ops->close(camera);
		}
		set_named(other, "Wrap Sequence Number", 0);
	}
	close(other);
}

static int found(void *context, const struct incise_scan_device *device)
{
	note("%s: %s", device->device, device->what);
	*(int *)context += device->usable &&
			   !strcmp(device->device,
				   "v4l2:/dev/v4l/by-path/platform-vivid.0-video-index0");
	return 0;
}

static void scan(void)
{
	int n = 0;

	check(!incise_scan("camera", "v4l2:", found, &n, &err) && n == 1,
	      "the module lists it by its path %s", err.text);
}

static void unplug(void)
{
	static const struct incise_camera_setup setup = {.pixels = INCISE_PIXELS_YUYV};
	struct incise_camera *camera = open_camera(&setup);
	struct incise_camera_frame frame;
	unsigned int sum = 0;
	char text[500];

	if (!check(camera && await(camera, &frame) == 1, "it runs as it is"))
		return;
	check(!system("echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind"),
	      "it is unbound under way");
	check(drain(camera) == -ENODEV, "it is unplugged");
	for (size_t i = 0; i < frame.size; i++)
		sum += frame.data[i];
	check(sum > 0, "the picture that is held may be read");
	incise_camera_cause(camera, text, sizeof(text));
	check(strstr(text, "unplugged"), "the cause: %s", text);
	camera->ops->close(camera);
	check(!open_camera(&setup) && err.code == ENOENT, "it cannot be opened any more");
}

int main(int argc, char **argv)
{
	const char *profile;

	if (argc != 2)
		return 2;
	path = argv[1];
	/* Virtual time goes on while a page is read from the host. */
	mlockall(MCL_CURRENT | MCL_FUTURE);
	profile = getenv("INCISE_VM_PROFILE");
	on_time = profile && !strcmp(profile, "deterministic");
	scan();
	formats();
	choice();
	controls();
	losses();
	wraps();
	unplug();
	return tap_failures ? 1 : 0;
}
