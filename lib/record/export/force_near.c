// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Force samples near a row; see force_near.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../read/depth.h"
#include "force_near.h"

#define HALF INCISE_FORCE_HALF
#define CELLS 2048 /* of the tabulated weights, per row */
#define STEPS (HALF * CELLS)

double incise_force_weight(double rows)
{
	double x = M_PI * rows / HALF, sinc = 2 * M_PI / 3 * rows;

	if (!(fabs(rows) < HALF))
		return 0;
	sinc = fabs(sinc) < 1e-9 ? 1 : sin(sinc) / sinc;
	return sinc * (0.42 + 0.5 * cos(x) + 0.08 * cos(2 * x));
}

/* Last time of the table, which is what a grid goes to. */
static int find_last(struct incise_force_near *near, struct incise_error *err)
{
	struct incise_recording *recording = near->rows.recording;
	struct incise_row_times times = near->rows.times; /* as before the first row */
	sqlite3_stmt *stmt = NULL;
	bool found = sqlite3_prepare_v2(recording->db,
					"SELECT seq, t_ns FROM force ORDER BY seq DESC "
					"LIMIT 1",
					-1, &stmt, NULL) == SQLITE_OK &&
		     sqlite3_step(stmt) == SQLITE_ROW;

	if (found &&
	    !incise_row_times_next(&times, sqlite3_column_int64(stmt, 0),
				   sqlite3_column_int64(stmt, 1), &near->last_ns))
		near->last_ns = INCISE_TIME_NONE; /* the rows tell of the damage */
	sqlite3_finalize(stmt);
	return found ? 0
		     : incise_error_set(err, ENODATA, "%s: there is no force sample",
					recording->path);
}

int incise_force_near_open(struct incise_force_near *near,
			   struct incise_recording *recording,
			   const struct incise_calibration *given,
			   struct incise_error *err)
{
	int rc;

	*near = (struct incise_force_near){0};
	incise_recording_force(recording, given, &near->scale);
	rc = incise_recording_need_zero(recording, &near->scale, err);
	if (rc)
		return rc;
	near->weights = malloc((STEPS + 2) * sizeof(*near->weights));
	if (!near->weights)
		return incise_error_set(err, ENOMEM, "out of memory");
	for (int i = 0; i < STEPS + 2; i++)
		near->weights[i] = incise_force_weight((double)i / CELLS);
	rc = incise_rows_open(&near->rows, recording, "force", "seq, t_ns, code", "iii",
			      recording->meta.force, err);
	if (!rc && given)
		incise_rows_calibrate(&near->rows, given);
	if (!rc)
		rc = find_last(near, err);
	if (!rc)
		rc = incise_force_near_more(near, err);
	return rc < 0 ? rc : 0;
}

void incise_force_near_close(struct incise_force_near *near)
{
	incise_rows_close(&near->rows);
	free(near->samples);
	free(near->weights);
}

int incise_force_near_more(struct incise_force_near *near, struct incise_error *err)
{
	int rc = incise_rows_next(&near->rows, err);
	int64_t code;

	if (rc <= 0)
		return rc;
	if (near->n == near->room) {
		size_t room = near->room ? 2 * near->room : 1024;
		struct incise_force_sample_near *samples =
			realloc(near->samples, room * sizeof(*samples));

		if (!samples)
			return incise_error_set(err, ENOMEM, "out of memory");
		near->samples = samples;
		near->room = room;
	}
	code = sqlite3_column_int64(near->rows.stmt, 2);
	if (code < 0 || code > near->scale.top)
		return incise_error_set(err, EINVAL,
					"%s: damaged: table force, row %lld: code is "
					"out of the converter's range",
					near->rows.recording->path,
					(long long)sqlite3_column_int64(near->rows.stmt,
									0));
	near->samples[near->n++] =
		(struct incise_force_sample_near){near->rows.t_ns, code};
	return 1;
}

size_t incise_force_near_forget(struct incise_force_near *near, size_t n)
{
	if (n < near->n / 2 && n < 4096)
		return 0;
	memmove(near->samples, near->samples + n, (near->n - n) * sizeof(*near->samples));
	near->n -= n;
	return n;
}

static bool clipped(const struct incise_force_near *near, size_t at)
{
	return near->samples[at].code == 0 || near->samples[at].code == near->scale.top;
}

/*
 * Noise of single samples, of their steps: what moves slowly is not taken for noise. It is
 * not less than that of the code's last digit.
 */
static double noise(const struct incise_force_near *near, size_t from, size_t to)
{
	double sum = 0;

	for (size_t i = from + 1; i < to; i++) {
		double step = near->samples[i].code - (double)near->samples[i - 1].code;

		sum += step * step;
	}
	return fabs(near->scale.n_per_code) *
	       sqrt((to > from + 1 ? sum / (to - from - 1) / 2 : 0) + 1 / 12.);
}

void incise_force_near_sample(const struct incise_force_near *near, size_t at,
			      struct incise_force_value *value)
{
	*value = (struct incise_force_value){
		near->samples[at].code * near->scale.n_per_code - near->scale.zero_N,
		noise(near, at > HALF ? at - HALF : 0,
		      at + HALF < near->n ? at + HALF + 1 : near->n),
		clipped(near, at)};
}

void incise_force_near_filter(const struct incise_force_near *near, int64_t t_ns,
			      double row_ns, struct incise_force_value *value)
{
	double sum = 0, squares = 0, code = 0, share;
	bool any = false;

	*value = (struct incise_force_value){NAN, NAN, false};
	for (size_t i = 0; i < near->n; i++) {
		double rows = fabs((near->samples[i].t_ns - t_ns) / row_ns);
		double at = rows * CELLS, w;
		int cell = (int)at;

		if (rows >= HALF)
			continue;
		w = near->weights[cell] +
		    (at - cell) * (near->weights[cell + 1] - near->weights[cell]);
		sum += w;
		squares += w * w;
		code += w * near->samples[i].code;
		any = any || rows <= 0.5;
		value->clipped = value->clipped || (rows <= 1 && clipped(near, i));
	}
	if (!any)
		return;
	share = sqrt(squares) / fabs(sum);
	value->force_N = code / sum * near->scale.n_per_code - near->scale.zero_N;
	value->u_N = noise(near, 0, near->n) * share;
}

void incise_force_near_line(const struct incise_force_near *near, int64_t t_ns,
			    struct incise_force_value *value)
{
	const struct incise_force_sample_near *a, *b;
	size_t i = 0;
	double s;

	*value = (struct incise_force_value){NAN, NAN, false};
	while (i + 2 < near->n && near->samples[i + 1].t_ns <= t_ns)
		i++;
	if (i + 1 >= near->n)
		return;
	a = &near->samples[i];
	b = a + 1;
	s = incise_row_share(a->t_ns, b->t_ns, t_ns);
	value->force_N =
		(a->code + s * (b->code - (double)a->code)) * near->scale.n_per_code -
		near->scale.zero_N;
	value->u_N = noise(near, 0, near->n) * sqrt((1 - s) * (1 - s) + s * s);
	value->clipped = clipped(near, i) || clipped(near, i + 1);
}
