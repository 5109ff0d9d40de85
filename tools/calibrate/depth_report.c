// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The report of a calibration of depth; see depth.h.
 */
#include <math.h>
#include <string.h>
#include "../cli/json.h"
#include "../cli/plot.h"
#include "depth.h"

#define OUTLIERS_SHOWN 20

const char *const depth_methods[] = {"two-point", "line", "board", NULL};

static const struct incise_depth_part *find_budget(const struct depth *r, int *n)
{
	*n = r->method == DEPTH_BOARD ? r->board.n_parts : r->fit.n_parts;
	return r->method == DEPTH_BOARD ? r->board.part : r->fit.part;
}

static double residual_mm(const struct depth *r, int i)
{
	const struct incise_depth_fit *fit = &r->fit;

	if (r->method == DEPTH_LINE)
		return r->lengths.mm[i] - fit->mm_px * (fit->full_px - r->lengths.px[i]);
	return (r->lengths.px[i] - fit->full_px) * fit->mm_px;
}

static void budget_text(const struct depth *r, FILE *out)
{
	double value = r->common.record.values[0].left, u = r->common.record.values[0].u;
	int n;
	const struct incise_depth_part *part = find_budget(r, &n);

	fprintf(out, "\n%-36s type  %-18s %-14s contribution\n", "budget of depth_mm_px",
		"u", "sensitivity");
	for (int i = 0; i < n; i++) {
		char text[40];

		snprintf(text, sizeof(text), "%.3g %s", part[i].u, part[i].unit);
		fprintf(out, "%-36s %c     %-18s %-14.4g %.3g mm/px\n", part[i].name,
			part[i].type, text, part[i].sensitivity,
			fabs(part[i].u * part[i].sensitivity));
	}
	fprintf(out, "%-36s       %-18s %-14s %.3g mm/px (%.3f %%)\n", "together", "", "",
		u, 100 * u / value);
}

static void lengths_text(const struct depth *r, FILE *out)
{
	const struct incise_depth_fit *fit = &r->fit;
	int shown = 0;

	fprintf(out, "full_px        %.3f, u %.3f\n", fit->full_px, fit->u_full_px);
	fprintf(out, "readings       %d (%d accepted, effective n = %d)\n", fit->n,
		fit->inliers, fit->effective);
	if (isfinite(fit->sd_mm))
		fprintf(out, "residuals      sd %.4f mm, largest %.4f mm\n", fit->sd_mm,
			fit->largest_mm);
	if (isfinite(fit->bend_mm))
		fprintf(out,
			"bend           %.4f mm, u %.4f mm: difference of a parabola "
			"at the ends\n",
			fit->bend_mm, fit->bend_sd_mm);
	fprintf(out, "range          %.1f to %.1f px\n", fit->low_px, fit->high_px);
	for (int i = 0; i < fit->n; i++)
		if (!r->inlier[i] && shown++ < OUTLIERS_SHOWN)
			fprintf(out, "outlier        %s: %.2f px%s\n", r->lengths.name[i],
				r->lengths.px[i],
				r->method == DEPTH_LINE &&
						r->lengths.mm[i] > r->lengths.px[i]
					? "; the columns may be swapped"
					: "");
	if (shown > OUTLIERS_SHOWN)
		fprintf(out, "outliers       %d more\n", shown - OUTLIERS_SHOWN);
}

