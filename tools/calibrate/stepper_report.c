// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The report of incise calibrate stepper; see stepper.h.
 */
#include <math.h>
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/uncertainty.h"
#include "stepper.h"

#define LISTED 20 /* outliers, at most */

static const char *const states[] = {"used", "turn", "saturated", "outlier"};

static const char *source_of(const struct stepper *stepper)
{
	return stepper->common.from ? stepper->common.from
				    : stepper->common.record.device;
}

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
			"largest step rate  none found: even %.0f /s lost %.4f mm, and "
			"the strokes above were not much slower; check what blocks it\n",
			rate->lost_1_s, rate->lost_mm);
	else if (isnan(rate->lost_1_s))
		fprintf(out,
			"largest step rate  %.0f /s lost no step; this range and "
			"rig.conf allow no faster\n",
			rate->kept_1_s);
	else
		fprintf(out,
			"largest step rate  %.0f /s lost no step; %.0f /s lost %.4f mm; with a "
			"margin of 30 %%: %.0f /s\n",
			rate->kept_1_s, rate->lost_1_s, rate->lost_mm,
			0.7 * rate->kept_1_s);
	fprintf(out, "  %s; detection limit %.4f mm\n",
		cli_count(rate->strokes, "stroke"), rate->seen_mm);
	if (rate->off_mm != 0)
		fprintf(out,
			"  the position count is off by %.4f mm now; run incise "
			"stepper home\n",
			rate->off_mm);
}

