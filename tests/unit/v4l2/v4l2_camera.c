// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/v4l2/v4l2_camera.c on a driver that the test simulates: a camera from open to close, or to
 * its end; and the search, in a folder that the test fills as udev does.
 */
#include "../unit.h"
#include <fcntl.h>
#include <glob.h>
#include <sys/stat.h>
#include "../../../lib/rig/backends.h"
#include "driver.h"

extern const struct incise_backend incise_camera_v4l2;

/* --- v4l2_camera --- */

#define PATIENCE 60000 /* looks, about a millisecond apart when the thread waits */

static struct incise_error err;

/* A test that is held up must not make the camera silent for seconds. */
static void reset(void)
{
	driver_reset();
	driver.stands = true;
}

static struct incise_camera *open_camera(const char *path,
					 const struct incise_camera_setup *setup)
{
	const struct incise_backend_request request = {
		.arguments = path, .where = "rig.conf:1: camera", .camera = setup};

	err = (struct incise_error){0};
	return incise_camera_v4l2.open(&request, &err);
}

static int await(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	int rc = 0;

	for (int i = 0; i < PATIENCE && !rc; i++) {
		rc = incise_camera_read(camera, frame);
		if (!rc)
			__real_poll(NULL, 0, 1);
	}
	return rc;
}

static void close_camera(struct incise_camera *camera)
{
	camera->ops->close(camera);
	assert_int_equal(driver.opened, 0);
	assert_int_equal(driver.streams, 0);
	assert_int_equal(driver.mapped, 0);
}

TEST(frames_come_through_the_interface)
{
	static const struct incise_camera_setup setup = {.width = 32,
							 .height = 24,
							 .rate_hz = 60,
							 .pixels = INCISE_PIXELS_YUYV,
							 .exposure_ms = 10};
	struct incise_camera_frame frame = {0};
	struct incise_camera_info info;
	struct incise_camera *camera;
	char text[100];

	reset();
	driver_add(V4L2_CID_EXPOSURE_ABSOLUTE, 1, 1000, 50);
	camera = open_camera("/dev/video7", &setup);
	succeeds(camera);
	incise_camera_info(camera, &info);
	assert_int_equal(strncmp(info.name, "C?CCC", 5), 0);
	assert_int_equal(strlen(info.name), 32);
	assert_true(info.width == 32 && info.height == 24 && info.rate_hz == 60);
	assert_int_equal(info.pixels, INCISE_PIXELS_YUYV);
	assert_true(info.exposure_ns == 10000000 && !info.damaged);
	for (uint32_t i = 0; i < 200; i++) {
		/* Every other one is damaged. */
		driver_shoot_flagged(2 * i, V4L2_BUF_FLAG_ERROR);
		driver_shoot(2 * i + 1);
		assert_int_equal(await(camera, &frame), 1);
		assert_int_equal(frame.data[0], (uint8_t)(2 * i + 1));
		assert_true(frame.seq == 2 * i + 1);
	}
	assert_true(incise_camera_lost(camera) == 200);
	incise_camera_info(camera, &info);
	assert_true(info.damaged == 200);
	assert_int_equal(incise_camera_cause(camera, text, sizeof(text)), 0);
	assert_string_equal(text, "");
	close_camera(camera);
}

TEST(a_count_of_fields_is_noted)
{
	struct incise_camera_frame frame;
	struct incise_camera_info info;
	struct incise_camera *camera;

	reset();
	camera = open_camera("/dev/video7", NULL);
	assert_non_null(camera);
	incise_camera_info(camera, &info);
	assert_string_equal(info.note, "");
	for (uint32_t i = 0; i < 2; i++) {
		driver_shoot(2 * i);
		assert_int_equal(await(camera, &frame), 1);
		assert_int_equal(frame.seq, i);
	}
	incise_camera_info(camera, &info);
	assert_says(info.note, "counts 2 for each frame");
	assert_int_equal(incise_camera_lost(camera), 0);
	close_camera(camera);
}

