// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench view [SCENE]: the time of a frame, by sizes of the texture and of the frame, and how far
 * what a screen shows is from the frame of that very moment. It is a program of its own, as it maps
 * libraries that draw, which other benchmarks do not.
 */
#include <stdio.h>
#include <stdlib.h>
#include <incise/loop.h>
#include <incise/plan.h>
#include <incise/scene.h>
#include <incise/view.h>
#include "cli/cli.h"
#include "cli/file.h"
#include "cli/scene_argument.h"
#include "cli/stopwatch.h"
#include "bench/bench.h"
#include "session/procedure.h"

/*
 * --- ticks of the scripted procedure that are kept in memory, and views without a screen that get
 * them: drawing is measured without the loop ---
 */

/* Ticks of the procedure, from a loop in simulated time. */
struct view_script {
	const char *scene; /* path */
	struct incise_tick *tick;
	int n;
};

/* A view without a screen that gets such ticks: drawing is timed without the loop. */
struct fed_view {
	const struct view_script *script;
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct incise_view *view;
	int fed; /* ticks so far */
};

struct bench_view_run {
	struct incise_scene *scene;
	struct incise_rig *rig;
	struct incise_plan *plan;
	struct procedure procedure;
};

static int ticked(void *context, const struct incise_tick *tick)
{
	procedure_ticked(context, tick);
	return 0;
}

static void open_run(struct bench_view_run *run, const char *path)
{
	struct incise_error err = {0};

	*run = (struct bench_view_run){.scene = incise_scene_load(path, NULL, &err)};
	if (run->scene)
		run->rig = incise_rig_open(PROCEDURE_RIG, INCISE_RIG_TRACKER, &err);
	if (run->rig)
		run->plan = incise_plan_new(run->scene, run->rig, &err);
	cli_require(run->plan, &err);
	procedure_begin(&run->procedure, run->rig, run->plan, run->scene);
}

/* Run the first @seconds of the procedure; fails the program. */
static void view_script_begin(struct view_script *script, const char *scene,
			      double seconds)
{
	struct incise_loop_stats *stats = malloc(sizeof(*stats));
	struct incise_loop_options loop = {.ticked = ticked};
	struct incise_error err = {0};
	struct bench_view_run run;

	open_run(&run, scene);
	loop.context = &run.procedure;
	loop.rate_hz = incise_scene_rate_hz(run.scene);
	loop.duration_ns = (int64_t)(seconds * INCISE_NS_PER_S);
	loop.log_size = (size_t)(seconds * loop.rate_hz) + 2;
	loop.log = calloc(loop.log_size, sizeof(*loop.log));
	if (!stats || !loop.log)
		cli_fail("not enough memory for %.3g s of ticks; give a shorter "
			 "--duration",
			 seconds);
	cli_check(incise_loop_run(run.plan, incise_rig_clock(run.rig), &loop, stats,
				  &err) < 0,
		  &err);
	*script = (struct view_script){
		.scene = scene, .tick = loop.log, .n = (int)stats->logged};
	free(stats);
	incise_plan_free(run.plan);
	incise_rig_close(run.rig);
	incise_scene_free(run.scene);
}

static void view_script_end(struct view_script *script)
{
	free(script->tick);
	*script = (struct view_script){0};
}

/*
 * @texture_px: of the texture, or 0 for the scene's own. @live: as of struct incise_view_setup. Fails
 * the program.
 */
static void fed_view_open(struct fed_view *fed, const struct view_script *script,
			  int texture_px, int width, int height, bool live)
{
	const struct incise_view_setup setup = {
		.width = width, .height = height, .live = live};
	struct incise_error err = {0};

	*fed = (struct fed_view){.script = script,
				 .scene = incise_scene_load(script->scene, NULL, &err)};
	if (fed->scene && texture_px)
		incise_scene_set_texture(fed->scene, texture_px);
	if (fed->scene)
		fed->plan = incise_plan_new(fed->scene, NULL, &err);
	if (fed->plan)
		fed->view = incise_view_new(fed->scene, fed->plan, &setup, &err);
	cli_require(fed->view, &err);
}

