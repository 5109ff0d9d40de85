// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Part of a JPEG frame as RGB, by libjpeg-turbo. Not by OpenCV's imgcodecs: that guesses the
 * format, brings GDAL and some 40 more libraries into the process, and cannot skip pixels outside
 * the region of interest.
 *
 * In C, because libjpeg's errors leave by longjmp(), which must not skip destructors.
 */
#include <errno.h>
#include <setjmp.h>
#include <stdio.h>
#include <jpeglib.h>
#include <jerror.h>
#include "vision_opencv.h"

struct jpeg_reader {
	struct jpeg_decompress_struct jpeg;
	struct jpeg_error_mgr errors;
	jmp_buf out;
};

static void leave(j_common_ptr jpeg)
{
	struct jpeg_reader *reader = (struct jpeg_reader *)jpeg->client_data;

	longjmp(reader->out, 1);
}

/* For libjpeg, truncated or damaged data are only a warning, and it fills in grey. */
static void judge_jpeg(j_common_ptr jpeg, int level)
{
	if (level >= 0)
		return;
	switch (jpeg->err->msg_code) {
	case JWRN_EXTRANEOUS_DATA: /* padding */
	case JWRN_JFIF_MAJOR:
	case JWRN_ADOBE_XFORM:
		return;
	default:
		leave(jpeg);
	}
}

static void be_silent(j_common_ptr jpeg)
{
	(void)jpeg;
}

static int decode_jpeg(struct jpeg_reader *r, const struct incise_camera_frame *frame,
		       struct incise_vision_box *area, uint8_t *rgb)
{
	struct jpeg_decompress_struct *jpeg = &r->jpeg;
	JDIMENSION x = area->x, width = area->width;

	jpeg_mem_src(jpeg, frame->data, frame->size);
	if (jpeg_read_header(jpeg, TRUE) != JPEG_HEADER_OK)
		return -EBADMSG;
	if (jpeg->image_width != (JDIMENSION)frame->width ||
	    jpeg->image_height != (JDIMENSION)frame->height)
		return -EINVAL;
	/* No camera sends these, and a small file of many scans would take minutes. */
	if (jpeg->progressive_mode || jpeg->arith_code ||
	    (jpeg->num_components != 1 && jpeg->num_components != 3))
		return -EBADMSG;
	jpeg->out_color_space = JCS_RGB;
	jpeg->dct_method = JDCT_ISLOW;
	if (!jpeg_start_decompress(jpeg))
		return -EBADMSG;
	jpeg_crop_scanline(jpeg, &x, &width);
	if (area->y > 0 && jpeg_skip_scanlines(jpeg, area->y) != (JDIMENSION)area->y)
		return -EBADMSG;
	for (int y = 0; y < area->height; y++) {
		JSAMPROW row = rgb + (size_t)y * frame->width * 3;

		if (jpeg_read_scanlines(jpeg, &row, 1) != 1)
			return -EBADMSG;
	}
	area->x = (int)x;
	area->width = (int)width;
	return 0;
}

int incise_jpeg_decode(const struct incise_camera_frame *frame,
		       struct incise_vision_box *area, uint8_t *rgb)
{
	struct jpeg_reader r = {.jpeg = {.client_data = &r}};
	volatile int ret = -EBADMSG;

	r.jpeg.err = jpeg_std_error(&r.errors);
	r.errors.error_exit = leave;
	r.errors.emit_message = judge_jpeg;
	r.errors.output_message = be_silent;
	if (!setjmp(r.out)) {
		jpeg_create_decompress(&r.jpeg);
		ret = decode_jpeg(&r, frame, area, rgb);
	} else if (r.errors.msg_code == JERR_OUT_OF_MEMORY) {
		ret = -ENOMEM;
	}
	jpeg_destroy_decompress(&r.jpeg);
	return ret;
}
