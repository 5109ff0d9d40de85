// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Files from outside with broken bytes: each is refused with one line, or works.
 */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/budget.h>
#include <incise/calibration.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/plan.h>
#include <incise/capture.h>
#include <incise/recording.h>
#include <incise/rig.h>
#include "../../lib/base/vector.h"
#include "../../lib/scene/scene.h"
#include "../../lib/surface/surface.h"
#include "../../tools/cli/cli.h"
#include "../../tools/cli/file.h"
#include "../../tools/cli/folder.h"
#include "../unit/model/every_kind.h"
#include "extremes.h"
#include "ground.h"
#include "numbers.h"

#define SIZE_MAX_BYTES (1 << 20)

/* A file, whole, and the one that is broken each time. */
struct bytes {
	char *whole, *broken;
	size_t n, n_broken;
};

/* A kind of file: it is written, and tried. */
struct file_kind {
	void (*write)(FILE *out);
	/* Load @path and try it: 0 it works; 1 refused, with @err; -1 wrong. */
	int (*load)(const char *path, struct incise_error *err);
};

/* ---- trying what was loaded ---- */

/* Down through where most surfaces are. */
static bool runs(struct incise_plan *plan)
{
	for (int i = 1; i <= 50; i++) {
		struct incise_tracker_sample s = {.t_ns = i * INT64_C(1000000),
						  .position_mm = {0, 0, 25 - i},
						  .quaternion = {1},
						  .status = ' '};
		struct incise_tick t;

		if (incise_plan_feed(plan, &s, 1) != 1 ||
		    incise_plan_tick(plan, s.t_ns, &t) ||
		    t.flags & INCISE_TICK_NOT_FINITE || !v3_finite(t.position_mm) ||
		    !v3_finite(t.tool_mm) || !v3_finite(t.proxy_mm) ||
		    !v3_finite(t.normal) || !v3_finite(t.command_N) ||
		    !isfinite(t.depth_mm) || !isfinite(t.velocity_mm_s))
			return false;
	}
	return true;
}

/* Whether it is stable is @asked. */
static int load_plan(const char *path, bool asked, struct incise_error *err)
{
	struct incise_scene *scene = incise_scene_load(path, NULL, err);
	int rc = scene || errno == err->code ? 1 : -1;
	struct incise_plan *plan;

	if (scene)
		scene->unchecked = !asked;
	plan = scene ? incise_plan_new(scene, NULL, err) : NULL;
	if (plan)
		rc = runs(plan) ? 0 : -1;
	incise_plan_free(plan);
	incise_scene_free(scene);
	return rc;
}

static int load_scene(const char *path, struct incise_error *err)
{
	return load_plan(path, true, err);
}

static int load_fis(const char *path, struct incise_error *err)
{
	struct incise_model *model = incise_model_load(path, err);
	int rc = model ? 0 : 1;

	for (int i = 0; model && i < 20; i++) {
		double x[INCISE_MODEL_INPUTS_MAX];

		for (int k = 0; k < INCISE_MODEL_INPUTS_MAX; k++)
			x[k] = special();
		if (!isfinite(incise_model_eval(model, x, NULL)))
			rc = -1;
	}
	incise_model_free(model);
	return rc;
}

static int load_fx(const char *path, struct incise_error *err)
{
	struct incise_fixed *fx = incise_fixed_load(path, err);
	int rc = fx ? 0 : 1;

	for (int i = 0; fx && i < 20; i++) {
		double x[INCISE_FIXED_INPUTS_MAX] = {special(), special()};

		if (!isfinite(incise_fixed_eval_double(fx, x)))
			rc = -1;
	}
	incise_fixed_free(fx);
	return rc;
}

static int try_surface(struct incise_surface *surface)
{
	int rc = surface ? 0 : 1;

	for (int i = 0; surface && i < 10; i++) {
		double p[3] = {between(-90, 90), between(-90, 90), between(-90, 90)};
		struct incise_touch touch;

		incise_surface_nearest(surface, p, &touch);
		if (!isfinite(touch.depth_mm) || !v3_finite(touch.normal) ||
		    !v3_finite(touch.point_mm))
			rc = -1;
		incise_surface_top(surface, &touch);
		if (!v3_finite(touch.point_mm) || !v3_finite(touch.normal))
			rc = -1;
	}
	incise_surface_free(surface);
	return rc;
}

static int load_mesh(const char *path, struct incise_error *err)
{
	return try_surface(incise_surface_load_mesh(path, (double[3]){0}, false, err));
}

