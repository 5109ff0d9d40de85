// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What is said of a calibrated actuator; see calibrate_stepper.h.
 */
#include <math.h>
#include <stdio.h>
#include "calibrate_report.h"
#include "calibrate_stepper.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/plot.h"

#define LISTED 20 /* outliers, at most */

static const char *const states[] = {"used", "turn", "saturated", "outlier"};

static void put_budget(const struct incise_calibrate_stepper *fit, FILE *out)
{
	fprintf(out,
		"\nUncertainty of N per microstep (k = 1)\n"
		"  %-28s %-4s %-12s %s\n",
		"source", "type", "u", "adds, N/step");
	for (int i = 0; i < fit->parts; i++) {
		const struct incise_calibrate_stepper_part *part = &fit->part[i];

		fprintf(out, "  %-28s %-4c %-9.3g %-2s %.3g\n", part->source, part->type,
			part->u, part->unit, part->u_N_step);
	}
	fprintf(out, "  %-28s %-17s %.3g   U = %.3g (k = 2), %.2f %%\n", "all", "",
		fit->N_step_u, 2 * fit->N_step_u, 200 * fit->N_step_u / fit->N_step);
}

static void put_rate(const struct stepper_rate *rate, FILE *out)
{
	if (rate->why)
		fprintf(out, "largest step rate  not measured: %s\n", rate->why);
	if (!rate->tried)
		return;
	if (!(rate->kept_1_s > 0))
		fprintf(out,
			"largest step rate  none found: even %.0f /s lost %.4f mm, and the strokes "
			"above were not much slower; see what blocks it\n",
			rate->lost_1_s, rate->lost_mm);
	else if (isnan(rate->lost_1_s))
		fprintf(out,
			"largest step rate  %.0f /s lost no step, which is as fast as this range "
			"and rig.conf let it go\n",
			rate->kept_1_s);
	else
		fprintf(out,
			"largest step rate  %.0f /s lost no step; %.0f /s lost %.4f mm; with a "
			"margin of 30 %%: %.0f /s\n",
			rate->kept_1_s, rate->lost_1_s, rate->lost_mm,
			0.7 * rate->kept_1_s);
	fprintf(out, "  %d strokes; a loss of %.4f mm would have been seen\n",
		rate->strokes, rate->seen_mm);
	if (rate->off_mm != 0)
		fprintf(out, "  the count is off by %.4f mm now: home it\n",
			rate->off_mm);
}

void stepper_report_text(const struct stepper_report *report, FILE *out)
{
	const struct incise_calibrate_stepper *fit = report->fit;
	const struct stepper_series *series = report->series;
	int listed = 0;

	fprintf(out,
		"%s: %d strokes, %.4g to %.4g mm, %.3f to %.3f N\n\n"
		"force per microstep %.6g N, U = %.2g N (k = 2)\n"
		"  per mm           %.5g N/mm, U = %.2g; a step is %.6g mm\n"
		"backlash           %.4f mm, U = %.4f; with friction at the sensor, which looks "
		"the same\n"
		"hysteresis         %.4f N, U = %.4f; %s\n"
		"stiction           %.4f N, U = %.4f; the force stands still for %.4f mm, %.0f "
		"steps\n",
		report->source, fit->strokes, fit->low_mm, fit->high_mm, fit->low_N,
		fit->high_N, fit->N_step, 2 * fit->N_step_u, fit->N_mm, 2 * fit->N_mm_u,
		report->setup->step_mm, fit->backlash_mm, 2 * fit->backlash_u_mm,
		fit->hysteresis_N, 2 * fit->hysteresis_u_N,
		fit->rest_N == 0  ? "none to be seen"
		: fit->rest_N > 0 ? "a loss, between the ways"
				  : "force comes late after turning round",
		fit->stiction_N, 2 * fit->stiction_u_N, fit->dead_mm,
		fit->dead_mm / report->setup->step_mm);
	put_rate(report->rate, out);
	fprintf(out,
		"linearity          %.2f %% of full scale; points lie %.2g N off their lines; "
		"strokes %.2g N apart\n",
		fit->linearity, fit->residual_sd_N, fit->drift_N);
	put_budget(fit, out);
	fprintf(out,
		"\n%d points: %d used, %d saturated, %d outliers, the rest behind turns\n",
		fit->points, fit->used, fit->saturated, fit->outliers);
	for (int i = 0; i < series->n && listed < LISTED; i++)
		if (series->states[i] >= INCISE_CALIBRATE_STEPPER_SATURATED) {
			fprintf(out, "  point %d: %.4f mm, %.4f N: %s\n", i + 1,
				series->points[i].position_mm, series->points[i].force_N,
				states[series->states[i]]);
			listed++;
		}
	fprintf(out, "%s: %s\n", fit->pass ? "pass" : "fail", report->record->verdict);
}

static json_t *budget_json(const struct incise_calibrate_stepper *fit)
{
	json_t *list = json_array();

	for (int i = 0; i < fit->parts; i++) {
		const struct incise_calibrate_stepper_part *part = &fit->part[i];

		json_array_append_new(list,
				      json_pack("{ss ss# so ss so}", "source",
						part->source, "type", &part->type, 1, "u",
						json_number(part->u), "unit", part->unit,
						"u_N_step", json_number(part->u_N_step)));
	}
	return list;
}

