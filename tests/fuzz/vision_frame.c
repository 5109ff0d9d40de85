// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise_vision_measure() and incise_vision_learn() on any bytes: the first ones give the
 * format, sizes and stride, the others are the picture, repeated where that takes more.
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <incise/vision.h>

#define HEAD 16
#define MOST (1 << 16) /* bytes of a picture, so that a run stays short */

static int number(const uint8_t *data, int at)
{
	return data[at] | data[at + 1] << 8;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static const struct incise_vision_setup black = {.hue = {170, 169},
							 .saturation = {0, 255},
							 .value = {0, 60},
							 .full_px = 400,
							 .depth_mm_px = 0.1};
	struct incise_vision_setup learnt = black;
	struct incise_vision_result result;
	struct incise_vision *vision;
	struct incise_camera_frame frame = {0};
	struct incise_vision_box box;
	uint8_t *picture;

	if (size <= HEAD)
		return 0;
	frame.pixels = (enum incise_pixels)(data[0] % 5);
	frame.width = (int16_t)number(data, 1) % 300;
	frame.height = (int16_t)number(data, 3) % 300;
	frame.stride = (int16_t)number(data, 5);
	box = (struct incise_vision_box){number(data, 7), number(data, 9), data[11],
					 data[12]};
	frame.size = size - HEAD;
	if (data[13] & 1 && frame.pixels != INCISE_PIXELS_MJPEG)
		frame.size = (size_t)number(data, 14) * 4 % MOST;
	/* exactly so long, for the sanitizer */
	picture = malloc(frame.size ? frame.size : 1);
	if (!picture)
		return 0;
	for (size_t i = 0; i < frame.size; i++)
		picture[i] = data[HEAD + i % (size - HEAD)];
	frame.data = picture;
	vision = incise_vision_new(&black, NULL);
	for (int i = 0; vision && i < 2; i++)
		if (!incise_vision_measure(vision, &frame, &result) && result.found &&
		    !(result.quality > 0 && result.quality <= 1))
			abort();
	incise_vision_free(vision);
	if (!incise_vision_learn(&frame, &box, &learnt, NULL)) {
		vision = incise_vision_new(&learnt, NULL);
		if (!vision)
			abort();
		incise_vision_measure(vision, &frame, &result);
		incise_vision_free(vision);
	}
	free(picture);
	return 0;
}