static void board_text(const struct depth *r, FILE *out)
{
	const struct incise_board_fit *b = &r->board;
	const struct incise_board_lens *l = &b->lens, *u = &b->u_lens;

	fprintf(out, "views          %d (%d accepted), %.1f degrees apart\n", b->n,
		b->views, b->spread_deg);
	fprintf(out,
		"corners        %.3f px (rms) off the board; in the plane %.4f mm, "
		"largest %.4f mm\n",
		b->rms_px, b->plane_rms_mm, b->plane_largest_mm);
	fprintf(out,
		"lens           fx %.2f (u %.2f), fy %.2f (u %.2f), cx %.2f (u %.2f), "
		"cy %.2f (u %.2f) px\n",
		l->fx, u->fx, l->fy, u->fy, l->cx, u->cx, l->cy, u->cy);
	fprintf(out,
		"distortion     k1 %.4f (u %.4f), k2 %.4f (u %.4f), p1 %.5f (u %.5f), "
		"p2 %.5f (u %.5f)\n",
		l->k1, u->k1, l->k2, u->k2, l->p1, u->p1, l->p2, u->p2);
	fprintf(out,
		"plane          tilted by %.2f degrees, at most %.2f (k = 2); %.0f mm "
		"away\n",
		b->tilt_deg, b->tilt_deg + 2 * b->u_tilt_deg, b->distance_mm);
	fprintf(out, "region         %.6f to %.6f mm/px along the handle\n", b->low_mm_px,
		b->high_mm_px);
	fprintf(out, "one scale      is off by up to %.4f mm along the handle\n",
		b->bend_mm);
	fprintf(out, "homography     [%.6g %.6g %.6g; %.6g %.6g %.6g; %.6g %.6g %.6g]\n",
		b->homography[0], b->homography[1], b->homography[2], b->homography[3],
		b->homography[4], b->homography[5], b->homography[6], b->homography[7],
		b->homography[8]);
	for (int v = 0; v < b->n; v++)
		if (!b->believed[v])
			fprintf(out, "outlier        view %s: %.2f px\n",
				r->corners.name[v], b->view_rms_px[v]);
}

static void vision_text(const struct depth *r, FILE *out)
{
	const struct incise_vision_setup *s = &r->setup;

	if (r->method == DEPTH_BOARD || !r->found_setup)
		return;
	fprintf(out,
		"\nfor rig.conf:\nvision = {\n\thue = [%d, %d];\n\tsaturation = [%d, %d];\n"
		"\tvalue = [%d, %d];\n\tfull_px = %.3f;\n};\n",
		s->hue[0], s->hue[1], s->saturation[0], s->saturation[1], s->value[0],
		s->value[1], r->fit.full_px);
}

void depth_text(const void *run, FILE *out)
{
	const struct depth *r = run;

	fprintf(out, "method         %s\n", r->common.record.method);
	if (r->method == DEPTH_BOARD)
		board_text(r, out);
	else
		lengths_text(r, out);
	budget_text(r, out);
	vision_text(r, out);
}

/* --- JSON ---------------------------------------------------------------------------- */

#define FIELD(key, member) JSON_FIELD_AS(key, struct incise_depth_fit, member)

static const struct json_field length_fields[] = {FIELD("full_px", full_px),
						  FIELD("full_u_px", u_full_px),
						  FIELD("readings", n),
						  FIELD("inliers", inliers),
						  FIELD("effective", effective),
						  FIELD("residual_sd_mm", sd_mm),
						  FIELD("residual_max_mm", largest_mm),
						  FIELD("bend_mm", bend_mm),
						  FIELD("bend_u_mm", bend_sd_mm),
						  {0}};

static void lengths_json(const struct depth *r, json_t *object)
{
	const struct incise_depth_fit *fit = &r->fit;
	json_t *outliers = json_array();

	json_set_fields(object, length_fields, fit);
	for (int i = 0; i < fit->n; i++)
		if (!r->inlier[i])
			json_array_append_new(outliers, json_text(r->lengths.name[i]));
	json_object_set_new(object, "outliers", outliers);
	if (r->found_setup) {
		const struct incise_vision_setup *s = &r->setup;

		json_object_set_new(object, "vision",
				    json_pack("{s[ii]s[ii]s[ii]}", "hue", s->hue[0],
					      s->hue[1], "saturation", s->saturation[0],
					      s->saturation[1], "value", s->value[0],
					      s->value[1]));
	}
}

#define LENS(key, member) JSON_FIELD_AS(key, struct incise_board_lens, member)
#define BOARD(key, member) JSON_FIELD_AS(key, struct incise_board_fit, member)

static const struct json_field lens_fields[] = {
	LENS("fx_px", fx), LENS("fy_px", fy), LENS("cx_px", cx),
	LENS("cy_px", cy), LENS("k1", k1),    LENS("k2", k2),
	LENS("p1", p1),	   LENS("p2", p2),    {0}};

