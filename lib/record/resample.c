// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recording on one grid of time; see resample.h. Memory is that of the force samples
 * within 8 rows to each side.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cut.h"
#include "depth.h"
#include "recording.h"
#include "resample.h"
#include "rows.h"

#define HALF 8	   /* rows to each side that a row is made of */
#define CELLS 2048 /* of the tabulated weights, per row */
#define STEPS (HALF * CELLS)

#define SINGLE(name, unit, about, decimals)                       \
	{                                                         \
		name, unit, about, INCISE_COLUMN_SINGLE, decimals \
	}
#define FLAG(name, about)                               \
	{                                               \
		name, "1", about, INCISE_COLUMN_FLAG, 0 \
	}
const struct incise_column incise_resample_columns[INCISE_RESAMPLE_COLUMNS] = {
	{"recording", "1", "its name", INCISE_COLUMN_NAME, 0},
	{"cut", "1", "number of the cut, 0 outside", INCISE_COLUMN_INTEGER, 0},
	{"t_s", "s", "since the recording's first force sample", INCISE_COLUMN_REAL, 6},
	SINGLE("x_mm", "mm", "position of the tip", 4),
	SINGLE("y_mm", "mm", "position of the tip", 4),
	SINGLE("z_mm", "mm", "position of the tip", 4),
	SINGLE("qw", "1", "orientation, unit quaternion", 6),
	SINGLE("qx", "1", "orientation, unit quaternion", 6),
	SINGLE("qy", "1", "orientation, unit quaternion", 6),
	SINGLE("qz", "1", "orientation, unit quaternion", 6),
	SINGLE("depth_mm", "mm", "of the tip below the surface", 4),
	SINGLE("velocity_mm_s", "mm/s", "speed of the tip", 3),
	SINGLE("force_N", "N", "on the blade", 5),
	SINGLE("force_u_N", "N", "standard uncertainty of force_N from noise", 6),
	FLAG("clipped", "1: the converter was at an end"),
	FLAG("interpolated", "1: a tracker record is missing here"),
	FLAG("tracker_error", "1: the tracker told of an error"),
};

struct sample {
	int64_t t_ns;
	double force_N;
	bool clipped;
};

struct pose {
	int64_t seq, t_ns;
	double position[3], q[4];
	bool error;
};

struct depth {
	int64_t t_ns;
	double depth_mm, velocity_mm_s;
};

struct resample {
	struct incise_rows force, tracker, depth;
	double n_per_code, zero_N;
	int64_t top;
	struct sample *samples; /* those near the row */
	size_t n, room;
	struct pose pose[2]; /* before and after the row; INCISE_TIME_NONE: none */
	struct depth deep[2];
	struct incise_cut cut;
	double *weights; /* of |rows| in 1/CELLS, STEPS + 2 */
};

double incise_resample_weight(double rows)
{
	double x = M_PI * rows / HALF, sinc = 2 * M_PI / 3 * rows;

	if (!(fabs(rows) < HALF))
		return 0;
	sinc = fabs(sinc) < 1e-9 ? 1 : sin(sinc) / sinc;
	return sinc * (0.42 + 0.5 * cos(x) + 0.08 * cos(2 * x));
}

/* --- what is near -------------------------------------------------------------------- */

/* Take another force sample: 1, 0 at the end, -errno. */
static int more_force(struct resample *r, struct incise_error *err)
{
	int rc = incise_rows_next(&r->force, err);
	int64_t code;

	if (rc <= 0)
		return rc;
	if (r->n == r->room) {
		size_t room = r->room ? 2 * r->room : 1024;
		struct sample *samples = realloc(r->samples, room * sizeof(*samples));

		if (!samples)
			return incise_error_set(err, ENOMEM, "out of memory");
		r->samples = samples;
		r->room = room;
	}
	code = sqlite3_column_int64(r->force.stmt, 2);
	if (code < 0 || code > r->top)
		return incise_error_set(err, EINVAL,
					"%s: damaged: table force, row %lld: code is "
					"out of the converter's range",
					r->force.recording->path,
					(long long)sqlite3_column_int64(r->force.stmt,
									0));
	r->samples[r->n++] =
		(struct sample){r->force.t_ns, code * r->n_per_code - r->zero_N,
				code == 0 || code == r->top};
	return 1;
}