/* Give the view all ticks up to a time since the first; times ascend. */
static void fed_view_until(struct fed_view *fed, double t_s)
{
	const struct view_script *script = fed->script;
	int64_t until_ns = script->tick[0].t_ns + (int64_t)(t_s * INCISE_NS_PER_S);
	int n = fed->fed;

	while (n < script->n && script->tick[n].t_ns <= until_ns)
		n++;
	incise_view_ticks(fed->view, script->tick + fed->fed, n - fed->fed);
	fed->fed = n;
}

/* Draw; fails the program. */
static void fed_view_frame(struct fed_view *fed)
{
	struct incise_error err = {0};

	cli_check(incise_view_frame(fed->view, NULL, &err), &err);
}

static void fed_view_close(struct fed_view *fed)
{
	incise_view_free(fed->view);
	incise_plan_free(fed->plan);
	incise_scene_free(fed->scene);
}

#define UNTIL_S 14.0 /* of the procedure: cut, bleeding, enlarging */
#define QUICK_UNTIL_S 1.5
#define ERROR_UNTIL_S 8.0
#define QUICK_ERROR_UNTIL_S 2.5

/* The script bleeds from its first second to its end. */
#define FRAMES_FROM_S 1.0

/* --- the time of a frame ---
 *
 * Frames come at 60 a second of the ticks' time, as fast as they can, and are finished before the
 * next one starts; so many in a row from time to time, and the one before them is not timed.
 *
 *   procedure  ├────────────────────────────────────────┤
 *   frames     ·||||||      ·||||||      ·||||||
 */

#define FPS 60
#define IN_A_ROW 18
#define EVERY_S 1.3
#define PARTS 12

/* The visual rate of paper 1, section 5 ("visual rendering (50Hz)"). */
#define PAPER_HZ 50.0

/* Times of the frames of a run, ms; and the share of frames within a period of that rate, %. */
struct frame_times {
	double median, p99, max, in_time;
};

struct frame_row {
	int texture_px, width, height, triangles, samples, frames;
	struct frame_times ticks; /* wound and blood */
	struct frame_times texture, draw, whole;
	struct harness_time time; /* of a whole frame */
	double hz;		  /* of whole frames one after the other */
	double texels;		  /* sent to the graphics, of a frame */
	double tick_us;		  /* of the first, per tick */
};

/* Texture, width, height. */
static const int sizes[][3] = {{2048, 1280, 720}, {512, 1280, 720}, {1024, 1280, 720},
			       {4096, 1280, 720}, {2048, 640, 360}, {2048, 1920, 1080}},
		 quick_sizes[][3] = {
			 {1024, 1280, 720}, {512, 1280, 720}, {1024, 640, 360}};

struct frame_rows {
	struct frame_row row[N(sizes)];
	int n;
	char renderer[128];
};

/* Each of all frames, ms. */
struct samples {
	double *ticks, *texture, *draw, *whole;
	double texels; /* of all */
	int n;
};

static struct frame_times times_of(double *ms, int n)
{
	int in_time = 0;

	stopwatch_sort(ms, n);
	while (in_time < n && ms[in_time] <= 1e3 / PAPER_HZ)
		in_time++;
	return (struct frame_times){.median = stopwatch_quantile(ms, n, 0.5),
				    .p99 = stopwatch_quantile(ms, n, 0.99),
				    .max = ms[n - 1],
				    .in_time = 100.0 * in_time / n};
}

static void sample(struct fed_view *fed, double t_s, struct samples *to)
{
	struct incise_view_report before, after;
	double begin;

	incise_view_report(fed->view, &before);
	begin = stopwatch_ns();
	fed_view_until(fed, t_s);
	fed_view_frame(fed);
	to->whole[to->n] = (stopwatch_ns() - begin) * 1e-6;
	incise_view_report(fed->view, &after);
	to->ticks[to->n] = (after.ticks_s - before.ticks_s) * 1e3;
	to->texture[to->n] = (after.texture_s - before.texture_s) * 1e3;
	to->draw[to->n] = (after.draw_s - before.draw_s) * 1e3;
	to->texels += (double)(after.uploaded_texels - before.uploaded_texels);
	to->n++;
}

