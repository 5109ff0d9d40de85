// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The report of incise calibrate tip; see tip.h.
 */
#include "../../lib/base/vector.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "tip.h"

#define OUTLIERS_LISTED 20

void tip_text(const void *run, FILE *out)
{
	const struct tip *tip = run;
	const struct incise_tip_fit *fit = &tip->fit;
	int listed = 0;

	fprintf(out, "Tip of the blade in the frame of the tracker's sensor\n\n");
	fprintf(out, "Covariance, mm²\n");
	for (int i = 0; i < 3; i++)
		fprintf(out, "  %12.4e %12.4e %12.4e\n", fit->covariance[3 * i],
			fit->covariance[3 * i + 1], fit->covariance[3 * i + 2]);
	fprintf(out,
		"\n"
		"Budget           type  u         sensitivity\n"
		"pose residuals   A     %.4f mm rms, in %s of %d; "
		"the covariance is of these\n"
		"distortion       -     not known; its part that varies with the pose "
		"is in the residuals\n"
		"\n",
		fit->rms_mm, cli_count(fit->blocks, "independent block"), fit->block);
	fprintf(out,
		"%d poses, %d accepted; residuals %.4f mm rms, %.4f mm largest, %.4f "
		"mm rms held out\n"
		"cone %.1f degrees, least turned direction %.1f degrees, condition "
		"%.1f\n"
		"pivot at %.3f %.3f %.3f mm, drift %.4f mm (u %.4f mm)\n",
		fit->n, fit->inliers, fit->rms_mm, fit->largest_mm, fit->held_out_mm,
		fit->cone_deg, fit->least_deg, fit->condition, fit->pivot_mm[0],
		fit->pivot_mm[1], fit->pivot_mm[2], fit->moved_mm, fit->moved_sd_mm);
	if (fit->inliers < fit->n)
		fprintf(out, "left out:");
	for (int i = 0; i < tip->n; i++)
		if (!tip->inlier[i] && listed++ < OUTLIERS_LISTED)
			fprintf(out, " pose %d", i + 1);
	if (listed > OUTLIERS_LISTED)
		fprintf(out, " and %d more", listed - OUTLIERS_LISTED);
	if (listed)
		fputc('\n', out);
}

json_t *tip_json(const void *run)
{
#define FIELD(member) JSON_FIELD(struct incise_tip_fit, member)
#define FIELD_AS(key, member) JSON_FIELD_AS(key, struct incise_tip_fit, member)
	static const struct json_field fields[] = {
		FIELD_AS("poses", n), FIELD(inliers),
		FIELD(blocks),	      FIELD_AS("rms_error_mm", rms_mm),
		FIELD(largest_mm),    FIELD(held_out_mm),
		FIELD(cone_deg),      FIELD(least_deg),
		FIELD(condition),     FIELD(moved_mm),
		FIELD(moved_sd_mm),   {0}};
	const struct tip *tip = run;
	json_t *details = json_object(), *outliers = json_array();

	json_set_fields(details, fields, &tip->fit);
	json_object_set_new(details, "covariance_mm2",
			    json_numbers(tip->fit.covariance, 9));
	for (int i = 0; i < tip->n; i++)
		if (!tip->inlier[i])
			json_array_append_new(outliers, json_integer(i + 1));
	json_object_set_new(details, "outliers", outliers);
	return calibrate_json(&tip->common, details);
}

static void put_plot(const struct tip *tip, bool residuals, FILE *script)
{
	bool left_out = tip->fit.inliers < tip->n;
	int n = 0;

	if (residuals)
		fputs("set title 'Residuals of the tip, without poses left out'\n"
		      "set xlabel 'time / s'\nset ylabel 'residual of the tip / mm'\n"
		      "set autoscale xfix\neval key_below\n"
		      "plot for [k=2:4] 'poses.dat' using 1:(int($5) ? column(k) : NaN) "
		      "with points lt k-1 ps 0.35 title word('x y z', k-1)",
		      script);
	else {
		fputs("set title 'Positions of the sensor while the blade turns about its tip'\n"
		      "set size ratio -1\nset xlabel 'x of the sensor / mm'\n"
		      "set ylabel 'y of the sensor / mm'\neval key_below\n",
		      script);
		plot_add(
			script, &n,
			"'poses.dat' using 6:(int($5) ? $7 : NaN) with points lt 1 ps 0.35 "
			"title '%s'",
			left_out ? "used" : "");
		if (left_out)
			plot_add(
				script, &n,
				"'poses.dat' using 6:(int($5) ? NaN : $7) with points lt 2 "
				"pt 2 title 'left out'");
	}
	fputc('\n', script);
}

void tip_draw(const void *run, const char *folder)
{
	static const char *const plots[] = {"residuals", "fit"};
	const struct tip *tip = run;
	FILE *data = plot_data(folder, "poses.dat"), *script;

	for (int i = 0; i < tip->n; i++) {
		const struct incise_tip_pose *pose = &tip->poses[i];
		double r[3];

		/* R t + p - c */
		v3_rotate(r, pose->quaternion, tip->fit.tip_mm);
		v3_add(r, r, 1, pose->position_mm);
		v3_sub(r, r, tip->fit.pivot_mm);
		fprintf(data, "%.4f %.5f %.5f %.5f %d %.4f %.4f\n",
			(pose->t_ns - tip->poses[0].t_ns) * 1e-9, r[0], r[1], r[2],
			tip->inlier[i], pose->position_mm[0], pose->position_mm[1]);
	}
	plot_data_end(data, folder);
	for (int i = 0; i < 2; i++) {
		script = plot_begin(folder, plots[i], 900, 560);
		put_plot(tip, !i, script);
		calibrate_draw(script, folder, plots[i]);
	}
}