static int more_pose(struct resample *r, struct incise_error *err)
{
	sqlite3_stmt *stmt = r->tracker.stmt;
	int rc = incise_rows_next(&r->tracker, err);
	struct pose *pose = &r->pose[1];
	const char *status;
	double norm = 0;

	r->pose[0] = *pose;
	pose->t_ns = INCISE_TIME_NONE;
	if (rc <= 0)
		return rc;
	pose->seq = sqlite3_column_int64(stmt, 0);
	pose->t_ns = r->tracker.t_ns;
	for (int i = 0; i < 3; i++)
		pose->position[i] = sqlite3_column_double(stmt, 2 + i);
	for (int i = 0; i < 4; i++) {
		pose->q[i] = sqlite3_column_double(stmt, 5 + i);
		norm += pose->q[i] * pose->q[i];
	}
	for (int i = 0; i < 4; i++)
		pose->q[i] = norm > 0 ? pose->q[i] / sqrt(norm) : NAN;
	status = (const char *)sqlite3_column_text(stmt, 9);
	pose->error = status[strspn(status, " ")] != 0;
	return 1;
}

static int more_depth(struct resample *r, struct incise_error *err)
{
	int rc = incise_rows_next(&r->depth, err);

	r->deep[0] = r->deep[1];
	r->deep[1].t_ns = INCISE_TIME_NONE;
	if (rc > 0)
		r->deep[1] = (struct depth){r->depth.t_ns,
					    sqlite3_column_double(r->depth.stmt, 2),
					    sqlite3_column_double(r->depth.stmt, 3)};
	return rc;
}

/* Have the records of tracker and depth before and after this time. */
static int go_to(struct resample *r, int64_t t_ns, struct incise_error *err)
{
	int rc = 0;

	while (rc >= 0 && r->pose[1].t_ns != INCISE_TIME_NONE && r->pose[1].t_ns <= t_ns)
		rc = more_pose(r, err);
	while (rc >= 0 && r->deep[1].t_ns != INCISE_TIME_NONE && r->deep[1].t_ns <= t_ns)
		rc = more_depth(r, err);
	return rc < 0 ? rc : 0;
}

/* Share of the way from a to b; NAN where they are not around it, or too far apart. */
static double share(int64_t a_ns, int64_t b_ns, int64_t t_ns)
{
	if (a_ns == INCISE_TIME_NONE || b_ns == INCISE_TIME_NONE || t_ns < a_ns ||
	    b_ns - a_ns > INCISE_DEPTH_GAP_NS)
		return NAN;
	return (double)(t_ns - a_ns) / (b_ns - a_ns);
}

/* On the shorter arc from a to b (K. Shoemake: Animating Rotation with Quaternion Curves,
 * 1985); linear where they are so close that the sine says nothing. */
static void slerp(const double a[4], const double b[4], double s, union incise_cell to[4])
{
	double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
	double sign = dot < 0 ? -1 : 1, angle = acos(fmin(fabs(dot), 1));
	double wa = 1 - s, wb = s;

	if (angle > 1e-4) {
		wa = sin((1 - s) * angle) / sin(angle);
		wb = sin(s * angle) / sin(angle);
	}
	for (int i = 0; i < 4; i++)
		to[i].real = wa * a[i] + sign * wb * b[i];
}