TEST(an_unplugged_camera_says_so)
{
	struct incise_camera_frame frame;
	struct incise_camera *camera;
	char text[200];

	reset();
	/* Without a group in rig.conf. */
	camera = open_camera("/dev/video7", NULL);
	assert_non_null(camera);
	driver_shoot(0);
	assert_int_equal(await(camera, &frame), 1);
	pthread_mutex_lock(&driver.lock);
	driver.dqbuf_error = ENODEV;
	pthread_mutex_unlock(&driver.lock);
	assert_int_equal(await(camera, &frame), -ENODEV);
	assert_int_equal(incise_camera_read(camera, &frame), -ENODEV);
	assert_true(incise_camera_cause(camera, text, sizeof(text)) > 0);
	assert_string_equal(text, "rig.conf:1: camera: the camera was unplugged; plug "
				  "it in and start again");
	/* What is held may still be looked at. */
	assert_int_equal(frame.data[0], 0);
	close_camera(camera);
}

TEST(controls_that_drift_end_it)
{
	struct incise_camera_frame frame;
	struct incise_camera *camera;
	char text[200];
	int rc = 0;

	/* Found by time where frames are few, by their number where there are many. */
	for (int many = 0; many < 2; many++) {
		reset();
		driver_add(V4L2_CID_GAIN, 0, 100, 50);
		camera = open_camera("/dev/video7", NULL);
		assert_non_null(camera);
		pthread_mutex_lock(&driver.lock);
		driver_control(V4L2_CID_GAIN)->value = 51;
		pthread_mutex_unlock(&driver.lock);
		rc = 1;
		for (uint32_t i = 0; i < (many ? 64 : 3) && rc == 1; i++) {
			pthread_mutex_lock(&driver.lock);
			driver.now_ns += many ? 0 : 1000000000;
			pthread_mutex_unlock(&driver.lock);
			driver_shoot(i);
			rc = await(camera, &frame);
		}
		if (rc == 1)
			rc = await(camera, &frame);
		assert_int_equal(rc, -EIO);
		incise_camera_cause(camera, text, sizeof(text));
		assert_says(text, "gain", "50", "51");
		close_camera(camera);
	}
}

static void forget_when_beginning(void)
{
	driver_add(V4L2_CID_GAIN, 0, 100, 50);
	driver.streamon_error = EIO;
}

