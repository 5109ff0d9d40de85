// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The group `picture` of a scene: what it says, what it does not say, what it cannot say.
 */
#include "../unit.h"
#include <incise/scene.h>
#include "../message.h"

static char path[] = "/tmp/incise-picture-XXXXXX";

static struct incise_scene *scene(const char *group, struct incise_error *err)
{
	FILE *out = fopen(path, "w");

	assert_non_null(out);
	fprintf(out, "tissue = { reaction_N_mm = 0.1; };\n%s\n", group);
	fclose(out);
	return incise_scene_load(path, NULL, err);
}

TEST(test_said_and_not_said)
{
	struct incise_scene_picture p;
	struct incise_scene *s = scene("", NULL);

	assert_non_null(s);
	incise_scene_picture(s, &p);
	assert_false(p.wound || p.bleeding || p.larynx);
	assert_int_equal(p.skin, INCISE_SKIN_PLAIN);
	assert_int_equal(p.texture_px, 2048);
	assert_true(p.gravity[0] == 0 && p.gravity[1] == 0 && p.gravity[2] == -1);
	incise_scene_free(s);

	s = scene(
		"picture = { wound = true; bleeding = true; larynx = true; skin = \"neck\";\n"
		"texture_px = 512; gravity = [0.0, 3.0, -4.0]; blood_ul_s_mm2 = 0.5;\n"
		"viscosity_mPa_s = 12.0; seed = 7; };",
		NULL);
	assert_non_null(s);
	incise_scene_picture(s, &p);
	assert_true(p.wound && p.bleeding && p.larynx);
	assert_int_equal(p.skin, INCISE_SKIN_NECK);
	assert_int_equal(p.texture_px, 512);
	/* Made unit; 3, 4, 5 to the last digits. */
	assert_true(fabs(p.gravity[1] - 0.6) < 1e-15 && fabs(p.gravity[2] + 0.8) < 1e-15);
	assert_true(p.blood_ul_s_mm2 == 0.5 && p.viscosity_mPa_s == 12);
	assert_int_equal(p.seed, 7);
	incise_scene_free(s);
}

TEST(test_refused)
{
	static const struct {
		const char *group, *says;
	} cases[] = {
		{"picture = { skin = \"fish\"; };", "picture.skin:"},
		{"picture = { texture_px = 1000; };", "picture.texture_px:"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_error(scene(cases[i].group, &err), EINVAL, &err, ":2",
			     cases[i].says);
	}
}

TEST(test_texture_is_set)
{
	static const struct {
		int px, rc;
	} cases[] = {{256, 0},	      {4096, 0},       {2048, 0},    {128, -EINVAL},
		     {8192, -EINVAL}, {1000, -EINVAL}, {0, -EINVAL}, {-512, -EINVAL}};
	struct incise_scene *s = scene("picture = { texture_px = 512; };", &err);
	struct incise_scene_picture p;
	int now = 512;

	assert_non_null(s);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_int_equal(incise_scene_set_texture(s, cases[i].px), cases[i].rc);
		now = cases[i].rc ? now : cases[i].px;
		incise_scene_picture(s, &p);
		assert_int_equal(p.texture_px, now);
	}
	incise_scene_free(s);
}

static int begin(void **state)
{
	int fd = mkstemp(path);

	return fd < 0 ? -1 : close(fd);
}

static int end(void **state)
{
	return unlink(path);
}

GROUP(begin, end);
