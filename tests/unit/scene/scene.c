// SPDX-License-Identifier: GPL-2.0-or-later
/* Scene files: defaults, paths, and errors that name file, line and range. */
#include "../unit.h"
#include "../../../lib/model/companion.h"
#include "../../../lib/model/texture.h"
#include "../../../lib/scene/scene.h"
#include "../message.h"
#include "felt.h"

/* A number of a force by its key. */
static double number(const struct incise_scene *scene, const char *key)
{
	for (int i = 0; i < incise_n_tissue_forces; i++)
		for (int k = 0; k < INCISE_FORCE_NUMBERS; k++) {
			const char *name = incise_tissue_forces[i].number[k].key;

			if (name && !strcmp(name, key))
				return scene->tissue.force[i][k];
		}
	fail_msg("no force has the number %s", key);
	return NAN;
}

static char dir[] = "/tmp/incise-scene-XXXXXX";
static char path[64], model_path[64], texture_path[64];

static int set_up(void **state)
{
	if (!mkdtemp(dir))
		return -1;
	snprintf(path, sizeof(path), "%s/a.scene", dir);
	snprintf(model_path, sizeof(model_path), "%s/m.fis", dir);
	snprintf(texture_path, sizeof(texture_path), "%s/m.fis.tex", dir);
	felt_write_model(model_path);
	return 0;
}

static int tear_down(void **state)
{
	unlink(path);
	unlink(model_path);
	unlink(texture_path);
	return rmdir(dir);
}

static struct incise_scene *load(const char *text, const char *model,
				 struct incise_error *err)
{
	FILE *out = fopen(path, "w");

	fputs(text, out);
	fclose(out);
	return incise_scene_load(path, model, err);
}

TEST(test_defaults)
{
	struct incise_scene *scene = load("model = \"m.fis\";\n", NULL, NULL);

	assert_non_null(scene);
	assert_true(incise_scene_rate_hz(scene) == 1000);
	assert_true(scene->fixed);
	assert_null(scene->surface);
	assert_true(scene->limits.force_N == 4 && scene->limits.slew_N_s == 400);
	assert_true(scene->limits.pose_age_ms == 50 && scene->limits.fade_ms == 20);
	assert_true(scene->limits.ramp_ms == 200 && scene->limits.start_N == 0.1);
	/* No force of paper 2's without being asked for. */
	assert_true(scene->tissue.gain == 1 && number(scene, "aligned") == 0.2);
	assert_true(number(scene, "reaction_N_mm") == 0 &&
		    number(scene, "plane_N_mm") == 0);
	assert_true(number(scene, "damping_N_s_mm") == 0);
	assert_true(number(scene, "insertion_N_mm") == 0 &&
		    number(scene, "spread_N_mm") == 0);
	assert_true(scene->tissue.leave_mm == 0.2);
	assert_true(scene->effects.average_ticks == 1);
	assert_true(scene->tool.side[1] == 1 && scene->tool.axis[2] == 1);
	assert_true(scene->tool.handle_mm == 120);
	assert_true(scene->device.mass_kg == 0.05 &&
		    scene->device.damping_N_s_mm == 0.01);
	assert_true(scene->device.coulomb_N == 0.01 && scene->device.encoder_mm == 0);
	assert_int_equal(scene->device.delay_ticks, -1);
	assert_false(scene->picture.wound || scene->picture.bleeding || scene->full);
	incise_scene_free(scene);
}

TEST(test_everything_set)
{
	struct incise_touch top;
	struct incise_scene *scene = load(
		"rate_hz = 2000; model = \"m.fis\"; arithmetic = \"double\";\n"
		"surface = { kind = \"plane\"; point_mm = [1, 2, 3]; normal = [0.0, 3.0, 4.0]; };\n"
		"limits = { force_N = 2.5; slew_N_s = 100; pose_age_ms = 20.0; };\n",
		NULL, NULL);

	assert_non_null(scene);
	assert_true(scene->rate_hz == 2000 && !scene->fixed);
	incise_surface_top(scene->surface, &top);
	assert_true(top.point_mm[2] == 3);
	/* The normal is made unit; 3-4-5, one rounding. */
	assert_true(fabs(top.normal[1] - 0.6) < 1e-15 &&
		    fabs(top.normal[2] - 0.8) < 1e-15);
	assert_true(scene->limits.force_N == 2.5 && scene->limits.slew_N_s == 100 &&
		    scene->limits.pose_age_ms == 20);
	incise_scene_free(scene);
}

