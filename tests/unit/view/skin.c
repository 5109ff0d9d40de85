// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Painted tissue: plausible colours, no seams, and one texture per seed. Its beauty is not tested.
 */
#include "../unit.h"
#include "../../../lib/base/ascending.h"
#include "../../../lib/view/skin.h"

#define SIZE 512
#define TEXELS ((size_t)SIZE * SIZE)

struct picture {
	uint8_t rgba[4 * TEXELS], normal[3 * TEXELS];
};

/* A texture whose texels are those of the middle of one of 2048² on a neck. */
static struct uv_map map_of(double texel_mm)
{
	return (struct uv_map){
		.size = SIZE, .wide_mm = SIZE * texel_mm, .high_mm = SIZE * texel_mm};
}

static struct picture *paint(enum incise_skin skin, double texel_mm, uint64_t seed)
{
	struct uv_map map = map_of(texel_mm);
	struct picture *picture = malloc(sizeof(*picture));

	if (!picture)
		abort();
	/* Every byte is overwritten. */
	memset(picture, 0x5a, sizeof(*picture));
	assert_int_equal(
		incise_skin_paint(&map, skin, seed, picture->rgba, picture->normal), 0);
	return picture;
}

static void mean(const struct picture *picture, double rgb[3])
{
	for (int c = 0; c < 3; c++) {
		rgb[c] = 0;
		for (size_t i = 0; i < TEXELS; i++)
			rgb[c] += picture->rgba[4 * i + (size_t)c];
		rgb[c] /= TEXELS;
	}
}

/* Opaque, and outward normals of length 1 to 8 bits. */
static void well_formed(const struct picture *picture)
{
	double slope[2] = {0};

	for (size_t i = 0; i < TEXELS; i++) {
		const uint8_t *rgb = picture->normal + 3 * i;
		double x = (rgb[0] - 128) / 127.0, y = (rgb[1] - 128) / 127.0;
		double z = (rgb[2] - 128) / 127.0;

		assert_int_equal(picture->rgba[4 * i + 3], 255);
		/* Two are rounded by up to one step, one by half a step. */
		assert_true(fabs(sqrt(x * x + y * y + z * z) - 1) < 1.6 / 127);
		assert_true(z > 0.2);
		slope[0] += x;
		slope[1] += y;
	}
	/* The mean is flat: pores and furrows have two sides. */
	assert_true(fabs(slope[0] / TEXELS) < 0.01 && fabs(slope[1] / TEXELS) < 0.01);
}

TEST(test_plain)
{
	struct picture *picture = paint(INCISE_SKIN_PLAIN, 0.1, 3);

	well_formed(picture);
	for (size_t i = 0; i < TEXELS; i++) {
		const uint8_t flat[3] = {128, 128, 255};

		assert_memory_equal(picture->rgba + 4 * i, picture->rgba, 4);
		assert_memory_equal(picture->normal + 3 * i, flat, 3);
	}
	free(picture);
}

/*
 * The rule of Kovač, Peer and Solina (EUROCON 2003) that distinguishes skin in daylight, and the
 * range of means of light to tanned skin.
 */
TEST(test_neck_is_skin)
{
	for (uint64_t seed = 0; seed < 4; seed++) {
		struct picture *picture = paint(INCISE_SKIN_NECK, 0.3, seed);
		size_t skin = 0;
		double rgb[3];

		for (size_t i = 0; i < TEXELS; i++) {
			const uint8_t *p = picture->rgba + 4 * i;

			skin += p[0] > 95 && p[1] > 40 && p[2] > 20 && p[0] - p[2] > 15 &&
				p[0] - p[1] > 15 && p[0] > p[1] && p[1] >= p[2];
		}
		/* Moles and skin over veins may violate it. */
		assert_true((double)skin > 0.99 * TEXELS);
		mean(picture, rgb);
		assert_true(rgb[0] > 180 && rgb[0] < 230);
		assert_true(rgb[1] > 130 && rgb[1] < 185);
		assert_true(rgb[2] > 105 && rgb[2] < 165);
		well_formed(picture);
		free(picture);
	}
}

TEST(test_liver_is_dark)
{
	for (uint64_t seed = 0; seed < 4; seed++) {
		struct picture *picture = paint(INCISE_SKIN_LIVER, 0.23, seed);
		double rgb[3];

		mean(picture, rgb);
		assert_true(rgb[0] > 80 && rgb[0] < 130);
		assert_true(rgb[1] > 25 && rgb[1] < 60);
		assert_true(rgb[2] > 20 && rgb[2] <= rgb[1]);
		well_formed(picture);
		free(picture);
	}
}