TEST(why_it_cannot_be_opened_is_said)
{
	static const struct {
		const char *path;
		int open_error, querycap_error;
		uint32_t capabilities;
		void (*make)(void);
		int code;
		const char *says;
	} cases[] = {
		{"", 0, 0, 0, NULL, EINVAL, "v4l2:"},
		{"video0", 0, 0, 0, NULL, EINVAL, "v4l2:"},
		{"/dev/video0", ENOENT, 0, 0, NULL, ENOENT, "/dev/video0"},
		{"/dev/video0", EACCES, 0, 0, NULL, EACCES, "group"},
		{"/dev/video0", EBUSY, 0, 0, NULL, EBUSY, "program"},
		{"/dev/video0", EMFILE, 0, 0, NULL, EMFILE, "/dev/video0"},
		{"/dev/video0", 0, ENOTTY, 0, NULL, ENOTTY, "/dev/video0"},
		{"/dev/video0", 0, EINVAL, 0, NULL, ENOTTY, "/dev/video0"},
		{"/dev/video0", 0, 0, V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING, NULL,
		 EOPNOTSUPP, "/dev/video0"},
		{"/dev/video0", 0, 0, V4L2_CAP_VIDEO_CAPTURE, NULL, EOPNOTSUPP,
		 "/dev/video0"},
		{"/dev/video0", 0, 0, V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING,
		 forget_when_beginning, EIO, NULL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		reset();
		driver.open_error = cases[i].open_error;
		driver.querycap_error = cases[i].querycap_error;
		driver.capabilities = cases[i].capabilities;
		if (cases[i].make)
			cases[i].make();
		assert_error(open_camera(cases[i].path, NULL), cases[i].code, &err,
			     cases[i].says);
		assert_int_equal(driver.opened, 0);
		assert_int_equal(driver.mapped, 0);
	}
}

TEST(a_camera_may_be_opened_and_closed_at_once)
{
	for (int i = 0; i < 20; i++) {
		struct incise_camera *camera;

		reset();
		driver.interrupted = i;
		camera = open_camera("/dev/video7", NULL);
		assert_non_null(camera);
		close_camera(camera);
	}
}

/* --- scan --- */

static char dev[64];
static struct incise_scan_device seen[8];
static int n, answer;

int __real_glob(const char *pattern, int flags,
		int (*failed)(const char *path, int error), glob_t *files);

/* /dev is the test's folder. */
int __wrap_glob(const char *pattern, int flags,
		int (*failed)(const char *path, int error), glob_t *files)
{
	char inside[160];

	assert_int_equal(strncmp(pattern, "/dev/", 5), 0);
	snprintf(inside, sizeof(inside), "%s/%s", dev, pattern + 5);
	return __real_glob(inside, flags, failed, files);
}

static int note(void *context, const struct incise_scan_device *device)
{
	assert_ptr_equal(context, &n);
	assert_in_range(n, 0, 7);
	seen[n++] = *device;
	return answer;
}

static int scan(const char *arguments)
{
	n = 0;
	err = (struct incise_error){0};
	return incise_camera_v4l2.scan(arguments, note, &n, &err);
}

static const char *in_dev(const char *name)
{
	static char path[160];

	snprintf(path, sizeof(path), "%s/%s", dev, name);
	return path;
}

static int fill(void **state)
{
	snprintf(dev, sizeof(dev), "/tmp/incise-scan.XXXXXX");
	if (!mkdtemp(dev))
		return -1;
	for (int i = 0; i < 3; i++) {
		char name[20];

		snprintf(name, sizeof(name), "video%d", i);
		if (mknod(in_dev(name), S_IFREG | 0600, 0))
			return -1;
	}
	mkdir(in_dev("v4l"), 0700);
	mkdir(in_dev("v4l/by-id"), 0700);
	mkdir(in_dev("v4l/by-path"), 0700);
	return symlink("../../video1", in_dev("v4l/by-id/usb-Cam_77-video-index0")) ||
	       symlink("../../video0", in_dev("v4l/by-path/pci-1-video-index0")) ||
	       symlink("../../video1", in_dev("v4l/by-path/pci-2-video-index0"));
}

static int empty(void **state)
{
	char command[100];

	snprintf(command, sizeof(command), "rm -r %s", dev);
	return system(command);
}

TEST(cameras_are_named_by_what_stays)
{
	char expected[200];

	driver_reset();
	answer = 0;
	assert_int_equal(scan(""), 0);
	assert_int_equal(n, 3);
	snprintf(expected, sizeof(expected), "v4l2:%s/v4l/by-path/pci-1-video-index0",
		 dev);
	assert_string_equal(seen[0].device, expected);
	snprintf(expected, sizeof(expected), "v4l2:%s/v4l/by-id/usb-Cam_77-video-index0",
		 dev);
	assert_string_equal(seen[1].device, expected);
	snprintf(expected, sizeof(expected), "v4l2:%s/video2", dev);
	assert_string_equal(seen[2].device, expected);
	assert_non_null(strstr(seen[0].what, "(YUYV MJPG)"));
	assert_int_equal(strncmp(seen[0].what, "C?CCC", 5), 0);
	assert_string_equal(seen[0].property[1].key, "driver");
	assert_string_equal(seen[0].property[1].text, "played");
	assert_int_equal(driver.opened, 0);
}

TEST(one_may_be_asked_for)
{
	driver_reset();
	answer = 0;
	assert_int_equal(scan(in_dev("video2")), 0);
	assert_int_equal(n, 1);
	driver.open_error = ENOENT;
	assert_int_equal(scan(in_dev("video9")), 0);
	assert_int_equal(n, 0);
	driver.open_error = EIO;
	assert_int_equal(scan(in_dev("video2")), -EIO);
}

TEST(who_has_seen_enough_ends_it)
{
	driver_reset();
	answer = -77;
	assert_int_equal(scan(""), -77);
	assert_int_equal(n, 1);
	answer = 5;
	assert_int_equal(scan(""), 5);
	assert_int_equal(n, 1);
}

TEST(what_is_no_camera_is_passed_over)
{
	driver_reset();
	answer = 0;
	driver.capabilities = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
	assert_int_equal(scan(""), 0);
	assert_int_equal(n, 0);
	driver.querycap_error = ENOTTY;
	assert_int_equal(scan(""), 0);
	assert_int_equal(n, 0);
	assert_int_equal(driver.opened, 0);
}

TEST(who_may_not_look_is_reported)
{
	driver_reset();
	driver.open_error = EACCES;
	assert_int_equal(scan(""), -EACCES);
	assert_says(err.text, "group");
	assert_int_equal(n, 0);
}

GROUP(fill, empty);