static void put_pose(struct resample *r, int64_t t_ns, union incise_cell *cells)
{
	const struct pose *a = &r->pose[0], *b = &r->pose[1];
	const struct depth *c = &r->deep[0], *d = &r->deep[1];
	double s = share(a->t_ns, b->t_ns, t_ns), e = share(c->t_ns, d->t_ns, t_ns);

	for (int i = 0; i < 3; i++)
		cells[3 + i].real =
			a->position[i] + s * (b->position[i] - a->position[i]);
	slerp(a->q, b->q, s, cells + 6);
	cells[10].real = c->depth_mm + e * (d->depth_mm - c->depth_mm);
	cells[11].real = c->velocity_mm_s + e * (d->velocity_mm_s - c->velocity_mm_s);
	cells[1].integer =
		!isnan(e) && incise_cut_step(&r->cut, cells[10].real) ? r->cut.count : 0;
	cells[15].integer = isnan(s) || b->seq - a->seq != 1;
	cells[16].integer = !isnan(s) && (a->error || b->error);
}

/* --- force --------------------------------------------------------------------------- */

/*
 * Noise of single samples, of their steps: what moves slowly is not taken for noise. It is
 * not less than that of the code's last digit.
 */
static double noise(const struct resample *r, size_t from, size_t to)
{
	double sum = 0;

	for (size_t i = from + 1; i < to; i++)
		sum += pow(r->samples[i].force_N - r->samples[i - 1].force_N, 2);
	return sqrt((to > from + 1 ? sum / (to - from - 1) / 2 : 0) +
		    r->n_per_code * r->n_per_code / 12);
}

static void put_force(union incise_cell *cells, double force_N, double u_N, bool clipped)
{
	cells[12].real = force_N;
	cells[13].real = u_N;
	cells[14].integer = clipped;
}

/* The samples around the time, weighted. A row with none within half a row is NAN. */
static void filter(const struct resample *r, int64_t t_ns, double row_ns,
		   union incise_cell *cells)
{
	double sum = 0, squares = 0, force = 0, u;
	bool near = false, clipped = false;

	for (size_t i = 0; i < r->n; i++) {
		double rows = fabs((r->samples[i].t_ns - t_ns) / row_ns);
		double at = rows * CELLS, w;
		int cell = (int)at;

		if (rows >= HALF)
			continue;
		w = r->weights[cell] +
		    (at - cell) * (r->weights[cell + 1] - r->weights[cell]);
		sum += w;
		squares += w * w;
		force += w * r->samples[i].force_N;
		near = near || rows <= 0.5;
		clipped = clipped || (r->samples[i].clipped && rows <= 1);
	}
	u = near ? noise(r, 0, r->n) * sqrt(squares) / fabs(sum) : NAN;
	put_force(cells, near ? force / sum : NAN, u, clipped);
}

/* On the line between the samples before and after; for a rate above the force's own. */
static void between(const struct resample *r, int64_t t_ns, union incise_cell *cells)
{
	size_t i = 0;
	double s;

	while (i + 2 < r->n && r->samples[i + 1].t_ns <= t_ns)
		i++;
	if (i + 1 >= r->n) {
		put_force(cells, NAN, NAN, false);
		return;
	}
	s = share(r->samples[i].t_ns, r->samples[i + 1].t_ns, t_ns);
	put_force(cells,
		  r->samples[i].force_N +
			  s * (r->samples[i + 1].force_N - r->samples[i].force_N),
		  noise(r, 0, r->n) * sqrt((1 - s) * (1 - s) + s * s),
		  r->samples[i].clipped || r->samples[i + 1].clipped);
}

static void forget(struct resample *r, size_t n)
{
	if (n < r->n / 2 && n < 4096)
		return;
	memmove(r->samples, r->samples + n, (r->n - n) * sizeof(*r->samples));
	r->n -= n;
}

/* --- rows ---------------------------------------------------------------------------- */

struct pass {
	const struct incise_export_options *options;
	struct incise_table *table;
	struct incise_export_report *report;
	int64_t name, first_ns;
	uint64_t samples, all;
	struct incise_error *err;
};

static int put_row(struct resample *r, struct pass *pass, int64_t t_ns,
		   union incise_cell *cells)
{
	const struct incise_export_options *o = pass->options;
	int rc;