/* Each key goes to its own place: no two values are alike. */
TEST(test_every_new_key)
{
	struct incise_scene *scene = load(
		"tissue = { gain = 0.5; reaction_N_mm = 0.11; plane_N_mm = 0.12;\n"
		"  damping_N_s_mm = 0.013; insertion_N_mm = 0.14; aligned = 0.15;\n"
		"  spread_N_mm = 0.16; leave_mm = 0.17; };\n"
		"effects = { average_ticks = 9; };\n"
		"tool = { side = [2, 0, 0]; axis = [0.0, 0.0, -3.0]; handle_mm = 90; };\n"
		"device = { mass_kg = 0.2; damping_N_s_mm = 0.021; coulomb_N = 0.22;\n"
		"  encoder_mm = 0.023; delay_ticks = 3; };\n"
		"limits = { fade_ms = 31; ramp_ms = 32; start_N = 0.33; };\n"
		"picture = { wound = true; bleeding = false; };\n",
		NULL, &err);

	succeeds(scene);
	assert_true(scene->tissue.gain == 0.5 && number(scene, "reaction_N_mm") == 0.11);
	assert_true(number(scene, "plane_N_mm") == 0.12);
	assert_true(number(scene, "damping_N_s_mm") == 0.013);
	assert_true(number(scene, "insertion_N_mm") == 0.14);
	assert_true(number(scene, "aligned") == 0.15 &&
		    number(scene, "spread_N_mm") == 0.16);
	assert_true(scene->tissue.leave_mm == 0.17);
	assert_true(scene->effects.average_ticks == 9);
	assert_true(scene->tool.side[0] == 1 && scene->tool.side[1] == 0);
	assert_true(scene->tool.axis[2] == -1 && scene->tool.handle_mm == 90);
	assert_true(scene->device.mass_kg == 0.2);
	assert_true(scene->device.damping_N_s_mm == 0.021);
	assert_true(scene->device.coulomb_N == 0.22 && scene->device.encoder_mm == 0.023);
	assert_int_equal(scene->device.delay_ticks, 3);
	assert_true(scene->limits.fade_ms == 31 && scene->limits.ramp_ms == 32);
	assert_true(scene->limits.start_N == 0.33);
	assert_true(scene->picture.wound && !scene->picture.bleeding);
	incise_scene_free(scene);
}

/* Whether a scene with this key is taken. */
static bool takes(const char *group, const char *key, const char *value,
		  struct incise_error *err)
{
	struct incise_scene *scene;
	char text[300];

	snprintf(text, sizeof(text),
		 *group ? "model = \"m.fis\";\n%s = {\n %s = %s; };\n"
			: "model = \"m.fis\";\n%s%s = %s;\n",
		 group, key, value);
	scene = load(text, NULL, err);
	incise_scene_free(scene);
	return scene;
}

/* Keys that there are not; one in another unit gets the right one. */
TEST(test_unknown_keys)
{
	static const struct {
		const char *group, *key, *says;
	} cases[] = {
		{"tissue", "reaction_N_m", "reaction_N_mm"},
		{"tissue", "plane_kN_m", "plane_N_mm"},
		{"tissue", "stiffness", "gain"},
		{"effects", "guarded", "average_ticks"},
		{"tool", "blade", "handle_mm"},
		{"device", "mass_g", "mass_kg"},
		{"device", "delay_ms", "delay_ticks"},
		{"limits", "pose_age_s", "pose_age_ms"},
		{"picture", "colour", "wound"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char name[60];

		snprintf(name, sizeof(name), "%s.%s", cases[i].group, cases[i].key);
		assert_error(takes(cases[i].group, cases[i].key, "1.0", &err), EINVAL,
			     &err, "a.scene:3", name, cases[i].says);
	}
}

/* Groups that are none. */
TEST(test_groups)
{
	static const char *const groups[] = {"tissue", "effects", "tool",   "device",
					     "limits", "picture", "surface"};
	static const char *const values[] = {"1.0", "\"soft\"", "[1.0]", "true"};

	for (size_t i = 0; i < sizeof(groups) / sizeof(*groups); i++) {
		for (size_t k = 0; k < sizeof(values) / sizeof(*values); k++) {
			assert_error(takes("", groups[i], values[k], &err), EINVAL, &err,
				     "a.scene:2", groups[i]);
		}
		/* With nothing in them they are as if they were not there. */
		assert_true(takes("", groups[i], "{ }", NULL));
	}
}

/* A scene whose second line is refused for this, or that is taken: NULL. */
struct text_case {
	const char *text, *says;
};

static void check_texts(const struct text_case *cases, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		struct incise_scene *scene;

		if (cases[i].says) {
			assert_error(load(cases[i].text, NULL, &err), EINVAL, &err,
				     "a.scene:2", cases[i].says);
			continue;
		}
		scene = load(cases[i].text, NULL, NULL);
		assert_non_null(scene);
		incise_scene_free(scene);
	}
}