/* Neither one colour nor pure noise: differences of texels, of 255. */
TEST(test_has_texture)
{
	for (int skin = INCISE_SKIN_NECK; skin <= INCISE_SKIN_LIVER; skin++) {
		struct picture *picture = paint((enum incise_skin)skin, 0.075, 1);
		double rgb[3], sd = 0, rough = 0;

		mean(picture, rgb);
		for (size_t i = 0; i < TEXELS; i++) {
			double d = picture->rgba[4 * i + 1] - rgb[1];
			double n = picture->normal[3 * i] - 128;

			sd += d * d / TEXELS;
			rough += n * n / TEXELS;
		}
		assert_true(sqrt(sd) > 1.5 && sqrt(sd) < 20);
		/* Slopes of 1 to 20 of 127. */
		assert_true(sqrt(rough) > 1 && sqrt(rough) < 20);
		free(picture);
	}
}

/* Mean difference between neighbouring columns, or rows. */
static double step(const struct picture *picture, size_t at, bool across)
{
	double sum = 0;

	for (size_t k = 0; k < SIZE; k++) {
		size_t a = across ? k * SIZE + at : at * SIZE + k;
		size_t b = across ? a + 1 : a + SIZE;

		for (size_t c = 0; c < 3; c++)
			sum += abs(picture->rgba[4 * a + c] - picture->rgba[4 * b + c]);
	}
	return sum / SIZE;
}

/* No line between two columns or rows stands out, at any possible tile border. */
TEST(test_no_seam)
{
	for (int skin = INCISE_SKIN_NECK; skin <= INCISE_SKIN_LIVER; skin++) {
		struct picture *picture = paint((enum incise_skin)skin, 0.15, 5);

		for (int across = 0; across < 2; across++) {
			double steps[SIZE - 1];

			for (size_t i = 0; i < SIZE - 1; i++)
				steps[i] = step(picture, i, across);
			qsort(steps, SIZE - 1, sizeof(*steps), ascending);
			/* The largest is a crease along a column. */
			assert_true(steps[SIZE - 2] < 1.6 * steps[SIZE / 2]);
			/* Nor is one smeared. */
			assert_true(steps[0] > 0.5 * steps[SIZE / 2]);
		}
		free(picture);
	}
}

/* Difference between neighbouring texels: fine patterns, without wide ones. */
static double fine(const struct picture *picture, size_t x, size_t y)
{
	const uint8_t *here = picture->rgba + 4 * (y * SIZE + x);

	return (double)here[1] - here[5];
}

/* Nothing repeats after an eighth, a quarter or a half of the side, as tiles would. */
TEST(test_no_tile)
{
	for (int skin = INCISE_SKIN_NECK; skin <= INCISE_SKIN_LIVER; skin++) {
		struct picture *picture = paint((enum incise_skin)skin, 0.15, 6);

		for (size_t shift = SIZE / 8; shift < SIZE; shift *= 2)
			for (int across = 0; across < 2; across++) {
				double both = 0, self = 0;

				for (size_t y = 0; y < SIZE - shift; y++)
					for (size_t x = 0; x < SIZE - shift - 1; x++) {
						double a = fine(picture, x, y);

						both += a *
							fine(picture,
							     x + (across ? shift : 0),
							     y + (across ? 0 : shift));
						self += a * a;
					}
				/* Of 65 000 texels, some ten of which are alike: 1.2 %. */
				assert_true(fabs(both) < 0.05 * self);
			}
		free(picture);
	}
}

TEST(test_seed)
{
	for (int skin = INCISE_SKIN_NECK; skin <= INCISE_SKIN_LIVER; skin++) {
		struct picture *a = paint((enum incise_skin)skin, 0.1, 1);
		struct picture *b = paint((enum incise_skin)skin, 0.1, 1);
		struct picture *c = paint((enum incise_skin)skin, 0.1, 2);
		size_t same = 0;

		assert_memory_equal(a, b, sizeof(*a));
		for (size_t i = 0; i < TEXELS; i++)
			same += !memcmp(a->rgba + 4 * i, c->rgba + 4 * i, 4);
		/* By chance some texels have the same colour. */
		assert_true((double)same < 0.05 * TEXELS);
		free(a);
		free(b);
		free(c);
	}
}

/* Textures of the size of a body, of a cell, and of invalid sizes. */
TEST(test_any_scale)
{
	static const double scales[] = {0,   1e-300, 1e-9,  1e-3,     1,  3,
					300, 1e9,    1e300, INFINITY, -1, NAN};

	for (size_t k = 0; k < sizeof(scales) / sizeof(*scales); k++)
		for (int skin = INCISE_SKIN_NECK; skin <= INCISE_SKIN_LIVER; skin++) {
			const struct uv_map map = {.size = 64,
						   .wide_mm = 64 * scales[k],
						   .high_mm = 64 * scales[k]};
			uint8_t rgba[4 * 64 * 64], normal[3 * 64 * 64];

			assert_int_equal(incise_skin_paint(&map, (enum incise_skin)skin,
							   UINT64_MAX, rgba, normal),
					 0);
			for (size_t i = 0; i < 64 * 64; i++)
				assert_true(rgba[4 * i + 3] == 255 &&
					    normal[3 * i + 2] > 128);
		}
}