void stepper_text(const void *run, FILE *out)
{
	const struct stepper *stepper = run;
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	char per_mm[UNCERTAINTY_TEXT];
	int listed = 0;

	fprintf(out,
		"%s: %d strokes, %.4g to %.4g mm, %.3f to %.3f N\n"
		"\n"
		"stiffness          %s (k = 2); a step is %.6g mm\n"
		"backlash           no change of force for %.4f mm, %.0f steps; includes "
		"friction at the sensor\n"
		"hysteresis         %s\n",
		source_of(stepper), fit->strokes, fit->low_mm, fit->high_mm, fit->low_N,
		fit->high_N, uncertainty_text(fit->N_mm, 2 * fit->N_mm_u, "N/mm", per_mm),
		stepper->setup.step_mm, fit->dead_mm,
		fit->dead_mm / stepper->setup.step_mm,
		fit->rest_N == 0  ? "below detection limit"
		: fit->rest_N > 0 ? "loss between the two directions"
				  : "force lags after reversals");
	put_rate(&stepper->rate, out);
	fprintf(out,
		"linearity          %.2f %% of full scale; points lie %.2g N off their lines; "
		"strokes %.2g N apart\n",
		fit->linearity, fit->residual_sd_N, fit->drift_N);
	put_budget(fit, out);
	fprintf(out,
		"\n"
		"%s: %d used, %d saturated, %s, %d excluded after "
		"reversals\n",
		cli_count(fit->points, "point"), fit->used, fit->saturated,
		cli_count(fit->outliers, "outlier"),
		fit->points - fit->used - fit->saturated - fit->outliers);
	for (int i = 0; i < stepper->n && listed < LISTED; i++)
		if (stepper->states[i] >= INCISE_CALIBRATE_STEPPER_SATURATED) {
			fprintf(out, "  point %d: %.4f mm, %.4f N: %s\n", i + 1,
				stepper->points[i].position_mm,
				stepper->points[i].force_N, states[stepper->states[i]]);
			listed++;
		}
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

#define FIELD(member) JSON_FIELD(struct incise_calibrate_stepper, member)

static const struct json_field counts[] = {
	FIELD(points), FIELD(used),	FIELD(saturated), FIELD(outliers), FIELD(strokes),
	FIELD(N_step), FIELD(N_step_u), FIELD(N_mm),	  FIELD(N_mm_u),   {0}};

static const struct json_field losses[] = {
	FIELD(backlash_mm),
	FIELD(backlash_u_mm),
	FIELD(hysteresis_N),
	FIELD(hysteresis_u_N),
	FIELD(stiction_N),
	FIELD(stiction_u_N),
	FIELD(dead_mm),
	FIELD(rest_N),
	FIELD(rest_mm),
	FIELD(branches_mm),
	JSON_FIELD_AS("linearity_percent", struct incise_calibrate_stepper, linearity),
	FIELD(low_mm),
	FIELD(high_mm),
	FIELD(low_N),
	FIELD(high_N),
	FIELD(residual_sd_N),
	FIELD(misfit),
	FIELD(drift_N),
	{0}};

json_t *stepper_json(const void *run)
{
	const struct stepper *stepper = run;
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	json_t *object = json_pack("{so sb so}", "source", json_text(source_of(stepper)),
				   "pass", fit->pass, "verdict",
				   json_text(stepper->common.record.verdict));

	json_set_fields(object, counts, fit);
	json_set_number(object, "step_mm", stepper->setup.step_mm);
	json_set_fields(object, losses, fit);
	json_object_set_new(object, "budget", budget_json(fit));
	json_object_set_new(object, "rate", rate_json(&stepper->rate));
	return object;
}

static bool has_state(const struct stepper *stepper, int from, int to)
{
	for (int i = 0; i < stepper->n; i++)
		if ((int)stepper->states[i] >= from && (int)stepper->states[i] <= to)
			return true;
	return false;
}

static void draw_plots(const struct stepper *stepper, const char *folder)
{
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	FILE *script = plot_begin(folder, "fit", 900, 560);
	int n = 0;

	fprintf(script,
		"set title 'Force of the actuator over its position, and fitted lines'\n"
		"set xlabel 'position / mm'\nset ylabel 'force / N'\neval key_below\n"
		"plot 'points.dat' using 1:($4==1?$2:NaN) with points lt 1 pt 9 title 'up', \\\n"
		"  '' using 1:($4==0?$2:NaN) with points lt 2 pt 11 title 'down', \\\n"
		"  %.9g+%.9g*x lt 1 title 'line, up', %.9g+%.9g*x lt 2 title 'line, down'\n",
		fit->up_N, fit->N_mm, fit->down_N, fit->N_mm);
	calibrate_draw(script, folder, "fit");
	script = plot_begin(folder, "residuals", 900, 560);
	fputs("set title 'Residuals of the force from the fitted lines'\n"
	      "set xlabel 'position / mm'\nset ylabel 'residual of the force / N'\n"
	      "eval key_below\n",
	      script);
	plot_add(script, &n,
		 "'points.dat' using 1:($5==0?$3:NaN) with points lt 1 title 'used'");
	if (has_state(stepper, INCISE_CALIBRATE_STEPPER_TURN,
		      INCISE_CALIBRATE_STEPPER_TURN))
		plot_add(
			script, &n,
			"'points.dat' using 1:($5==1?$3:NaN) with points lt 8 title 'after a turn'");
	if (has_state(stepper, INCISE_CALIBRATE_STEPPER_SATURATED,
		      INCISE_CALIBRATE_STEPPER_OUTLIER))
		plot_add(
			script, &n,
			"'points.dat' using 1:($5>1?$3:NaN) with points lt 2 pt 2 title 'left out'");
	fputc('\n', script);
	calibrate_draw(script, folder, "residuals");
}

void stepper_draw(const void *run, const char *folder)
{
	const struct stepper *stepper = run;
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	FILE *data = plot_data(folder, "points.dat");
	double before = NAN;
	int up = 1;

	for (int i = 0; i < stepper->n; i++) {
		const struct incise_calibrate_stepper_point *p = &stepper->points[i];
		double line;

		if (p->position_mm != before && !isnan(before))
			up = p->position_mm > before;
		before = p->position_mm;
		line = (up ? fit->up_N : fit->down_N) + fit->N_mm * p->position_mm;
		fprintf(data, "%.6f %.6f %.6f %d %d\n", p->position_mm, p->force_N,
			p->force_N - line, up, (int)stepper->states[i]);
	}
	plot_data_end(data, folder);
	draw_plots(stepper, folder);
}