static int load_heights(const char *path, struct incise_error *err)
{
	return try_surface(incise_surface_load_heights(path, (double[3]){0}, err));
}

static int load_rig(const char *path, struct incise_error *err)
{
	struct incise_rig *rig = incise_rig_open(path, INCISE_RIG_TRACKER, err);

	incise_rig_close(rig);
	return rig ? 0 : 1;
}

static int load_calibration(const char *path, struct incise_error *err)
{
	struct incise_calibration calibration;

	return incise_calibration_load(path, &calibration, err) ? 1 : 0;
}

/* ---- whole files ---- */

static void write_scene(FILE *out)
{
	fputs("rate_hz = 1000.0;\narithmetic = \"double\";\n"
	      "surface = { kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0];\n"
	      "  to_mm = [160.0, 0.0, -55.0]; radius_mm = 55.0; };\n"
	      "tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.17; damping_N_s_mm = 0.0005;\n"
	      "  insertion_N_mm = 0.28; aligned = 0.2; spread_N_mm = 0.22; leave_mm = 0.3; "
	      "};\n"
	      "effects = { average_ticks = 8; };\ntool = { handle_mm = 120.0; };\n"
	      "device = { mass_kg = 0.05; coulomb_N = 0.1; delay_ticks = 3; };\n"
	      "limits = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };\n",
	      out);
}

static void write_fx(FILE *out)
{
	struct memory_file force = memory_file_begin("model");
	struct incise_error err = {0};
	struct incise_fixed *fx;
	struct incise_model *model;

	ground_write_model(force.file);
	memory_file_written(&force);
	model = incise_model_load(force.path, &err);
	fx = model ? incise_fixed_compile(model, NULL, &err) : NULL;
	if (!fx)
		cli_fail_with(&err);
	fwrite(fx->blob, 1, fx->size, out);
	incise_fixed_free(fx);
	incise_model_free(model);
	fclose(force.file);
}

static void write_mesh(FILE *out)
{
	fputs("# a box without a lid\nv -50 -50 0\nv 50 -50 0\nv 50 50 1\nv -50 50 0\n"
	      "v -50 -50 -9\nv 50 -50 -9\nv 50 50 -9\nv -50 50 -9\nvt 0 0\nvt 1 0\nvt 1 1\n"
	      "f 1/1 2/2 3/3\nf 1/1 3/3 4/1\nf 5 6 2 1\nf 6 7 3 2\nf 7 8 4 3\nf 8 5 1 4\n",
	      out);
}

/* Forms of a face that the box does without. */
static void write_roof(FILE *out)
{
	fputs("# a roof\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.5\nv -1 0.5 -2e-1\n"
	      "vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n"
	      "f 1/1/1 2/2/1 4/3/1 3/1/1\nf -5/1 -3/2 -1/3\n",
	      out);
}

static void write_every_kind(FILE *out)
{
	fputs(every_kind, out);
}

static void write_heights(FILE *out)
{
	fputs("ncols 3\nnrows 3\nxllcenter -9\nyllcenter -9\ncellsize 18\nNODATA_value -9999\n"
	      "0 1 0\n0.5 1e-3 2\n0 0 -0.25\n",
	      out);
}

static void write_rig(FILE *out)
{
	fputs("clock = \"simulated\";\ntracker = \"sim:\";\n"
	      "surface = { point_mm = [0.0, 0.0, 0.0]; normal = [0.0, 0.0, 1.0]; };\n"
	      "tracker_setup = { hemisphere = [1.0, 0.0, 0.0]; };\n"
	      "sim = { seed = 1; cut_s = 8.0; depth_mm = [5.0, 10.0]; times = [3, 4];\n"
	      "  tracker_hz = 120.0; tooth = 0.2; };\n",
	      out);
}

static void write_calibration(FILE *out)
{
	fputs("force_mV_N = 1240.0;\nforce_zero_mV = 180.0;\ndepth_mm_px = 0.11875;\n"
	      "tracker_delay_ms = 4.2;\ntracker_delay_sd_ms = 0.1;\ntip_mm = [0.1, 0.0, -2.0];\n"
	      "stepper_N_step = 0.00125;\nstepper_backlash_mm = 0.01;\nsurface_u_mm = 0.05;\n"
	      "history = ( { kind = \"tip\"; date = \"2026-11-20T10:00:00Z\"; pass = true;\n"
	      "  values = ( { key = \"tip_x_mm\"; left = 0.1; u = 0.03; },\n"
	      "  { key = \"tip_y_mm\"; left = 0.0; u = 0.02; },\n"
	      "  { key = \"tip_z_mm\"; left = -2.0; u = 0.04; } );\n"
	      "  covariance = [ 9e-4, 3e-4, 4e-4, -2e-4, 1e-4, 16e-4 ]; } );\n",
	      out);
}