static const struct json_field fit_fields[] = {BOARD("views", n),
					       BOARD("inliers", views),
					       BOARD("rms_error_px", rms_px),
					       BOARD("plane_rms_error_mm", plane_rms_mm),
					       BOARD("plane_max_mm", plane_largest_mm),
					       BOARD("tilt_deg", tilt_deg),
					       {0}};

static const struct json_field plane_fields[] = {
	BOARD("distance_mm", distance_mm), BOARD("spread_deg", spread_deg),
	BOARD("low_mm_px", low_mm_px),	   BOARD("high_mm_px", high_mm_px),
	BOARD("bend_mm", bend_mm),	   {0}};

static void board_json(const struct depth *r, json_t *object)
{
	const struct incise_board_fit *b = &r->board;
	json_t *lens = json_object(), *outliers = json_array();

	json_set_fields(lens, lens_fields, &b->lens);
	json_object_set_new(object, "lens", lens);
	json_object_set_new(object, "homography", json_numbers(b->homography, 9));
	json_set_fields(object, fit_fields, b);
	json_set_number(object, "tilt_bound_deg", b->tilt_deg + 2 * b->u_tilt_deg);
	json_set_fields(object, plane_fields, b);
	for (int v = 0; v < b->n; v++)
		if (!b->believed[v])
			json_array_append_new(outliers, json_text(r->corners.name[v]));
	json_object_set_new(object, "outliers", outliers);
}

json_t *depth_json(const void *run)
{
	const struct depth *r = run;
	const struct incise_calibration_value *value = &r->common.record.values[0];
	json_t *object = json_object(), *budget = json_array();
	int n;
	const struct incise_depth_part *part = find_budget(r, &n);

	json_object_set_new(object, "way", json_string(depth_methods[r->method]));
	json_object_set_new(object, "pass", json_boolean(r->common.record.pass));
	json_object_set_new(object, "in_force",
			    json_boolean(r->common.record.pass && !r->common.dry_run));
	json_object_set_new(object, "verdict", json_text(r->common.record.verdict));
	json_set_number(object, "depth_mm_px", value->left);
	json_set_number(object, "u_mm_px", value->u);
	json_set_number(object, "U_mm_px", 2 * value->u);
	json_set_number(object, "found_mm_px", value->found);
	for (int i = 0; i < n; i++) {
		char kind[2] = {part[i].type, 0};

		json_array_append_new(budget,
				      json_pack("{ssssssso so}", "name", part[i].name,
						"type", kind, "unit", part[i].unit, "u",
						json_number(part[i].u), "sensitivity",
						json_number(part[i].sensitivity)));
	}
	json_object_set_new(object, "budget", budget);
	if (r->method == DEPTH_BOARD)
		board_json(r, object);
	else
		lengths_json(r, object);
	return object;
}

/* --- folder -------------------------------------------------------------------------- */

static void lengths_data(const struct depth *r, FILE *data)
{
	for (int i = 0; i < r->fit.n; i++)
		fprintf(data, "%d %.5f %.6f %.6f %d\n", i + 1, r->lengths.px[i],
			r->lengths.mm[i], residual_mm(r, i), r->inlier[i]);
}

static void board_data(const struct depth *r, FILE *data)
{
	const struct incise_board_views *v = &r->views;
	int corners = v->columns * v->rows;
	double sx = 0, sy = 0, at[2], c = 0, s = 0, angle, mean[2] = {0};

	/* The rotation and translation of the board's own frame onto the plane. */
	for (int i = 0; i < corners; i++) {
		const double *px = v->corners + 2 * ((size_t)corners * v->plane + i);

		incise_board_plane(&r->board, px[0], px[1], at);
		mean[0] += at[0] / corners;
		mean[1] += at[1] / corners;
		sx += (double)(i % v->columns) / corners;
		sy += (double)(i / v->columns) / corners;
	}
	for (int i = 0; i < corners; i++) {
		const double *px = v->corners + 2 * ((size_t)corners * v->plane + i);
		double x = (i % v->columns - sx) * v->square_mm;
		double y = (i / v->columns - sy) * v->square_mm;

		incise_board_plane(&r->board, px[0], px[1], at);
		c += x * (at[0] - mean[0]) + y * (at[1] - mean[1]);
		s += x * (at[1] - mean[1]) - y * (at[0] - mean[0]);
	}
	angle = atan2(s, c);
	for (int i = 0; i < corners; i++) {
		const double *px = v->corners + 2 * ((size_t)corners * v->plane + i);
		double x = (i % v->columns - sx) * v->square_mm;
		double y = (i / v->columns - sy) * v->square_mm, dx, dy;

		incise_board_plane(&r->board, px[0], px[1], at);
		dx = at[0] - mean[0];
		dy = at[1] - mean[1];
		fprintf(data, "%.3f %.3f %.5f %.5f %.5f %.5f\n", px[0], px[1], x, y,
			dx * cos(angle) + dy * sin(angle) - x,
			dy * cos(angle) - dx * sin(angle) - y);
	}
}

