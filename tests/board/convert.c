// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A PGM of the tests as PNG and JPEG; or a scalpel over liver as PPM.
 *
 *     convert IN.pgm OUT.png OUT.jpg
 *     convert LENGTH_PX OUT.ppm
 */
#include <stdio.h>
#include <stdlib.h>
#include <jpeglib.h>
#include <png.h>
#include "../vision/scalpel_picture.h"

static int scalpel(double length_px, const char *path)
{
	struct incise_camera_frame frame;
	struct scalpel_picture picture;
	FILE *out = fopen(path, "wb");

	scalpel_picture_init(&picture);
	picture.length_px = length_px;
	picture.noise = 2;
	picture.angle_deg = 3;
	picture.seed = (uint64_t)(1000 * length_px);
	if (!out || scalpel_picture_draw(&picture, &frame))
		return 1;
	fprintf(out, "P6\n# drawn\n%d %d\n255\n", frame.width, frame.height);
	fwrite(frame.data, 1, frame.size, out);
	return fclose(out);
}

int main(int argc, char **argv)
{
	struct jpeg_compress_struct jpeg;
	struct jpeg_error_mgr errors;
	png_image png = {.version = PNG_IMAGE_VERSION, .format = PNG_FORMAT_GRAY};
	unsigned char *pixels;
	int width, height;
	FILE *in, *out;

	if (argc == 3)
		return scalpel(atof(argv[1]), argv[2]);
	in = argc == 4 ? fopen(argv[1], "rb") : NULL;
	if (!in || fscanf(in, "P5 %d %d 255%*c", &width, &height) != 2)
		return 1;
	pixels = malloc((size_t)width * height);
	if (!pixels || fread(pixels, width, height, in) != (size_t)height)
		return 1;
	png.width = width;
	png.height = height;
	if (!png_image_write_to_file(&png, argv[2], 0, pixels, 0, NULL))
		return 1;
	out = fopen(argv[3], "wb");
	if (!out)
		return 1;
	jpeg.err = jpeg_std_error(&errors);
	jpeg_create_compress(&jpeg);
	jpeg_stdio_dest(&jpeg, out);
	jpeg.image_width = width;
	jpeg.image_height = height;
	jpeg.input_components = 1;
	jpeg.in_color_space = JCS_GRAYSCALE;
	jpeg_set_defaults(&jpeg);
	jpeg_set_quality(&jpeg, 95, TRUE);
	jpeg_start_compress(&jpeg, TRUE);
	while (jpeg.next_scanline < jpeg.image_height) {
		JSAMPROW row = pixels + (size_t)width * jpeg.next_scanline;

		jpeg_write_scanlines(&jpeg, &row, 1);
	}
	jpeg_finish_compress(&jpeg);
	return fclose(out);
}
