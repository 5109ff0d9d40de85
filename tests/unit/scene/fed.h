/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Scenes in a folder of their own with a model and surfaces, and a hand that a test moves:
 * plans without a rig, fed with the poses of a tracker of 120 Hz that is 4.2 ms late.
 */
#ifndef INCISE_TEST_FED_H
#define INCISE_TEST_FED_H

#include <math.h>
#include "felt.h"

#define FED_LATENCY_NS 4200000
#define FED_PERIOD_NS 8333333

struct fed_folder {
	char dir[40], scene[64], model[64], fixed[64], mesh[64], heights[64];
};

/* A hill 4 mm high on 80 by 80 mm, its top at 0 0 0. */
static inline double fed_hill(double x, double y)
{
	return 2 * cos(x / 13) + 2 * cos(y / 13) - 4;
}

static inline void fed_write_mesh(const char *path)
{
	FILE *out = fopen(path, "w");

	for (int j = 0; j < 17; j++)
		for (int i = 0; i < 17; i++)
			fprintf(out, "v %d %d %.9f\n", 5 * i - 40, 5 * j - 40,
				fed_hill(5 * i - 40, 5 * j - 40));
	for (int j = 0; j < 16; j++)
		for (int i = 0; i < 16; i++)
			fprintf(out, "f %d %d %d %d\n", 17 * j + i + 1, 17 * j + i + 2,
				17 * j + i + 19, 17 * j + i + 18);
	fclose(out);
}

/* The same, as a height field: rows from the largest y. */
static inline void fed_write_heights(const char *path)
{
	FILE *out = fopen(path, "w");

	fprintf(out, "ncols 17\nnrows 17\nxllcenter -40\nyllcenter -40\ncellsize 5\n");
	for (int j = 16; j >= 0; j--)
		for (int i = 0; i < 17; i++)
			fprintf(out, "%.9f%c", fed_hill(5 * i - 40, 5 * j - 40),
				i == 16 ? '\n' : ' ');
	fclose(out);
}

static inline void fed_folder_make(struct fed_folder *f)
{
	strcpy(f->dir, "/tmp/incise-fed-XXXXXX");
	if (!mkdtemp(f->dir))
		abort();
	snprintf(f->scene, sizeof(f->scene), "%s/a.scene", f->dir);
	snprintf(f->model, sizeof(f->model), "%s/m.fis", f->dir);
	snprintf(f->mesh, sizeof(f->mesh), "%s/hill.obj", f->dir);
	snprintf(f->heights, sizeof(f->heights), "%s/hill.asc", f->dir);
	snprintf(f->fixed, sizeof(f->fixed), "%s/m.fx", f->dir);
	felt_write_model(f->model);
	felt_write_fixed(f->model, f->fixed);
	fed_write_mesh(f->mesh);
	fed_write_heights(f->heights);
}

static inline void fed_folder_remove(struct fed_folder *f)
{
	unlink(f->scene);
	unlink(f->model);
	unlink(f->fixed);
	unlink(f->mesh);
	unlink(f->heights);
	if (rmdir(f->dir))
		abort();
}

/* Of all tests of a file: its folder, and the tracker that feeds its plans. */
__attribute__((unused)) static struct fed_folder folder;
__attribute__((unused)) static const struct incise_tracker_info tracker = {
	.name = "fed", .rate_hz = 120, .latency_ns = FED_LATENCY_NS};

static inline int fed_set_up(void **state)
{
	fed_folder_make(&folder);
	return 0;
}

static inline int fed_tear_down(void **state)
{
	fed_folder_remove(&folder);
	return 0;
}

static inline struct incise_scene *fed_scene(struct fed_folder *f, const char *text,
					     struct incise_error *err)
{
	FILE *out = fopen(f->scene, "w");

	if (!out || fputs(text, out) < 0 || fclose(out))
		abort();
	return incise_scene_load(f->scene, NULL, err);
}

/*
 * The plan of such a scene, which the caller frees too. It is not checked to be stable: the search takes longer than the
 * ticks of a test, whose hand no force moves.
 */
static inline struct incise_plan *fed_plan(struct fed_folder *f,
					   const struct incise_tracker_info *tracker,
					   struct incise_scene **scene, const char *text)
{
	struct incise_error err = {0};
	struct incise_plan *plan;

	*scene = fed_scene(f, text, &err);
	if (*scene)
		(*scene)->unchecked = true;
	plan = *scene ? incise_plan_new_fed(*scene, tracker, &err) : NULL;
	if (!plan)
		fail_msg("%s", err.text);
	return plan;
}

/* Attitude: turned by @about_x, then by @about_z. */
static inline void fed_attitude(double q[4], double about_x, double about_z)
{
	double cx = cos(about_x / 2), sx = sin(about_x / 2);
	double cz = cos(about_z / 2), sz = sin(about_z / 2);

	q[0] = cz * cx;
	q[1] = cz * sx;
	q[2] = sz * sx;
	q[3] = sz * cx;
}

/* Where the hand holds the scalpel at a time: tip and attitude. */
typedef void fed_hand(void *own, double t_s, struct incise_tracker_sample *pose);

/* Feed the poses that arrived in the millisecond up to @t_ns, and tick. */
static inline int fed_tick(struct incise_plan *plan, int64_t t_ns, fed_hand *hand,
			   void *own, struct incise_tick *tick)
{
	int64_t arrival_ns = t_ns / FED_PERIOD_NS * FED_PERIOD_NS;
	struct incise_tracker_sample pose = {.t_ns = arrival_ns, .quaternion = {1}};

	if (hand && t_ns - arrival_ns < 1000000) {
		hand(own, (double)(arrival_ns - FED_LATENCY_NS) * 1e-9, &pose);
		if (incise_plan_feed(plan, &pose, 1) != 1)
			abort();
	}
	return incise_plan_tick(plan, t_ns, tick);
}

#endif