/* ---- breaking ---- */

static struct bytes take(void (*write)(FILE *out))
{
	struct bytes bytes = {0};
	FILE *out = open_memstream(&bytes.whole, &bytes.n);

	if (!out)
		cli_fail("no memory");
	write(out);
	if (fclose(out) || bytes.n > SIZE_MAX_BYTES)
		cli_fail("a file of %zu bytes is too large to be broken", bytes.n);
	bytes.broken = malloc(2 * bytes.n + 64);
	if (!bytes.broken)
		cli_fail("no memory");
	return bytes;
}

static bool is_number(char c)
{
	return (c >= '0' && c <= '9') || c == '.' || c == '-';
}

/* The number at or after a place becomes another value, which leaves the syntax whole more often. */
static size_t replace_number(struct bytes *bytes, size_t n, size_t from,
			     const char *value)
{
	size_t size = strlen(value), to;

	while (from < n && !is_number(bytes->broken[from]))
		from++;
	for (to = from; to < n && is_number(bytes->broken[to]);)
		to++;
	if (n - (to - from) + size > 2 * bytes->n)
		return n;
	memmove(bytes->broken + from + size, bytes->broken + to, n - to);
	memcpy(bytes->broken + from, value, size);
	return n - (to - from) + size;
}

/* Flipped bits, other bytes, a stretch that is gone, twice there, or cut off; numbers. */
static void break_bytes(struct bytes *bytes)
{
	static const char *const bits[] = {
		"1e999",      "-1e308",	   "nan",	   "-1",
		"0",	      "1e-320",	   "2147483648",   "\"\"",
		"[",	      "}",	   "/*",	   "\n",
		"0.5",	      "20.0",	   "[1.0, 2.0]",   "\"fixed\"",
		"\"double\"", "\"plane\"", "\"liver.fis\""};
	size_t n = bytes->n, from, many;

	memcpy(bytes->broken, bytes->whole, n);
	for (uint32_t k = 1 + (below(2) ? 0 : below(4)); k && n > 40; k--) {
		const char *bit = bits[below(sizeof(bits) / sizeof(*bits))];

		from = below((uint32_t)n - 20);
		many = below(20);
		switch (below(7)) {
		case 0:
			bytes->broken[from] = (char)any();
			break;
		case 1:
			memmove(bytes->broken + from, bytes->broken + from + many,
				n - from - many);
			n -= many;
			break;
		case 2:
			if (n + many > 2 * bytes->n)
				break;
			memmove(bytes->broken + from + many, bytes->broken + from,
				n - from);
			n += many;
			break;
		case 3:
			memcpy(bytes->broken + from, bit, strlen(bit));
			break;
		case 4:
			n = replace_number(bytes, n, from, bit);
			break;
		default:
			bytes->broken[from] ^= (char)(1 << below(8));
		}
	}
	bytes->n_broken = below(20) ? n : below((uint32_t)n);
}

/* @path: of the file, which a refusal names; or NULL. */
static void judge(struct extremes_row *row, int rc, const char *path,
		  const struct incise_error *err)
{
	if (rc != 1)
		extremes_check(row, !rc, "loaded, and does not work");
	else if (path && !strstr(err->text, path))
		extremes_check(row, false, "does not name the file: %s", err->text);
	else
		extremes_refused(row, err);
}

static void try_file(struct extremes_row *row, const struct property *property)
{
	const struct file_kind *kind = property->of;
	struct bytes bytes = take(kind->write);

	for (long k = extremes_cases(row, property->cases); k >= 0; k--) {
		struct memory_file file = memory_file_begin("broken");
		struct incise_error err = {0};
		bool whole = !row->tried;
		int rc;

		break_bytes(&bytes);
		/* The first one is whole. */
		fwrite(whole ? bytes.whole : bytes.broken, 1,
		       whole ? bytes.n : bytes.n_broken, file.file);
		memory_file_written(&file);
		rc = kind->load(file.path, &err);
		if (whole && rc == 1)
			cli_fail("%s is refused although it is whole: %s", row->name,
				 err.text);
		judge(row, rc, file.path, &err);
		fclose(file.file);
	}
	free(bytes.whole);
	free(bytes.broken);
}