/* The procedure goes on from frame to frame: each part has some of all of it. */
static void time_of(const double *whole_ms, int n, struct harness_time *time)
{
	double medians[PARTS], *part = cli_alloc(n / PARTS + 1, sizeof(*part));

	for (int k = 0; k < PARTS; k++) {
		int taken = 0;

		for (int i = k; i < n; i += PARTS)
			part[taken++] = whole_ms[i] * 1e6;
		stopwatch_sort(part, taken);
		medians[k] = stopwatch_quantile(part, taken, 0.5);
	}
	free(part);
	harness_time_of(medians, PARTS, time);
}

static void draw_frames(struct fed_view *fed, int bursts, struct samples *got)
{
	/* Textures of the first frame, and shaders compiled at the second, are not of a frame. */
	for (int i = 0; i < 5; i++) {
		fed_view_until(fed, (FRAMES_FROM_S - 1.0 / FPS) * i / 5);
		fed_view_frame(fed);
	}
	for (int b = 0; b < bursts; b++) {
		double t_s = FRAMES_FROM_S + b * EVERY_S;

		fed_view_until(fed, t_s - 1.0 / FPS);
		fed_view_frame(fed);
		for (int i = 0; i < IN_A_ROW && !cli_stop; i++)
			sample(fed, t_s + (double)i / FPS, got);
	}
}

static void measure_size(const struct view_script *script, double until_s,
			 struct frame_row *row, struct frame_rows *rows)
{
	int bursts = (int)fmax((until_s - FRAMES_FROM_S) / EVERY_S, 1);
	int n = bursts * IN_A_ROW;
	double *all = cli_alloc(4 * (size_t)n, sizeof(*all)), sum = 0;
	struct samples got = {all, all + n, all + 2 * n, all + 3 * n, 0, 0};
	struct incise_view_report report;
	struct fed_view fed;

	fed_view_open(&fed, script, row->texture_px, row->width, row->height, true);
	draw_frames(&fed, bursts, &got);
	incise_view_report(fed.view, &report);
	if (cli_stop)
		cli_fail("interrupted");
	for (int i = 0; i < n; i++)
		sum += got.whole[i];
	row->frames = n;
	row->hz = n / (sum * 1e-3);
	row->triangles = report.triangles;
	row->samples = report.samples;
	row->texels = got.texels / n;
	row->tick_us = report.ticks_s * 1e6 / (double)report.ticks;
	time_of(got.whole, n, &row->time);
	row->ticks = times_of(got.ticks, n);
	row->texture = times_of(got.texture, n);
	row->draw = times_of(got.draw, n);
	row->whole = times_of(got.whole, n);
	snprintf(rows->renderer, sizeof(rows->renderer), "%s", report.renderer);
	fed_view_close(&fed);
	free(all);
}

static void measure_frames(const struct view_script *script, bool quick,
			   struct frame_rows *rows)
{
	rows->n = quick ? N(quick_sizes) : N(sizes);
	for (int i = 0; i < rows->n; i++) {
		const int *size = quick ? quick_sizes[i] : sizes[i];
		struct frame_row *row = &rows->row[i];

		row->texture_px = size[0];
		row->width = size[1];
		row->height = size[2];
		cli_progress("frames of %d x %d, texture of %d", row->width, row->height,
			     row->texture_px);
		measure_size(script, quick ? QUICK_UNTIL_S : UNTIL_S, row, rows);
	}
	cli_progress_end();
}

/* The median of a whole frame at the usual size; NaN where it was not measured. */
static double frame_ms(const struct frame_rows *rows, int texture_px)
{
	for (int i = 0; i < rows->n; i++)
		if (rows->row[i].texture_px == texture_px &&
		    rows->row[i].width == sizes[0][1])
			return rows->row[i].whole.median;
	return NAN;
}

#define TIMES(part, member)                                    \
	COLUMN(frame_row, part "_ms.median", member.median),   \
		COLUMN(frame_row, part "_ms.p99", member.p99), \
		COLUMN(frame_row, part "_ms.max", member.max)

