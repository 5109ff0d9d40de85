// SPDX-License-Identifier: GPL-2.0-or-later
/* The panels: contents and times of redrawing; any tick is harmless. */
#include "../unit.h"
#include "../../../lib/view/overlay.h"

static struct incise_tick at(int64_t ms, double force_N, double depth_mm)
{
	return (struct incise_tick){
		.t_ns = ms * 1000000, .command_N = {0, 0, force_N}, .depth_mm = depth_mm};
}

/* Pixels of the colour of a curve, in the half of the panel that its graph is in. */
static int curve(const struct incise_overlay_image *image, bool depth, int from, int to)
{
	int n = 0;

	for (int y = depth ? 90 : 14; y < (depth ? 152 : 76); y++)
		for (int x = from; x < to; x++) {
			const uint8_t *p = image->pixels + 4 * (y * image->width + x);

			/* Blue, green, red; name and unit stand in the left quarter. */
			n += depth ? p[0] > 150 && p[2] < 150 : p[2] > 150 && p[0] < 130;
		}
	return n;
}

TEST(test_graphs)
{
	struct incise_overlay *overlay = incise_overlay_new(NULL);
	const struct incise_overlay_image *image;
	struct incise_tick tick;

	assert_non_null(overlay);
	image = incise_overlay_panel(overlay, NULL);
	assert_non_null(image);
	assert_int_equal(curve(image, false, 130, 294), 0);
	/* The last second of ten: the right tenth of 250 columns. */
	for (int ms = 0; ms < 1000; ms++) {
		tick = at(ms, 0.4, 3);
		incise_overlay_tick(overlay, &tick);
	}
	image = incise_overlay_panel(overlay, NULL);
	assert_true(curve(image, false, 272, 294) > 15);
	assert_true(curve(image, true, 272, 294) > 15);
	assert_int_equal(curve(image, false, 130, 265), 0);
	/* Ten seconds later it is gone. */
	tick = at(12000, NAN, NAN);
	incise_overlay_tick(overlay, &tick);
	image = incise_overlay_panel(overlay, NULL);
	assert_int_equal(curve(image, false, 130, 294), 0);
	incise_overlay_free(overlay);
}

TEST(test_redrawn_15_times_a_second)
{
	const struct incise_view_status status = {"running", 1000, 3, 40, 0};
	struct incise_overlay *overlay = incise_overlay_new(NULL);
	uint64_t first = 0, last = 0;

	for (int ms = 0; ms <= 2000; ms++) {
		struct incise_tick tick = at(ms, 1, 1);

		incise_overlay_tick(overlay, &tick);
		last = incise_overlay_panel(overlay, &status)->version;
		if (!ms)
			first = last;
	}
	assert_in_range(last - first, 28, 30);
	/* Without a new tick, a new state is drawn at once, other changes are not. */
	assert_int_equal(incise_overlay_panel(overlay, &status)->version, last);
	assert_int_equal(incise_overlay_panel(
				 overlay, &(struct incise_view_status){.state = "fault"})
				 ->version,
			 last + 1);
	incise_overlay_free(overlay);
}

TEST(test_anything)
{
	static const double odd[] = {0, -1, NAN, INFINITY, -INFINITY, 1e308, 1e-320};
	static const int64_t times[] = {INT64_MIN, -1, 0, 1, INT64_MAX, 5, INT64_MIN + 1};
	struct incise_view_status status = {NULL, NAN, INFINITY, -1e300, UINT64_MAX};
	char words[4000];
	struct incise_overlay *overlay = incise_overlay_new(NULL);

	memset(words, 'x', sizeof(words) - 1);
	words[sizeof(words) - 1] = 0;
	for (int i = 0; i < 7 * 7 * 7; i++) {
		struct incise_tick tick = {.t_ns = times[i % 7],
					   .command_N = {odd[i / 7 % 7], 0, odd[i / 49]},
					   .depth_mm = odd[i / 49],
					   .phase = (enum incise_phase)i,
					   .tool = (enum incise_tool)i,
					   .flags = (unsigned)i * 2654435761u};

		incise_overlay_tick(overlay, &tick);
		status.state = i & 1 ? words : "\xff\xfe";
		status.rate_hz = odd[i % 7];
		assert_non_null(incise_overlay_panel(overlay, &status));
	}
	incise_overlay_free(overlay);
	incise_overlay_free(NULL);
}

TEST(test_caption)
{
	static uint8_t rgb[40 * 100 * 3];
	int dark = 0;

	assert_int_equal(incise_view_caption(rgb, 0, 40, "2 s"), -EINVAL);
	assert_int_equal(incise_view_caption(rgb, 100, INCISE_VIEW_SIDE_MAX + 1, "2 s"),
			 -EINVAL);
	assert_int_equal(incise_view_caption(rgb, 100, 40, "2 s"), 0);
	for (int y = 0; y < 40; y++)
		for (int x = 0; x < 100; x++) {
			const uint8_t *p = rgb + 3 * (100 * y + x);
			bool inner = x > 10 && x < 90 && y > 5 && y < 39;

			assert_true(inner || p[0] + p[1] + p[2] == 3 * 255);
			dark += p[0] < 100;
		}
	/* With a font. */
	print_message("%d dark pixels\n", dark);
	assert_true(dark < 40 * 100 / 2);
	incise_view_caption(rgb, 100, 40, "");
	for (size_t i = 0; i < sizeof(rgb); i++)
		assert_int_equal(rgb[i], 255);
}

TEST(test_keys)
{
	const char *const lines[30] = {"a\tone", "two", "", "\t", "b\tthree"};
	const struct incise_overlay_image *image;
	struct incise_overlay *overlay = incise_overlay_new(NULL);
	int lit = 0;

	assert_int_equal(incise_overlay_set_keys(overlay, lines, 5), 0);
	image = incise_overlay_keys(overlay);
	for (int i = 0; i < image->width * image->height; i++)
		lit += image->pixels[4 * i + 1] > 150;
	/* With a font; without one there is still a panel. */
	print_message("%d pixels of text\n", lit);
	assert_int_equal(image->pixels[4 * (40 * image->width + 2) + 3], 184);
	assert_int_equal(incise_overlay_keys(overlay)->version, 1);
	assert_int_equal(incise_overlay_set_keys(overlay, lines, 1), 0);
	assert_int_equal(incise_overlay_keys(overlay)->version, 2);
	assert_int_equal(incise_overlay_set_keys(overlay, NULL, 0), 0);
	assert_non_null(incise_overlay_keys(overlay));
	incise_overlay_free(overlay);
}