/* ---- files in a folder ---- */

static int read_whole(const char *path, char *to, size_t most, size_t *n,
		      struct incise_error *err)
{
	FILE *file = fopen(path, "r");

	if (!file)
		return incise_error_set(err, errno, "%s: %s", path, strerror(errno));
	*n = fread(to, 1, most, file);
	fclose(file);
	return 0;
}

static int write_whole(const char *path, const void *bytes, size_t n,
		       struct incise_error *err)
{
	FILE *file = fopen(path, "w");
	bool written = file && fwrite(bytes, 1, n, file) == n;

	if (file && fclose(file))
		written = false;
	return written ? 0
		       : incise_error_set(err, errno, "%s: %s", path, strerror(errno));
}

/* ---- recordings ---- */

static int record(const char *path, const char *calibration_path,
		  struct incise_error *err)
{
	struct incise_calibration calibration;
	struct incise_capture_options options = {.duration_s = 1};
	struct incise_capture_result result;
	struct incise_rig *rig =
		incise_rig_open("sim:clock=simulated,times=1,cut_s=0.5,pause_s=0.6,"
				"force_hz=1000",
				INCISE_RIG_TRACKER | INCISE_RIG_FORCE, err);
	int rc = -1;

	options.recorder.calibration = &calibration;
	options.recorder.calibration_path = calibration_path;
	if (rig && !incise_calibration_load(calibration_path, &calibration, err))
		rc = incise_capture_run(path, rig, &options, &result, err);
	incise_rig_close(rig);
	return rc ? -1 : 0;
}

/* 0: each part is a number or not stated, and own ones are not negative; else as @load. */
static int try_budget(struct incise_recording *recording, struct incise_error *err)
{
	const struct incise_budget_row row = {.force_N = 1,
					      .depth_rate_mm_s = 10,
					      .acceleration_mm_s2 = 100,
					      .direction = {1, 0, 0},
					      .tip = {0, 0.1, -1},
					      .tip_1_s = {0.1, 0, 0},
					      .share = 0.5,
					      .force_share = 1};
	struct incise_budget *budget = incise_budget_new(recording, NULL, NULL, err);
	double part[INCISE_BUDGET_PARTS];
	int rc = budget ? 0 : 1;

	if (budget)
		incise_budget_row(budget, &row, part);
	for (int i = 0; i < INCISE_BUDGET_PARTS && budget; i++)
		if (incise_budget_parts()[i].scope == INCISE_BUDGET_OWN && part[i] < 0)
			rc = -1;
	incise_budget_free(budget);
	return rc;
}

static int open_recording(const char *path, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open(path, err);
	struct incise_recording_value *values = NULL;
	struct incise_tracker_sample *poses = NULL;
	struct incise_recording_info info;
	int rc = recording ? incise_recording_info(recording, &info, err) : -1;

	if (!rc && incise_recording_values(recording, "force", &values, err) < 0)
		rc = -1;
	if (!rc && incise_recording_poses(recording, &poses, err) < 0)
		rc = -1;
	free(values);
	free(poses);
	rc = rc ? 1 : try_budget(recording, err);
	incise_recording_close(recording);
	return rc;
}

static void try_recordings(struct extremes_row *row, const struct property *property)
{
	char folder[PATH_MAX - 80], path[PATH_MAX - 60], database[PATH_MAX];
	struct incise_error failed = {0};
	struct bytes bytes = {.whole = malloc(SIZE_MAX_BYTES),
			      .broken = malloc(2 * SIZE_MAX_BYTES + 64)};
	struct bytes calibration;
	int rc;

	if (!bytes.whole || !bytes.broken)
		cli_fail("no memory");
	/* An interrupted run removes the folder, too. */
	cli_catch_signals();
	folder_make(folder, sizeof(folder), "for a recording");
	snprintf(path, sizeof(path), "%s/a.rec", folder);
	snprintf(database, sizeof(database), "%s/calibration.conf", folder);
	calibration = take(write_calibration);
	rc = write_whole(database, calibration.whole, calibration.n, &failed);
	free(calibration.whole);
	free(calibration.broken);
	if (!rc)
		rc = record(path, database, &failed);
	snprintf(database, sizeof(database), "%s/recording.db", path);
	if (!rc)
		rc = read_whole(database, bytes.whole, SIZE_MAX_BYTES, &bytes.n, &failed);
	for (long k = extremes_cases(row, property->cases); k && !rc && !cli_stop; k--) {
		struct incise_error err = {0};

		break_bytes(&bytes);
		rc = write_whole(database, bytes.broken, bytes.n_broken, &failed);
		if (!rc)
			judge(row, open_recording(path, &err), NULL, &err);
	}
	folder_remove(folder);
	if (rc)
		cli_fail_with(&failed);
	free(bytes.whole);
	free(bytes.broken);
}