static json_t *rate_json(const struct stepper_rate *rate)
{
	if (!rate->tried)
		return json_null();
	return json_pack("{so so so so so si so}", "kept_1_s",
			 json_number(rate->kept_1_s), "lost_1_s",
			 json_number(rate->lost_1_s), "lost_mm",
			 json_number(rate->lost_mm), "limit_1_s",
			 json_number(rate->limit_1_s), "seen_mm",
			 json_number(rate->seen_mm), "strokes", rate->strokes, "off_mm",
			 json_number(rate->off_mm));
}

json_t *stepper_report_json(const struct stepper_report *report)
{
	const struct incise_calibrate_stepper *fit = report->fit;
	const struct {
		const char *key;
		double value;
	} numbers[] = {
		{"N_step", fit->N_step},
		{"N_step_u", fit->N_step_u},
		{"N_mm", fit->N_mm},
		{"N_mm_u", fit->N_mm_u},
		{"step_mm", report->setup->step_mm},
		{"backlash_mm", fit->backlash_mm},
		{"backlash_u_mm", fit->backlash_u_mm},
		{"hysteresis_N", fit->hysteresis_N},
		{"hysteresis_u_N", fit->hysteresis_u_N},
		{"stiction_N", fit->stiction_N},
		{"stiction_u_N", fit->stiction_u_N},
		{"dead_mm", fit->dead_mm},
		{"rest_N", fit->rest_N},
		{"rest_mm", fit->rest_mm},
		{"branches_mm", fit->branches_mm},
		{"linearity_percent", fit->linearity},
		{"low_mm", fit->low_mm},
		{"high_mm", fit->high_mm},
		{"low_N", fit->low_N},
		{"high_N", fit->high_N},
		{"residual_sd_N", fit->residual_sd_N},
		{"misfit", fit->misfit},
		{"drift_N", fit->drift_N},
	};
	json_t *object =
		json_pack("{so sb so si si si si si}", "source",
			  json_text(report->source), "pass", fit->pass, "verdict",
			  json_text(report->record->verdict), "points", fit->points,
			  "used", fit->used, "saturated", fit->saturated, "outliers",
			  fit->outliers, "strokes", fit->strokes);

	for (size_t i = 0; i < sizeof(numbers) / sizeof(*numbers); i++)
		json_object_set_new(object, numbers[i].key,
				    json_number(numbers[i].value));
	json_object_set_new(object, "budget", budget_json(fit));
	json_object_set_new(object, "rate", rate_json(report->rate));
	return object;
}

void stepper_report_folder(const struct stepper_report *report, const char *folder)
{
	const struct incise_calibrate_stepper *fit = report->fit;
	const struct stepper_series *series = report->series;
	const char *place, *name;
	struct incise_outfile *file;
	json_t *object;
	double before = NAN;
	char *path;
	FILE *data, *script;
	int up = 1;

	if (asprintf(&path, "%s/fit", folder) < 0)
		cli_fail("no memory");
	plot_place("report", path, &place, &name);
	data = plot_data(place, "points.dat");
	for (int i = 0; i < series->n; i++) {
		const struct incise_calibrate_stepper_point *p = &series->points[i];
		double line;

		if (p->position_mm != before && !isnan(before))
			up = p->position_mm > before;
		before = p->position_mm;
		line = (up ? fit->up_N : fit->down_N) + fit->N_mm * p->position_mm;
		fprintf(data, "%.6f %.6f %.6f %d %d\n", p->position_mm, p->force_N,
			p->force_N - line, up, (int)series->states[i]);
	}
	plot_data_end(data, place);
	script = plot_begin(place, "fit", 1000, 700);
	fprintf(script,
		"set xlabel 'position / mm'\nset ylabel 'force / N'\nset key top left\n"
		"plot 'points.dat' using 1:($4==1?$2:1/0) with points pt 8 title 'up', \\\n"
		"  '' using 1:($4==0?$2:1/0) with points pt 10 title 'down', \\\n"
		"  %.9g+%.9g*x title 'line up', %.9g+%.9g*x title 'line down'\n",
		fit->up_N, fit->N_mm, fit->down_N, fit->N_mm);
	if (!plot_draw(script, place, "fit"))
		cli_fail("gnuplot could not draw %s/fit", place);
	script = plot_begin(place, "residuals", 1000, 700);
	fprintf(script, "set xlabel 'position / mm'\nset ylabel 'off the line / N'\n"
			"plot 'points.dat' using 1:($5==0?$3:1/0) title 'used', \\\n"
			"  '' using 1:($5==1?$3:1/0) title 'behind turns', \\\n"
			"  '' using 1:($5>1?$3:1/0) pt 7 title 'left out'\n");
	if (!plot_draw(script, place, "residuals"))
		cli_fail("gnuplot could not draw %s/residuals", place);
	stepper_report_text(report, calibrate_report_text(place, &file));
	whole_file_end(file);
	object = stepper_report_json(report);
	calibrate_report_json(place, object);
	json_decref(object);
	free(path);
}