static void draw_fit(const struct depth *r, bool line, bool outliers, FILE *script)
{
	const char *columns = line ? "2:($5 > 0 ? $3 : NaN)" : "1:($5 > 0 ? $2 : NaN)";
	const char *others = line ? "2:($5 > 0 ? NaN : $3)" : "1:($5 > 0 ? NaN : $2)";
	int n = 0;

	if (r->method == DEPTH_BOARD) {
		fputs("set title 'Corners of the board in the frame of its plane'\n"
		      "set xlabel 'x / px'\nset ylabel 'y / px'\n"
		      "set yrange [*:*] reverse\nset size ratio -1\n"
		      "plot 'depth.dat' using 1:2 with points lt 1\n",
		      script);
		return;
	}
	fprintf(script,
		"set title '%s'\nset xlabel '%s'\nset ylabel '%s'\neval key_below\n",
		line ? "Depth over the exposed length"
		     : "Exposed length in the air, reading by reading",
		line ? "exposed length / px" : "number of the reading / 1",
		line ? "depth / mm" : "exposed length / px");
	plot_add(script, &n, "'depth.dat' using %s with points lt 1 title '%s'", columns,
		 line ? "pairs" : "readings");
	if (outliers)
		plot_add(script, &n,
			 "'depth.dat' using %s with points lt 2 pt 2 title 'outliers'",
			 others);
	if (line)
		plot_add(script, &n, "%.12g * (%.12g - x) lt 3 title 'fit'", r->fit.mm_px,
			 r->fit.full_px);
	else
		plot_add(script, &n, "%.12g lt 3 title 'mean'", r->fit.full_px);
	fputc('\n', script);
}

void depth_draw(const void *run, const char *folder)
{
	const struct depth *r = run;
	FILE *script, *data = plot_data(folder, "depth.dat");
	bool line = r->method == DEPTH_LINE, board = r->method == DEPTH_BOARD;
	bool outliers = false;

	if (board)
		board_data(r, data);
	else
		lengths_data(r, data);
	plot_data_end(data, folder);
	for (int i = 0; !board && i < r->fit.n; i++)
		outliers |= !r->inlier[i];
	script = plot_begin(folder, "fit", 900, 560);
	draw_fit(r, line, outliers, script);
	calibrate_draw(script, folder, "fit");
	script = plot_begin(folder, "residuals", 900, 560);
	if (!board)
		fprintf(script,
			"set title 'Residuals of the fit, without outliers'\n"
			"set xlabel '%s'\nset ylabel 'residual of the depth / mm'\n"
			"plot 'depth.dat' using %d:($5 > 0 ? $4 : NaN) with points lt 1, "
			"0 lt 3 lw 1\n",
			line ? "exposed length / px" : "number of the reading / 1",
			line ? 2 : 1);
	else
		fputs("set title 'Residuals of the corners in the plane, 100 times as large'\n"
		      "set xlabel 'x on the board / mm'\nset ylabel 'y on the board / mm'\n"
		      "set size ratio -1\n"
		      "plot 'depth.dat' using 3:4:($5 * 100):($6 * 100) with vectors lt 1\n",
		      script);
	calibrate_draw(script, folder, "residuals");
}