/* ---- scenes with files beside them ---- */

#define MODELS 6 /* plans with a model of each scene: compiling one takes some 20 ms */

/* Whole scenes; no shipped one has heights or a mesh. */
static const struct {
	const char *shipped; /* NULL: @text */
	const char *text;
} scenes[] = {
	{"liver", NULL},
	{"neck", NULL},
	{"wall", NULL},
	{NULL,
	 "model = \"liver.fis\"; arithmetic = \"double\";\n"
	 "surface = { kind = \"mesh\"; file = \"s.obj\"; at_mm = [1.0, 2.0, 3.0]; };\n"
	 "tool = { side = [0.0, 1.0, 0.0]; axis = [0.0, 0.0, 1.0]; handle_mm = 99.0; };\n"
	 "device = { mass_kg = 0.1; damping_N_s_mm = 0.01; delay_ticks = 3;\n"
	 "  coulomb_N = 0.1; encoder_mm = 0.01; };\n"
	 "limits = { start_N = 0.2; ramp_ms = 100.0; fade_ms = 10.0; };\n"},
	{NULL,
	 "surface = { kind = \"heights\"; file = \"s.asc\"; at_mm = [0.0, 0.0, 0.0]; };\n"
	 "tissue = { gain = 0.5; reaction_N_mm = 0.2; leave_mm = 0.3; };\n"
	 "effects = { average_ticks = 64; };\nlimits = { fade_ms = 30.0; };\n"},
	{NULL,
	 "surface = { kind = \"sphere\"; centre_mm = [0.0, 0.0, -9.0]; radius_mm = 9.0; "
	 "};\n"
	 "tissue = { spread_N_mm = 0.1; insertion_N_mm = 0.1; aligned = 0.5; };\n"},
};
#define SCENES (sizeof(scenes) / sizeof(*scenes))

struct mutants {
	struct extremes_row *row;
	char folder[PATH_MAX - 80], path[PATH_MAX - 60];
	struct bytes whole[SCENES];
	int loaded, planned, models; /* of a scene */
};

static void write_in(const struct mutants *m, const char *name, void (*write)(FILE *out))
{
	struct incise_error err = {0};
	struct bytes bytes = take(write);
	char path[PATH_MAX];

	snprintf(path, sizeof(path), "%s/%s", m->folder, name);
	if (write_whole(path, bytes.whole, bytes.n, &err))
		cli_fail_with(&err);
	free(bytes.whole);
	free(bytes.broken);
}

/* The files that a shipped scene reads: a texture is of one model alone. */
static void copy_in(const struct mutants *m, const char *name)
{
	struct incise_error err = {0};
	char *bytes = malloc(SIZE_MAX_BYTES), path[PATH_MAX];
	size_t n = 0;

	if (!bytes)
		cli_fail("no memory");
	snprintf(path, sizeof(path), "%s/%s", m->row->setup->scenes, name);
	if (read_whole(path, bytes, SIZE_MAX_BYTES, &n, &err))
		cli_fail_with(&err);
	snprintf(path, sizeof(path), "%s/%s", m->folder, name);
	if (write_whole(path, bytes, n, &err))
		cli_fail_with(&err);
	free(bytes);
}

static void take_whole(struct mutants *m)
{
	struct incise_error err = {0};

	for (size_t k = 0; k < SCENES; k++) {
		struct bytes *scene = &m->whole[k];
		char path[PATH_MAX];

		scene->whole = calloc(1, SIZE_MAX_BYTES);
		scene->broken = calloc(1, 2 * SIZE_MAX_BYTES + 64);
		if (!scene->whole || !scene->broken)
			cli_fail("no memory");
		snprintf(path, sizeof(path), "%s/%s.scene", m->row->setup->scenes,
			 scenes[k].shipped);
		if (!scenes[k].shipped)
			scene->n = strlen(strcpy(scene->whole, scenes[k].text));
		else if (read_whole(path, scene->whole, SIZE_MAX_BYTES, &scene->n, &err))
			cli_fail_with(&err);
	}
}