static const struct bench_table frame_table = {
	.key = "frames",
	.row_bytes = sizeof(struct frame_row),
	.columns =
		{
			COLUMN(frame_row, "texture_px", texture_px),
			COLUMN(frame_row, "width", width),
			COLUMN(frame_row, "height", height),
			COLUMN(frame_row, "triangles", triangles),
			COLUMN(frame_row, "samples", samples),
			COLUMN(frame_row, "frames", frames),
			TIMES("effects", ticks),
			TIMES("texture", texture),
			TIMES("draw", draw),
			TIMES("whole", whole),
			COLUMN(frame_row, "in_20_ms_percent", whole.in_time),
			COLUMN(frame_row, "frames_hz", hz),
			COLUMN(frame_row, "texels", texels),
			COLUMN(frame_row, "effects_us_tick", tick_us),
		},
	.metrics = {METRIC(TIME, frame_row, time, "ms",
			   "frame {width}x{height}, texture {texture_px}")},
};

/* --- the error of what is shown ---
 *
 *     exact   ─●──●──●──●──●──●──●──●──●─▶   finest texture, any moment
 *     shown    ■━━━━━━━━━━━■━━━━━━━━━━━■━    the last frame that was drawn
 *                    ↑ error at a moment
 *
 * Moments are steps of 1/240 s, each 65th of them: these meet all places between two frames of 15,
 * 30 and 60 a second alike. The frames that are shown at a moment are never older than the moment
 * before, so one view per texture draws all of them in order.
 */

#define SIDE 8

struct similarity {
	double rms;  /* of sRGB values, 0 … 255 */
	double ssim; /* 1: the same */
};

static double rms_of(const uint8_t *a, const uint8_t *b, size_t n)
{
	uint64_t sum = 0;

	for (size_t i = 0; i < n; i++) {
		int d = a[i] - b[i];

		sum += (uint64_t)(d * d);
	}
	return sqrt((double)sum / (double)n);
}

/* Rec. 601, in 256ths. */
static int luma(const uint8_t *p)
{
	return 77 * p[0] + 150 * p[1] + 29 * p[2];
}

static double window(const uint8_t *a, const uint8_t *b, size_t row)
{
	const double n = SIDE * SIDE, c1 = 0.01 * 255 * 0.01 * 255,
		     c2 = 0.03 * 255 * 0.03 * 255;
	int64_t sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
	double ma, mb, va, vb, cov;

	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++) {
			int64_t p = luma(a + y * row + 3 * x),
				q = luma(b + y * row + 3 * x);

			sa += p;
			sb += q;
			saa += p * p;
			sbb += q * q;
			sab += p * q;
		}
	ma = sa / n;
	mb = sb / n;
	va = (saa / n - ma * ma) / 65536;
	vb = (sbb / n - mb * mb) / 65536;
	cov = (sab / n - ma * mb) / 65536;
	ma /= 256;
	mb /= 256;
	return (2 * ma * mb + c1) * (2 * cov + c2) /
	       ((ma * ma + mb * mb + c1) * (va + vb + c2));
}

/* Compare frames with pixels of 3 bytes. The structural similarity is that of Wang, Bovik, Sheikh
 * and Simoncelli, "Image quality assessment: from error visibility to structural similarity",
 * 2004, eq. 13, of luma, with its constants; the mean over windows of 8 × 8 pixels side by side,
 * each pixel with the same weight. */
static struct similarity similarity_of(const uint8_t *a, const uint8_t *b, int width,
				       int height)
{
	size_t row = 3 * (size_t)width;
	double sum = 0;
	int n = 0;

	for (int y = 0; y + SIDE <= height; y += SIDE)
		for (int x = 0; x + SIDE <= width; x += SIDE, n++)
			sum += window(a + y * row + 3 * (size_t)x,
				      b + y * row + 3 * (size_t)x, row);
	return (struct similarity){.rms = rms_of(a, b, row * (size_t)height),
				   .ssim = sum / n};
}

#define WIDTH 1280
#define HEIGHT 720
#define STEP_HZ 240
#define STRIDE 65
#define QUICK_STRIDE 119

/* The finest takes seconds to make; --quick ends at 1024. */
static const int textures_px[] = {512, 1024, 2048, 4096};
#define QUICK_TEXTURES 2
static const int rates[] = {15, 30, 60, 0}; /* frames a second; 0: at the moment itself */
#define TEXTURES N(textures_px)
#define RATES N(rates)

struct compared {
	struct fed_view exact, shown[TEXTURES];
	int textures;
	uint8_t *rgb, *exact_rgb;
	double square[TEXTURES * RATES], max[TEXTURES * RATES], ssim[TEXTURES * RATES];
};