#define MEMBRANE(point, thickness, wall)                                       \
	"tissue = { insertion_N_mm = 0.1; };\nmembrane = { " point             \
	"normal = [0.0, 0.0, 2.0]; radius_mm = 5.0; thickness_mm = " thickness \
	"; puncture_N = 0.5; back_wall_mm = " wall "; };\n"
#define POINT "point_mm = [1.0, 2.0, -8.0]; "

TEST(test_membrane)
{
	static const struct text_case cases[] = {
		{MEMBRANE(POINT, "4.0", "14.0"), NULL},
		{MEMBRANE("", "4.0", "14.0"), "point_mm"},
		{MEMBRANE(POINT, "14.0", "14.0"), "back_wall_mm"},
		{MEMBRANE(POINT, "0.0", "14.0"), "thickness_mm"},
		{MEMBRANE("point_mm = [1.0, 2.0]; ", "4.0", "14.0"), "point_mm"},
	};
	struct incise_scene_membrane membrane;
	struct incise_scene *scene;

	check_texts(cases, sizeof(cases) / sizeof(*cases));
	scene = load(MEMBRANE(POINT, "4.0", "14.0"), NULL, NULL);
	assert_true(incise_scene_membrane(scene, &membrane));
	assert_true(membrane.point_mm[2] == -8 && membrane.normal[2] == 1);
	assert_true(membrane.radius_mm == 5 && membrane.thickness_mm == 4);
	assert_true(membrane.puncture_N == 0.5 && membrane.back_wall_mm == 14);
	incise_scene_free(scene);
	scene = load("tissue = { insertion_N_mm = 0.1; };\n", NULL, NULL);
	assert_false(incise_scene_membrane(scene, &membrane));
	incise_scene_free(scene);
}

#define CRITERIA(text)                          \
	"tissue = { insertion_N_mm = 0.1; };\n" \
	"criteria = { " text " };\n"

TEST(test_criteria)
{
	static const struct text_case cases[] = {
		{CRITERIA(""), NULL},
		{CRITERIA("cut_length_mm = [20, 40];"), NULL},
		{CRITERIA("cut_length_mm = [20.0, 20.0];"), NULL},
		{CRITERIA("cut_length_mm = [40.0, 20.0];"), "cut_length_mm"},
		{CRITERIA("cut_length_mm = [20.0];"), "cut_length_mm"},
		{CRITERIA("cut_length_mm = 20.0;"), "cut_length_mm"},
		{CRITERIA("cut_depth_mm = [-1.0, 20.0];"), "cut_depth_mm"},
		{CRITERIA("insertion_depth_mm = [1.0, 2000.0];"), "1000"},
		{CRITERIA("force_most_N = -1.0;"), "force_most_N"},
		{CRITERIA("membrane = 1;"), "membrane"},
		{CRITERIA("back_wal = false;"), "back_wal"},
	};
	struct incise_scene_criterion to[INCISE_CRITERIA];
	struct incise_scene *scene;

	check_texts(cases, sizeof(cases) / sizeof(*cases));
	scene = load(CRITERIA("cut_depth_mm = [1.0, 9.0]; back_wall = false; "
			      "membrane = true; incisions_most = 1;"),
		     NULL, NULL);
	incise_scene_criteria(scene, to);
	for (int i = 0; i < INCISE_CRITERIA; i++)
		assert_true(to[i].asked == (i == INCISE_CRITERION_CUT_DEPTH ||
					    i == INCISE_CRITERION_BACK_WALL ||
					    i == INCISE_CRITERION_MEMBRANE ||
					    i == INCISE_CRITERION_INCISIONS));
	assert_true(to[INCISE_CRITERION_CUT_DEPTH].min == 1);
	assert_true(to[INCISE_CRITERION_CUT_DEPTH].max == 9);
	assert_true(to[INCISE_CRITERION_BACK_WALL].max == 0);
	assert_true(to[INCISE_CRITERION_MEMBRANE].min == 1);
	assert_true(to[INCISE_CRITERION_INCISIONS].max == 1);
	assert_null(incise_criterion_name(INCISE_CRITERIA));
	assert_string_equal(incise_criterion_name(INCISE_CRITERION_TIME), "time_most_s");
	incise_scene_free(scene);
}