static void try_mutant(struct mutants *m, const char *text, size_t n)
{
	struct incise_error err = {0};
	struct incise_scene *scene;

	if (write_whole(m->path, text, n, &err))
		cli_fail_with(&err);
	scene = incise_scene_load(m->path, NULL, &err);
	m->loaded += !!scene;
	if (!scene || !scene->cut[INCISE_CUT].model || m->models++ < MODELS) {
		/* The search takes longer than all else: of a part each fourth is asked, the whole one first. */
		bool asked = m->row->setup->part == 1 || m->loaded % 4 == 1;
		int rc = load_plan(m->path, asked, &err);

		m->planned += !rc;
		judge(m->row, rc, m->path, &err);
	}
	incise_scene_free(scene);
}

static void try_mutants(struct extremes_row *row, const struct property *property)
{
	struct mutants *m = calloc(1, sizeof(*m));
	int n = (int)extremes_cases(row, property->cases);

	if (!m)
		cli_fail("no memory");
	m->row = row;
	folder_make(m->folder, sizeof(m->folder), "for scenes");
	snprintf(m->path, sizeof(m->path), "%s/x.scene", m->folder);
	copy_in(m, "liver.fis");
	copy_in(m, "liver.fis.tex");
	write_in(m, "s.obj", write_mesh);
	write_in(m, "s.asc", write_heights);
	take_whole(m);
	for (size_t k = 0; k < SCENES; k++) {
		struct bytes *scene = &m->whole[k];

		m->loaded = m->planned = m->models = 0;
		/* The first one is whole. */
		try_mutant(m, scene->whole, scene->n);
		extremes_check(row, m->planned == 1, "scene %zu is refused", k);
		for (int i = 0; i < n; i++) {
			break_bytes(scene);
			try_mutant(m, scene->broken, scene->n_broken);
		}
		/* Both ways are walked, many times; few mutants make few plans. */
		extremes_check(row,
			       m->loaded > n / 50 && m->loaded < n * 49 / 50 &&
				       (n < 500 || m->planned >= MODELS),
			       "scene %zu: %d of %d loaded, %d made a plan", k, m->loaded,
			       n, m->planned);
		free(scene->whole);
		free(scene->broken);
	}
	folder_remove(m->folder);
	free(m);
}

#define BYTES(name, what, cases, write, load)                                       \
	{                                                                           \
		name, what, cases, .all = try_file, .of = &(const struct file_kind) \
		{                                                                   \
			write, load                                                 \
		}                                                                   \
	}
#define BYTES_OF_TESTS(name, write, load)                                        \
	{                                                                        \
		name, "the same", 3000, .all = try_file, .for_tests_only = true, \
					.of = &(const struct file_kind)          \
		{                                                                \
			write, load                                              \
		}                                                                \
	}

const struct property file_properties[] = {
	BYTES("scene_bytes",
	      "a scene with broken bytes: refused with one line, or its plan's ticks are "
	      "finite",
	      6000, write_scene, load_scene),
	BYTES("fis_bytes",
	      "a .fis with broken bytes: refused with one line, or finite at any inputs",
	      40000, ground_write_model, load_fis),
	BYTES_OF_TESTS("fis_bytes_every_kind", write_every_kind, load_fis),
	BYTES("fx_bytes", "a .fx with broken bytes: refused with one line", 20000,
	      write_fx, load_fx),
	BYTES("mesh_bytes",
	      "an OBJ with broken bytes: refused with one line, or its nearest points are "
	      "finite",
	      20000, write_mesh, load_mesh),
	BYTES_OF_TESTS("mesh_bytes_roof", write_roof, load_mesh),
	BYTES("heights_bytes", "the same of an ESRI ASCII grid", 20000, write_heights,
	      load_heights),
	BYTES("rig_bytes",
	      "a rig.conf of a virtual rig with broken bytes: refused with one line, or "
	      "opened",
	      10000, write_rig, load_rig),
	BYTES("calibration_bytes",
	      "a calibration.conf with broken bytes: refused with one line, or read",
	      10000, write_calibration, load_calibration),
	{"recording_bytes",
	 "a recording whose database has broken bytes: refused with one line, or read",
	 2000, .all = try_recordings},
	{"scene_mutants", "the same of scenes with files beside them", 2000,
	 .all = try_mutants, .for_tests_only = true},
	{0},
};
