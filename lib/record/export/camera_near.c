// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What the camera saw near a row; see camera_near.h.
 */
#include <math.h>
#include "camera_near.h"
#include "../schema.h"

int incise_camera_near_any(struct incise_recording *recording, struct incise_error *err)
{
	sqlite3_stmt *stmt = NULL;
	int rc;

	if (recording->form < 2)
		return 0;
	if (sqlite3_prepare_v2(recording->db, "SELECT 1 FROM frames LIMIT 1", -1, &stmt,
			       NULL) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	rc = sqlite3_step(stmt);
	if (rc != SQLITE_ROW && rc != SQLITE_DONE)
		rc = incise_schema_fail(recording->db, recording->path, err);
	else
		rc = rc == SQLITE_ROW;
	sqlite3_finalize(stmt);
	return rc;
}

static double column(sqlite3_stmt *stmt, int i)
{
	return sqlite3_column_type(stmt, i) == SQLITE_NULL
		       ? NAN
		       : sqlite3_column_double(stmt, i);
}

static int more(struct incise_camera_near *near, struct incise_error *err)
{
	sqlite3_stmt *stmt = near->rows.stmt;
	int rc = incise_rows_next(&near->rows, err);

	near->picture[0] = near->picture[1];
	near->picture[1].t_ns = INCISE_TIME_NONE;
	if (rc <= 0)
		return rc;
	near->picture[1] = (struct incise_camera_picture){
		near->rows.t_ns,
		column(stmt, 2) * near->scale,
		column(stmt, 3) * near->mm_px,
		column(stmt, 4),
		incise_row_times_sd(&near->rows.times, sqlite3_column_int64(stmt, 0)),
	};
	return 1;
}

int incise_camera_near_open(struct incise_camera_near *near,
			    struct incise_recording *recording,
			    const struct incise_calibration *given,
			    struct incise_error *err)
{
	double own = recording->meta.depth_mm_px;
	int rc;

	*near = (struct incise_camera_near){
		.mm_px = given ? given->depth_mm_px : own,
		/* Depth is that of a length in pixels less another: linear in it. */
		.scale = given ? given->depth_mm_px / own : 1,
	};
	near->picture[0].t_ns = near->picture[1].t_ns = INCISE_TIME_NONE;
	rc = incise_camera_near_any(recording, err);
	if (rc <= 0)
		return rc;
	near->open = true;
	rc = incise_rows_open(&near->rows, recording, "frames",
			      "seq, t_ns, depth_mm, sd_px, quality", "iinnn", UINT64_MAX,
			      err);
	if (!rc && given)
		incise_rows_calibrate(&near->rows, given);
	if (!rc)
		rc = more(near, err);
	return rc < 0 ? rc : 0;
}

void incise_camera_near_close(struct incise_camera_near *near)
{
	incise_rows_close(&near->rows);
}

static bool low(const struct incise_camera_picture *picture)
{
	return !(picture->quality >= INCISE_CAMERA_LOW_QUALITY);
}

int incise_camera_near_at(struct incise_camera_near *near, int64_t t_ns, double t_sd_s,
			  struct incise_camera_value *value, struct incise_error *err)
{
	const struct incise_camera_picture *a = &near->picture[0], *b = &near->picture[1];
	double s, slope, line, time;
	int rc = 1;

	*value = (struct incise_camera_value){NAN, NAN, NAN, NAN, true};
	while (rc > 0 && b->t_ns != INCISE_TIME_NONE && b->t_ns <= t_ns)
		rc = more(near, err);
	if (rc < 0)
		return rc;
	s = incise_row_share(a->t_ns, b->t_ns, t_ns);
	if (isnan(s) || isnan(a->depth_mm) || isnan(b->depth_mm))
		return 0;
	slope = (b->depth_mm - a->depth_mm) / ((double)(b->t_ns - a->t_ns) * 1e-9);
	line = (1 - s) * (1 - s) * a->sd_mm * a->sd_mm + s * s * b->sd_mm * b->sd_mm;
	time = (b->t_sd_s * b->t_sd_s + t_sd_s * t_sd_s) * slope * slope;
	value->depth_mm = a->depth_mm + s * (b->depth_mm - a->depth_mm);
	value->sd_mm = sqrt(line);
	value->u_mm = sqrt(line + time);
	value->quality = a->quality + s * (b->quality - a->quality);
	value->low_quality = low(a) || low(b);
	return 0;
}
