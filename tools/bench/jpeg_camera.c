// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures that were coded before; see jpeg_camera.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/backend.h>
#include <incise/rig.h>
#include "jpeg_camera.h"
#ifdef HAVE_JPEG
#include <jpeglib.h>
#endif

#define PICTURES 64 /* 1.3 s: in the air and in the tissue */
#define QUALITY 85
#define WAIT_MOST 24	     /* pictures, for a reader that is held up */
#define FIRST_NS 800000000LL /* the plunge of the first cut begins at 1 s */

struct picture {
	unsigned char *bytes;
	unsigned long size;
};

struct jpeg_camera {
	struct incise_camera_ops ops;
	const struct incise_camera_ops *before;
	struct incise_clock *clock;
	double rate_hz;
	int width, height;
	struct picture pictures[PICTURES];
	int64_t start_ns;
	uint64_t next, lost;
};

/* The one of this program: a camera of a rig has no place for more than its own. */
static struct jpeg_camera *current;

#ifdef HAVE_JPEG
static int code(const struct incise_camera_frame *frame, struct picture *to)
{
	struct jpeg_compress_struct jpeg;
	struct jpeg_error_mgr error;

	jpeg.err = jpeg_std_error(&error);
	jpeg_create_compress(&jpeg);
	jpeg_mem_dest(&jpeg, &to->bytes, &to->size);
	jpeg.image_width = (JDIMENSION)frame->width;
	jpeg.image_height = (JDIMENSION)frame->height;
	jpeg.input_components = 3;
	jpeg.in_color_space = JCS_RGB;
	jpeg_set_defaults(&jpeg);
	jpeg_set_quality(&jpeg, QUALITY, TRUE);
	jpeg_start_compress(&jpeg, TRUE);
	while (jpeg.next_scanline < jpeg.image_height) {
		JSAMPROW row = (JSAMPROW)(frame->data +
					  (size_t)jpeg.next_scanline * frame->stride);

		jpeg_write_scanlines(&jpeg, &row, 1);
	}
	jpeg_finish_compress(&jpeg);
	jpeg_destroy_compress(&jpeg);
	return 0;
}
#else
static int code(const struct incise_camera_frame *frame, struct picture *to)
{
	(void)frame;
	(void)to;
	return -EOPNOTSUPP;
}
#endif

static int code_all(struct jpeg_camera *c, struct incise_rig *rig)
{
	struct incise_camera *camera = incise_rig_camera(rig);
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_camera_frame frame;
	int n = 0, rc = 0;

	incise_clock_wait_until(clock, incise_clock_now(clock) + FIRST_NS);
	incise_camera_newest(camera, &frame);
	while (n < PICTURES && !rc) {
		incise_clock_wait_until(clock, incise_clock_now(clock) + 10000000);
		if (incise_camera_read(camera, &frame) != 1)
			continue;
		c->width = frame.width;
		c->height = frame.height;
		rc = code(&frame, &c->pictures[n++]);
	}
	return rc;
}

struct jpeg_camera *jpeg_camera_new(double rate_hz, struct incise_error *err)
{
	struct jpeg_camera *c = calloc(1, sizeof(*c));
	struct incise_rig *rig =
		incise_rig_open("sim:clock=simulated", INCISE_RIG_CAMERA, err);
	int rc = !c || !rig ? -ENOMEM : code_all(c, rig);

	incise_rig_close(rig);
	if (!rc) {
		c->rate_hz = rate_hz;
		return c;
	}
	incise_error_set(err, -rc,
			 rc == -EOPNOTSUPP
				 ? "this incise was built without libjpeg, which makes "
				   "the pictures; build it where libjpeg-dev is"
				 : "no memory for pictures");
	jpeg_camera_free(c);
	errno = -rc;
	return NULL;
}

void jpeg_camera_free(struct jpeg_camera *c)
{
	for (int i = 0; c && i < PICTURES; i++)
		free(c->pictures[i].bytes);
	free(c);
}

/* --- as a camera ---------------------------------------------------------------------- */

static int64_t due_ns(const struct jpeg_camera *c, uint64_t n)
{
	return c->start_ns + (int64_t)((double)n * 1e9 / c->rate_hz);
}

static int camera_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	struct jpeg_camera *c = current;
	const struct picture *picture;
	int64_t now_ns = incise_clock_now(c->clock);

	(void)camera;
	if (now_ns < due_ns(c, c->next))
		return 0;
	/* As of a driver with so many buffers: what has no room is lost. */
	while (now_ns >= due_ns(c, c->next + WAIT_MOST)) {
		c->next++;
		c->lost++;
	}
	picture = &c->pictures[c->next % PICTURES];
	*frame = (struct incise_camera_frame){
		.t_ns = due_ns(c, c->next),
		.seq = c->next,
		.width = c->width,
		.height = c->height,
		.pixels = INCISE_PIXELS_MJPEG,
		.data = picture->bytes,
		.size = picture->size,
	};
	c->next++;
	return 1;
}

static void camera_info(const struct incise_camera *camera,
			struct incise_camera_info *info)
{
	(void)camera;
	*info = (struct incise_camera_info){
		.rate_hz = current->rate_hz,
		.width = current->width,
		.height = current->height,
		.pixels = INCISE_PIXELS_MJPEG,
	};
	snprintf(info->name, sizeof(info->name), "JPEG pictures made before");
}

static uint64_t camera_lost(const struct incise_camera *camera)
{
	(void)camera;
	return current->lost;
}

static void camera_close(struct incise_camera *camera)
{
	camera->ops = current->before;
	current = NULL;
	camera->ops->close(camera);
}

void jpeg_camera_take_over(struct jpeg_camera *c, struct incise_camera *of_rig,
			   struct incise_clock *clock)
{
	c->ops = (struct incise_camera_ops){
		.read = camera_read,
		.info = camera_info,
		.lost = camera_lost,
		.close = camera_close,
	};
	c->before = of_rig->ops;
	c->clock = clock;
	c->start_ns = incise_clock_now(clock);
	c->next = c->lost = 0;
	of_rig->ops = &c->ops;
	current = c;
}

size_t jpeg_camera_bytes(const struct jpeg_camera *c, int *n)
{
	size_t bytes = 0;

	for (int i = 0; i < PICTURES; i++)
		bytes += c->pictures[i].size;
	*n = PICTURES;
	return bytes;
}