static void draw(struct fed_view *fed, double t_s, uint8_t *rgb)
{
	fed_view_until(fed, t_s);
	fed_view_frame(fed);
	if (incise_view_pixels(fed->view, rgb))
		cli_fail("the image cannot be read");
}

/* When the frame that is shown was drawn, in steps. @fps: 0 is at the moment itself. */
static int drawn_at(int step, int fps)
{
	int steps = fps ? STEP_HZ / fps : 1;

	return step / steps * steps;
}

static void compare(struct compared *c, int step)
{
	draw(&c->exact, (double)step / STEP_HZ, c->exact_rgb);
	for (int i = 0; i < c->textures; i++)
		for (int k = 0; k < RATES; k++) {
			int row = i * RATES + k, at = drawn_at(step, rates[k]);
			struct similarity is;

			draw(&c->shown[i], (double)at / STEP_HZ, c->rgb);
			is = similarity_of(c->rgb, c->exact_rgb, WIDTH, HEIGHT);
			c->square[row] += is.rms * is.rms;
			c->max[row] = fmax(c->max[row], is.rms);
			c->ssim[row] += is.ssim;
		}
}

static void open_views(struct compared *c, const struct view_script *script, int textures)
{
	*c = (struct compared){.textures = textures,
			       .rgb = cli_alloc(WIDTH * HEIGHT, 3),
			       .exact_rgb = cli_alloc(WIDTH * HEIGHT, 3)};
	fed_view_open(&c->exact, script, textures_px[textures - 1], WIDTH, HEIGHT, false);
	incise_view_panel(c->exact.view, false, false);
	for (int i = 0; i < textures; i++) {
		fed_view_open(&c->shown[i], script, textures_px[i], WIDTH, HEIGHT, false);
		incise_view_panel(c->shown[i].view, false, false);
	}
}

static void close_views(struct compared *c)
{
	fed_view_close(&c->exact);
	for (int i = 0; i < c->textures; i++)
		fed_view_close(&c->shown[i]);
	free(c->rgb);
	free(c->exact_rgb);
}

struct shown_row {
	int texture_px, fps;
	char shown[20]; /* "60 fps"; or "exact" */
	double rms, rms_max, ssim, unlike;
	double ms;   /* of a frame */
	double ms_s; /* of run time for a second that is shown; NaN at the moment itself */
};

struct shown_rows {
	struct shown_row row[TEXTURES * RATES];
	int n, moments;
	int exact_px; /* of the texture of what they are compared with */
};

static void add_shown(struct shown_rows *rows, const struct compared *c, int i,
		      const struct frame_rows *frames)
{
	struct shown_row *row = &rows->row[rows->n];

	*row = (struct shown_row){
		.texture_px = textures_px[i / RATES],
		.fps = rates[i % RATES],
		.shown = "exact",
		.rms = sqrt(c->square[i] / rows->moments),
		.rms_max = c->max[i],
		.ssim = c->ssim[i] / rows->moments,
		.ms_s = NAN,
	};
	/* That is the exact one. */
	if (row->texture_px == rows->exact_px && !row->fps)
		return;
	row->unlike = 1 - row->ssim;
	row->ms = frame_ms(frames, row->texture_px);
	if (row->fps) {
		row->ms_s = row->ms * row->fps;
		snprintf(row->shown, sizeof(row->shown), "%d fps", row->fps);
	}
	rows->n++;
}

static void measure_shown(const struct view_script *script, bool quick,
			  const struct frame_rows *frames, struct shown_rows *rows)
{
	double until_s = quick ? QUICK_ERROR_UNTIL_S : ERROR_UNTIL_S;
	struct compared c;

	cli_progress("error against finer images");
	open_views(&c, script, quick ? QUICK_TEXTURES : TEXTURES);
	for (int step = (int)(FRAMES_FROM_S * STEP_HZ); step < until_s * STEP_HZ;
	     step += quick ? QUICK_STRIDE : STRIDE) {
		if (cli_stop)
			cli_fail("interrupted");
		compare(&c, step);
		rows->moments++;
		cli_progress("error against finer images: %.1f of %.1f s",
			     (double)step / STEP_HZ, until_s);
	}
	close_views(&c);
	rows->exact_px = textures_px[c.textures - 1];
	for (int i = 0; i < c.textures * RATES; i++)
		add_shown(rows, &c, i, frames);
	cli_progress_end();
}