	cells[0].integer = pass->name;
	cells[2].real = (t_ns - pass->first_ns) * 1e-9;
	pass->report->clipped += cells[14].integer;
	if (!isnan(cells[10].real))
		pass->report->depth_max_mm =
			fmax(pass->report->depth_max_mm, cells[10].real);
	if (!isnan(cells[11].real))
		pass->report->velocity_max_mm_s =
			fmax(pass->report->velocity_max_mm_s, cells[11].real);
	rc = incise_table_add(pass->table, cells, pass->err);
	if (!rc && (++pass->report->rows & 0xfff) == 0 && o->progress &&
	    o->progress(o->context,
			fmin(1, (pass->samples + r->force.n) / fmax(1, pass->all))))
		rc = incise_error_set(pass->err, EINTR, "interrupted");
	return rc;
}

/* A row for each force sample, told with 8 to each side for the noise. */
static int on_force(struct resample *r, struct pass *pass)
{
	union incise_cell cells[INCISE_RESAMPLE_COLUMNS];
	size_t at = 0;
	int rc = 1;

	for (;; at++) {
		while (rc > 0 && r->n < at + HALF + 1)
			rc = more_force(r, pass->err);
		if (rc < 0 || at >= r->n)
			return rc < 0 ? rc : 0;
		if (at >= 4096 + HALF) { /* seldom enough to cost nothing */
			forget(r, at - HALF);
			at = HALF;
		}
		if (go_to(r, r->samples[at].t_ns, pass->err))
			return -pass->err->code;
		put_pose(r, r->samples[at].t_ns, cells);
		put_force(cells, r->samples[at].force_N,
			  noise(r, at > HALF ? at - HALF : 0,
				at + HALF < r->n ? at + HALF + 1 : r->n),
			  r->samples[at].clipped);
		if (put_row(r, pass, r->samples[at].t_ns, cells))
			return -pass->err->code;
	}
}

/* A row for each multiple of 1/rate from the first force sample to the last. */
static int on_grid(struct resample *r, struct pass *pass, int64_t last_ns,
		   double force_hz)
{
	double row_ns = 1e9 / pass->options->rate_hz;
	bool drops = pass->options->rate_hz < force_hz;
	/* Two samples of force to each side are enough for a line. */
	double reach_ns = drops ? HALF * row_ns : fmax(HALF * row_ns, 2e9 / force_hz);
	union incise_cell cells[INCISE_RESAMPLE_COLUMNS];
	int rc = 1;

	for (int64_t k = 0;; k++) {
		int64_t t_ns = pass->first_ns + llround(k * row_ns);
		size_t old = 0;

		if (t_ns > last_ns)
			break;
		while (rc > 0 && (!r->n || r->samples[r->n - 1].t_ns < t_ns + reach_ns))
			rc = more_force(r, pass->err);
		if (rc < 0)
			return rc;
		while (old < r->n && r->samples[old].t_ns < t_ns - reach_ns)
			old++;
		forget(r, old);
		if (go_to(r, t_ns, pass->err))
			return -pass->err->code;
		put_pose(r, t_ns, cells);
		if (drops)
			filter(r, t_ns, row_ns, cells);
		else
			between(r, t_ns, cells);
		if (put_row(r, pass, t_ns, cells))
			return -pass->err->code;
	}
	/* What is behind is checked as well. */
	while (rc > 0) {
		r->n = 0;
		rc = more_force(r, pass->err);
	}
	return rc;
}

/* Last time of the table force, which is what the grid goes to. */
static int find_last(struct resample *r, int64_t *last_ns, struct incise_error *err)
{
	struct incise_recording *recording = r->force.recording;
	struct incise_row_times times = r->force.times; /* as before the first row */
	sqlite3_stmt *stmt = NULL;
	bool found = sqlite3_prepare_v2(recording->db,
					"SELECT seq, t_ns FROM force ORDER BY seq DESC "
					"LIMIT 1",
					-1, &stmt, NULL) == SQLITE_OK &&
		     sqlite3_step(stmt) == SQLITE_ROW;

	if (found && !incise_row_times_next(&times, sqlite3_column_int64(stmt, 0),
					    sqlite3_column_int64(stmt, 1), last_ns))
		*last_ns = INCISE_TIME_NONE; /* no row; the rows tell of the damage */
	sqlite3_finalize(stmt);
	return found ? 0
		     : incise_error_set(err, ENODATA, "%s: there is no force sample",
					recording->path);
}