/* Every byte of every file counts. */
TEST(test_checksum)
{
	uint32_t one, same, other;
	struct incise_scene *scene = load(CRITERIA(""), NULL, NULL);

	assert_int_equal(incise_scene_checksum(scene, &one, NULL), 0);
	assert_int_equal(incise_scene_checksum(scene, &same, NULL), 0);
	incise_scene_free(scene);
	scene = load(CRITERIA(" "), NULL, NULL);
	assert_int_equal(incise_scene_checksum(scene, &other, NULL), 0);
	assert_int_equal(one, same);
	assert_int_not_equal(one, other);
	incise_scene_free(scene);
}

/* One reaction, of the model or of a constant, and any force at all. */
TEST(test_forces)
{
	static const struct {
		const char *text;
		bool with_model;  /* given on the command line */
		const char *says; /* NULL: fine */
	} cases[] = {
		{"model = \"m.fis\"; tissue = { reaction_N_mm = 0.1; };", false,
		 "reaction"},
		{"tissue = { reaction_N_mm = 0.1; };", true, "reaction"},
		{"model = \"m.fis\"; tissue = { reaction_N_mm = 0.0; };", false, NULL},
		{"model = \"m.fis\"; tissue = { plane_N_mm = 0.1; };", false, NULL},
		{"# nothing\n", false, "no force"},
		{"tissue = { gain = 1.0; reaction_N_mm = 0.0; };", false, "no force"},
		{"tissue = { aligned = 0.5; leave_mm = 0.3; };", false, "no force"},
		{"effects = { average_ticks = 2; };", false, "no force"},
		{"# nothing\n", true, NULL},
		{"tissue = { reaction_N_mm = 0.1; };", false, NULL},
		{"tissue = { plane_N_mm = 0.1; };", false, NULL},
		{"tissue = { damping_N_s_mm = 0.1; };", false, NULL},
		{"tissue = { insertion_N_mm = 0.1; };", false, NULL},
		{"tissue = { spread_N_mm = 0.1; };", false, NULL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const char *model = cases[i].with_model ? model_path : NULL;
		struct incise_scene *scene;

		if (cases[i].says) {
			assert_error(load(cases[i].text, model, &err), EINVAL, &err,
				     cases[i].says);
			continue;
		}
		scene = load(cases[i].text, model, NULL);
		assert_non_null(scene);
		incise_scene_free(scene);
	}
}

/* By name, as the command line does. */
TEST(test_set_arithmetic)
{
	struct incise_scene *scene = load("model = \"m.fis\";", NULL, NULL);

	assert_int_equal(incise_scene_set_arithmetic(scene, "double", NULL), 0);
	assert_false(scene->fixed);
	assert_error(incise_scene_set_arithmetic(scene, "float", &err), EINVAL, &err,
		     "arithmetic", "float");
	assert_false(scene->fixed);
	assert_int_equal(incise_scene_set_arithmetic(scene, "fixed", NULL), 0);
	assert_true(scene->fixed);
	incise_scene_free(scene);
	incise_scene_free(NULL);
}

TEST(test_other_model)
{
	struct incise_scene *scene = load("model = \"absent.fis\";\n", model_path, NULL);

	assert_non_null(scene);
	incise_scene_free(scene);
	scene = load("# nothing\n", model_path, NULL);
	assert_non_null(scene);
	incise_scene_free(scene);
}

/* Each file that was read, so that no output takes its place. */
TEST(test_files)
{
	static const char text[] = "model = \"m.fis\";\n"
				   "surface = { kind = \"mesh\"; file = \"a.obj\"; };\n";
	struct incise_scene *scene;
	char mesh[80];
	FILE *out;

	snprintf(mesh, sizeof(mesh), "%s/a.obj", dir);
	out = fopen(mesh, "w");
	fputs("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", out);
	fclose(out);
	scene = load(text, NULL, NULL);
	assert_non_null(scene);
	assert_string_equal(incise_scene_file(scene, 0), path);
	assert_string_equal(incise_scene_file(scene, 1), model_path);
	assert_string_equal(incise_scene_file(scene, 2), mesh);
	assert_null(incise_scene_file(scene, 3));
	incise_scene_free(scene);
	unlink(mesh);
	scene = load("tissue = { reaction_N_mm = 0.1; };\n", NULL, NULL);
	assert_non_null(scene);
	assert_string_equal(incise_scene_file(scene, 0), path);
	assert_null(incise_scene_file(scene, 1));
	incise_scene_free(scene);
}

TEST(test_refusals)
{
	static const struct {
		const char *text;
		int code;
		const char *says[3];
	} cases[] = {
		{"model = \"absent.fis\";", ENOENT, {"absent.fis"}},
		{"\n", EINVAL, {"no force", "--model"}},
		{"model = \"m.fis\";\nrate = 5;", EINVAL, {"a.scene:2", "rate"}},
		{"model = \"m.fis\";\nrate_hz = 5;",
		 EINVAL,
		 {"a.scene:2", "100", "20000"}},
		{"model = \"m.fis\"; rate_hz = \"fast\";",
		 EINVAL,
		 {"a.scene:1", "rate_hz"}},
		{"model = \"m.fis\";\n\narithmetic = \"float\";",
		 EINVAL,
		 {"a.scene", "fixed", "double"}},
		{"model = \"m.fis\";\nlimits = { force_N = 1000.0; };",
		 EINVAL,
		 {"a.scene:2", "force_N", "100"}},
		{"model = \"m.fis\";\nlimits = { force = 1.0; };",
		 EINVAL,
		 {"a.scene:2", "force"}},
		{"model = \"m.fis\";\nsurface = { normal = [0.0, 0.0, 0.0]; };",
		 EINVAL,
		 {"a.scene:2", "normal"}},
		{"model = \"m.fis\"\nrate_hz = = 3;", EINVAL, {"a.scene:2"}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_error(load(cases[i].text, NULL, &err), cases[i].code, &err,
			     cases[i].says[0], cases[i].says[1], cases[i].says[2]);
	}
}

/* Inputs whose names are not all of a loop, once each, with depth_mm among them, at most four. */
TEST(test_inputs_of_a_model)
{
	static const struct {
		const char *inputs[5];
		const char *says; /* NULL: it is good */
	} cases[] = {
		{{"depth_mm"}, NULL},
		{{"velocity_mm_s", "depth_mm"}, NULL},
		{{"time_in_tissue_s", "tilt_deg", "depth_mm", "acceleration_mm_s2"},
		 NULL},
		{{"depth_mm", "pressure_Pa"}, "'pressure_Pa'"},
		{{"depth_mm", "velocity_mms"}, "velocity_mm_s"},
		{{"velocity_mm_s"}, "depth_mm"},
		{{"depth_mm", "tilt_deg", "tilt_deg"}, "tilt_deg twice"},
		{{"depth_mm", "velocity_mm_s", "acceleration_mm_s2", "tilt_deg",
		  "time_in_tissue_s"},
		 "5 inputs"},
	};
	static const struct incise_variable out = {"force_N", 0, 1};
	static const int mfs[] = {2, 2, 1, 1, 1};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_variable in[5];
		struct incise_model *model;
		struct incise_scene *scene;
		int n = 0;

		for (; n < 5 && cases[i].inputs[n]; n++) {
			in[n] = (struct incise_variable){.min = 0, .max = 1};
			strcpy(in[n].name, cases[i].inputs[n]);
		}
		model = incise_model_new_grid(n, in, mfs, INCISE_MF_GAUSS, &out, NULL);
		assert_int_equal(incise_model_save(model, model_path, NULL), 0);
		incise_model_free(model);
		if (cases[i].says) {
			assert_error(load("model = \"m.fis\";", NULL, &err), EINVAL, &err,
				     "a.scene:", cases[i].says);
			continue;
		}
		scene = load("model = \"m.fis\";", NULL, NULL);
		assert_non_null(scene);
		incise_scene_free(scene);
	}
	felt_write_model(model_path);
}

/* A file of a texture of this model, or of any, over this way. */
static void write_texture(const char *unit, bool of_model, double variation)
{
	struct incise_model *model = incise_model_load(model_path, &err);
	struct incise_texture texture = {.checksum =
						 incise_model_checksum(model) + !of_model,
					 .info = {.most = 0.5,
						  .variation = variation,
						  .up_to_cycles = 1,
						  .recorded.rate = 1,
						  .n_cuts = 5,
						  .length = 100},
					 .step = 0.25,
					 .n_curves = 2,
					 .n = {3, 2},
					 .point = {2000, 4000, -3000, 1000, -1000}};

	strcpy(texture.info.unit, unit);
	succeeds(!incise_texture_save(&texture, texture_path, &err));
	incise_model_free(model);
}

#define TEXTURE "model = { cut = \"m.fis\"; texture = \"m.fis.tex\"; };\n"
#define VARIES(share, seed) "tissue = { variation = " share "; seed = " seed "; };"

/* The same tables for the same seed; factors of cuts where they are asked for. */
TEST(test_texture)
{
	static const char *const texts[] = {TEXTURE VARIES("0.0", "7"),
					    TEXTURE VARIES("0.0", "7"),
					    TEXTURE VARIES("0.0", "8"),
					    TEXTURE VARIES("0.5", "7")};
	struct incise_scene *scene[4];

	write_texture("mm", true, 0.2);
	for (int i = 0; i < 4; i++) {
		scene[i] = load(texts[i], NULL, &err);
		succeeds(scene[i]);
		assert_true(incise_fixed_texture_good(scene[i]->texture));
		assert_string_equal(incise_scene_file(scene[i], 2), texture_path);
		for (int k = 0; k < INCISE_TEXTURE_CUTS && i < 3; k++)
			assert_int_equal(scene[i]->texture->factor[k], INCISE_FIXED_ONE);
	}
	assert_memory_equal(scene[0]->texture, scene[1]->texture,
			    sizeof(*scene[0]->texture));
	assert_memory_not_equal(scene[0]->texture->knot, scene[2]->texture->knot,
				sizeof(scene[0]->texture->knot));
	assert_true(scene[3]->texture->factor_most > INCISE_FIXED_ONE);
	incise_scene_leave_texture_out(scene[0]);
	assert_null(scene[0]->texture);
	assert_null(incise_scene_file(scene[0], 2));
	for (int i = 0; i < 4; i++)
		incise_scene_free(scene[i]);
	/* Another model takes its place, and has none. */
	scene[0] = load(TEXTURE VARIES("0.5", "7"), model_path, &err);
	succeeds(scene[0]);
	assert_null(scene[0]->texture);
	incise_scene_free(scene[0]);
}

TEST(test_no_texture)
{
	static const struct {
		const char *text, *unit;
		bool of_model;
		double variation;
		int code;
		const char *says;
	} cases[] = {
		{TEXTURE, "mm", false, 0.1, ESTALE, "m.fis.tex"},
		{TEXTURE, "deg", true, 0.1, EINVAL, "deg"},
		{TEXTURE VARIES("1.0", "1"), "mm", true, 0, EINVAL, "tissue.variation"},
		{TEXTURE VARIES("1.5", "1"), "mm", true, 0.1, EINVAL, "a.scene:2"},
		{TEXTURE VARIES("1.0", "-1"), "mm", true, 0.1, EINVAL, "a.scene:2"},
		{TEXTURE "tissue = { withdrawal = \"paper\"; };", "mm", true, 0.1, EINVAL,
		 "model.texture"},
		{"model = \"m.fis\";\n" VARIES("1.0", "1"), "mm", true, 0.1, EINVAL,
		 "tissue.variation"},
		{"model = { texture = \"m.fis.tex\"; };", "mm", true, 0.1, EINVAL, "cut"},
		{"model = { cut = \"m.fis\"; texture = 1; };", "mm", true, 0.1, EINVAL,
		 "model.texture"},
		{"model = { cut = \"m.fis\"; texture = \"\"; };", "mm", true, 0.1, EINVAL,
		 "model.texture"},
		{"model = { cut = \"m.fis\"; texture = \"m.fis\"; };", "mm", true, 0.1,
		 EINVAL, "m.fis"},
		{"model = { cut = \"m.fis\"; texture = \"n.tex\"; };", "mm", true, 0.1,
		 ENOENT, "n.tex"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		write_texture(cases[i].unit, cases[i].of_model, cases[i].variation);
		assert_error(load(cases[i].text, NULL, &err), cases[i].code, &err,
			     "a.scene", cases[i].says);
	}
}

GROUP(set_up, tear_down);
