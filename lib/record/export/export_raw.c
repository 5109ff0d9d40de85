// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Rows of cuts as they are: each force sample, or means over 1/rate; see export_pass.h.
 */
#include <math.h>
#include "export_pass.h"

const struct incise_column incise_export_raw_columns[INCISE_EXPORT_RAW_COLUMNS] = {
	INCISE_EXPORT_CUT,
	{"t_s", "s", "since the recording's first force sample", INCISE_COLUMN_REAL, 6},
	{"depth_mm", "mm", "of the tip below the surface", INCISE_COLUMN_SINGLE, 4},
	{"velocity_mm_s", "mm/s", "speed of the tip", INCISE_COLUMN_SINGLE, 3},
	{"force_N", "N", "on the blade", INCISE_COLUMN_SINGLE, 5},
	{"clipped", "1", "1: the converter was at an end", INCISE_COLUMN_FLAG, 0},
};

struct raw {
	struct incise_export_bin row;
	int64_t slot; /* of the row, 1/rate each */
};

static int put_row(struct incise_export_pass *pass)
{
	struct raw *raw = pass->made;
	const struct incise_export_bin *row = &raw->row;
	int name, rc;

	if (!row->n)
		return 0;
	name = incise_export_cut_name(pass);
	if (name < 0)
		return name;
	rc = incise_table_add(pass->table,
			      (union incise_cell[]){
				      {.integer = name},
				      {.real = row->t_s},
				      {.real = row->depth_mm},
				      {.real = row->velocity_mm_s},
				      {.real = row->force_N},
				      {.integer = row->clipped},
			      },
			      pass->err);
	pass->report.rows++;
	raw->row = (struct incise_export_bin){0};
	return rc;
}

static int add(struct incise_export_pass *pass, const struct incise_cut_sample *sample,
	       double t_s)
{
	struct raw *raw = pass->made;
	double rate = pass->options->rate_hz;
	/* Times are whole ns: half of one keeps a sample on the edge in its own slot. */
	int64_t slot = rate > 0 ? (int64_t)floor((t_s + 0.5e-9) * rate) : raw->slot + 1;
	int rc;

	incise_export_extent(pass, sample);
	pass->report.clipped += sample->clipped;
	rc = slot != raw->slot ? put_row(pass) : 0;

	raw->slot = slot;
	incise_export_bin_add(&raw->row, sample, t_s, pass->cut);
	return rc;
}

int incise_export_raw(struct incise_export_pass *pass,
		      struct incise_recording *const *recordings, int n)
{
	static const struct incise_export_visitor rows = {add, put_row};
	struct raw raw = {0};

	pass->made = &raw;
	return incise_export_each(pass, recordings, n, &rows);
}