static int open_rows(struct resample *r, struct incise_recording *recording,
		     const struct incise_calibration *given, int64_t *last_ns,
		     struct incise_error *err)
{
	int rc = incise_rows_open(&r->force, recording, "force", "seq, t_ns, code", "iii",
				  recording->meta.force, err);

	if (!rc && given)
		incise_rows_calibrate(&r->force, given);
	if (!rc)
		rc = find_last(r, last_ns, err);
	if (!rc)
		rc = incise_rows_open(
			&r->tracker, recording, "tracker",
			"seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status",
			"iirrrrrrrt", recording->meta.tracker, err);
	if (!rc)
		rc = incise_rows_open(&r->depth, recording, "depth",
				      "seq, t_ns, depth_mm, velocity_mm_s", "iirr",
				      recording->depth_rows, err);
	if (!rc && given) {
		incise_rows_calibrate(&r->tracker, given);
		incise_rows_calibrate(&r->depth, given);
	}
	for (int i = 0; i < 2; i++)
		r->pose[i].t_ns = r->deep[i].t_ns = INCISE_TIME_NONE;
	if (!rc)
		rc = more_force(r, err) < 0 || more_pose(r, err) < 0 ||
				     more_depth(r, err) < 0
			     ? -err->code
			     : 0;
	return rc;
}

int incise_resample(struct incise_recording *recording, const char *name,
		    const struct incise_export_options *options,
		    struct incise_table *table, struct incise_export_report *report,
		    uint64_t samples, uint64_t all, struct incise_error *err)
{
	const struct incise_recording_info *meta = &recording->meta;
	const struct incise_calibration *given = options->calibration;
	double mV_N = given ? given->force_mV_N : meta->force_mV_N;
	double zero_mV = given && !isnan(given->force_zero_mV) ? given->force_zero_mV
							       : meta->zero_mV;
	struct resample r = {
		.n_per_code = meta->full_scale_V * 1e3 / (1LL << meta->bits) / mV_N,
		.zero_N = (zero_mV - meta->offset_V * 1e3) / mV_N,
		.top = (1LL << meta->bits) - 1,
	};
	struct pass pass = {options, table, report, 0, 0, samples, all, err};
	int64_t last_ns = 0;
	int rc = 0;

	if (isnan(zero_mV))
		return incise_error_set(err, EINVAL,
					"%s: ended before the zero of the force channel "
					"was known (0.5 s), so no force can be told",
					recording->path);
	r.weights = malloc((STEPS + 2) * sizeof(*r.weights));
	pass.name = incise_table_name(table, name);
	if (!r.weights || pass.name < 0)
		rc = incise_error_set(err, ENOMEM, "out of memory");
	for (int i = 0; i < STEPS + 2 && !rc; i++)
		r.weights[i] = incise_resample_weight((double)i / CELLS);
	if (!rc)
		rc = open_rows(&r, recording, given, &last_ns, err);
	if (!rc) {
		pass.first_ns = r.n ? r.samples[0].t_ns : 0;
		rc = options->rate_hz > 0
			     ? on_grid(&r, &pass, last_ns,
				       last_ns > pass.first_ns
					       ? (meta->force - 1) * 1e9 /
							 (last_ns - pass.first_ns)
					       : 1)
			     : on_force(&r, &pass);
	}
	report->cuts += r.cut.count;
	incise_rows_close(&r.force);
	incise_rows_close(&r.tracker);
	incise_rows_close(&r.depth);
	free(r.samples);
	free(r.weights);
	return rc;
}