static const struct bench_table shown_table = {
	.key = "shown.rows",
	.row_bytes = sizeof(struct shown_row),
	.columns =
		{
			COLUMN(shown_row, "texture_px", texture_px),
			COLUMN(shown_row, "fps", fps, .optional = true),
			COLUMN(shown_row, "shown", shown, .data = true),
			COLUMN(shown_row, "rms_error", rms),
			COLUMN(shown_row, "rms_error_max", rms_max),
			COLUMN(shown_row, "ssim", ssim),
			COLUMN(shown_row, "frame_ms", ms),
			COLUMN(shown_row, "ms_per_s", ms_s),
		},
	.metrics =
		{
			METRIC(EXACT, shown_row, rms, "1",
			       "texture {texture_px}, {shown} rms", "shown=60 fps|exact"),
			METRIC(EXACT, shown_row, rms_max, "1",
			       "texture {texture_px}, {shown} largest rms",
			       "shown=60 fps|exact"),
			METRIC(EXACT, shown_row, unlike, "1",
			       "texture {texture_px}, {shown} dissimilarity",
			       "shown=60 fps|exact"),
		},
};

/* --- the benchmark --- */

static const char neck[] =
	"rate_hz = 1000.0;\n"
	"surface = { kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0];\n"
	"  to_mm = [160.0, 0.0, -55.0]; radius_mm = 55.0; };\n"
	"tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.17; damping_N_s_mm = 0.0005;\n"
	"  insertion_N_mm = 0.28; aligned = 0.2; spread_N_mm = 0.22; };\n"
	"effects = { average_ticks = 8; };\n"
	"tool = { handle_mm = 120.0; };\n"
	"limits = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };\n"
	"picture = { wound = true; bleeding = true; skin = \"neck\"; larynx = true;\n"
	"  blood_ul_s_mm2 = 0.3; gravity = [0.0, -0.5, -0.9]; };\n";

static void run_view(struct bench_run *run)
{
	static struct frame_rows frames;
	static struct shown_rows shown;
	const char *scene = run->operands[0];
	struct view_script script;

	if (!scene) {
		static struct memory_file own;

		own = memory_file_begin("neck");
		fputs(neck, own.file);
		memory_file_written(&own);
		scene = own.path;
	}
	cli_catch_signals();
	view_script_begin(&script, scene, run->quick ? QUICK_ERROR_UNTIL_S : UNTIL_S);
	measure_frames(&script, run->quick, &frames);
	measure_shown(&script, run->quick, &frames, &shown);
	view_script_end(&script);
	bench_value(run, "renderer", json_string(frames.renderer));
	bench_rows(run, &frame_table, frames.row, frames.n);
	bench_values(run, "{s{si si}}", "shown", "moments", shown.moments,
		     "exact_texture_px", shown.exact_px);
	bench_rows(run, &shown_table, shown.row, shown.n);
}

static const struct bench bench_view = {
	.name = "view",
	.run = run_view,
};

/* --- the command --- */

static const struct cli_option options[] = {
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct bench_run, json)},
	{0, "against", "OLD.json",
	 "report significant changes since an older report of --json",
	 CLI_INPUT(struct bench_run, against)},
	{0, "quick", NULL, "smoke test with fewer frames and runs",
	 CLI_FLAG(struct bench_run, quick)},
	{0},
};

static const struct cli_command command = {
	.name = "bench view",
	.synopsis = "[SCENE] [OPTIONS]",
	.summary =
		"Measure the image of a scene, rendered off-screen while a cut bleeds: "
		"run time of a frame by sizes of texture and image; error against a finer "
		"texture. Without SCENE it renders the neck of Bhasin et al. (2005).",
	.options = options,
	.failure = "failure, or worse metrics",
};

int main(int argc, char **argv)
{
	static struct bench_run run = {.bench = &bench_view};
	static struct scene_argument argument;

	cli_parse(&command, argc, argv, &run);
	run.n_operands = argc - optind;
	if (run.n_operands > 1)
		cli_usage("expected at most one scene");
	if (run.n_operands)
		scene_argument_operand(&argument, argc, argv, optind);
	run.operands = (char *[]){(char *)argument.path};
	bench_measure(&run);
	return 0;
}
