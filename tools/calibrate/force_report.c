// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The report of incise calibrate force; see force.h.
 */
#include <math.h>
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/uncertainty.h"
#include "force.h"

static const char *const states[] = {
	[INCISE_CALIBRATE_FORCE_USED] = "used",
	[INCISE_CALIBRATE_FORCE_SATURATED] = "saturated",
	[INCISE_CALIBRATE_FORCE_OUTLIER] = "outlier",
};

static void print_metric(FILE *out, const char *name, double value, const char *unit)
{
	if (isnan(value))
		fprintf(out, "%-15s not stated\n", name);
	else
		fprintf(out, "%-15s %.3g %s\n", name, value, unit);
}

static void print_metrics(const struct force *force, FILE *out)
{
	const struct incise_calibrate_force *r = &force->result;
	char text[UNCERTAINTY_TEXT];

	fprintf(out, "%-15s %s (k = 2), %.2g %%\n", "sensitivity",
		uncertainty_text(r->sensitivity_mV_N, 2 * r->sensitivity_u_mV_N, "mV/N",
				 text),
		200 * r->sensitivity_u_mV_N / r->sensitivity_mV_N);
	fprintf(out, "%-15s %s (k = 2)\n", "zero",
		uncertainty_text(r->zero_mV, 2 * r->zero_u_mV, "mV", text));
	fprintf(out, "%-15s %.3g mV, scatter of one load %.3g mV\n", "residual sd",
		r->residual_sd_mV, r->scatter_sd_mV);
	print_metric(out, "linearity", r->linearity,
		     "% of full scale, best straight line");
	print_metric(out, "hysteresis", r->hysteresis, "% of full scale");
	print_metric(out, "repeatability", r->repeatability, "% of full scale");
	print_metric(out, "zero return", r->zero_return, "% of full scale");
	print_metric(out, "resolution", 1e3 * r->resolution_N, "mN");
	fprintf(out, "%-15s %.3g N to %.4g N", "range", r->low_N, r->high_N);
	if (isnan(r->clips_N))
		fprintf(out, "\n");
	else
		fprintf(out, "; the converter ends at %.4g N\n", r->clips_N);
	fprintf(out, "%-15s %d of %d used, %s, %d series; %d saturated, %s\n", "pairs",
		r->used, r->pairs, cli_count(r->loads, "load"), r->series, r->saturated,
		cli_count(r->outliers, "outlier"));
	if (r->misfit > 1)
		fprintf(out,
			"%-15s loads deviate from a line by %.1f times their "
			"uncertainty; U is widened by this factor\n",
			"misfit", r->misfit);
}

static void print_budget(const struct force *force, FILE *out)
{
	const struct incise_calibrate_force *r = &force->result;
	const struct incise_calibrate_force_setup *s = &force->setup;

	fprintf(out,
		"\n"
		"Uncertainty budget of the sensitivity (standard uncertainties)\n"
		"\n"
		"%-28s %-4s %-18s %-20s %s\n",
		"source", "type", "u", "sensitivity", "u, mV/N");
	for (int i = 0; i < r->parts; i++) {
		const struct incise_calibrate_force_part *part = &r->part[i];
		char u[24], c[32];

		snprintf(u, sizeof(u), "%.3g %s", part->u, part->unit);
		snprintf(c, sizeof(c), "%.3g mV/N per %s", part->sensitivity, part->unit);
		fprintf(out, "%-28s %-4c %-18s %-20s %.4f\n", part->source, part->type, u,
			c, part->u_mV_N);
	}
	fprintf(out, "%-28s %-4s %-18s %-20s %.4f\n\n", "root sum of squares", "", "", "",
		r->sensitivity_u_mV_N);
	fprintf(out,
		"Type A has %d degrees of freedom, and is widened so that k = 2 covers "
		"95 %%.\n"
		"Gravity %.5f m/s2, u = %.2g, %s. Air %.3g kg/m3, weights %.5g kg/m3.\n"
		"The scale resolves %.3g g: rectangular distribution, one error for "
		"each load weighed.\n",
		r->freedom, s->gravity_m_s2, s->gravity_u_m_s2, force->gravity,
		s->air_kg_m3, s->weight_kg_m3, s->scale_g);
}

static double residual_mV(const struct force *force, int i)
{
	return force->pairs[i].reading_mV - force->result.zero_mV -
	       force->result.sensitivity_mV_N *
		       incise_calibrate_force_of(&force->pairs[i], &force->setup);
}

/* All pairs, or those that were left out. */
static void print_pairs(const struct force *force, bool all, FILE *out)
{
	for (int i = 0; i < force->n; i++) {
		const struct incise_calibrate_force_pair *p = &force->pairs[i];

		if (!all && force->states[i] == INCISE_CALIBRATE_FORCE_USED)
			continue;
		fprintf(out, "pair %-4d %10.5f N %10.2f mV  series %d %-4s  %s", i + 1,
			incise_calibrate_force_of(p, &force->setup), p->reading_mV,
			p->series, p->descending ? "down" : "up",
			states[force->states[i]]);
		if (!force->common.refused)
			fprintf(out, ", %+.2f mV off", residual_mV(force, i));
		fputc('\n', out);
	}
}

void force_summary(const void *run, FILE *out)
{
	print_metrics(run, out);
	print_pairs(run, false, out);
}

void force_text(const void *run, FILE *out)
{
	const struct force *force = run;
	const struct incise_calibration_record *record = &force->common.record;

	fprintf(out, "Calibration of a force channel, %s\n%s\n%s\n\n", record->date,
		record->device, record->method);
	if (force->common.refused) {
		fprintf(out, "refused: %s\n", force->common.refused);
	} else {
		print_metrics(force, out);
		print_budget(force, out);
	}
	fputc('\n', out);
	print_pairs(force, true, out);
}

static json_t *json_budget(const struct incise_calibrate_force *r)
{
	json_t *list = json_array();

	for (int i = 0; i < r->parts; i++) {
		const struct incise_calibrate_force_part *part = &r->part[i];
		const char type[2] = {part->type};

		json_array_append_new(
			list, json_pack("{s:o, s:s, s:o, s:s, s:o, s:o}", "source",
					json_text(part->source), "type", type, "u",
					json_number(part->u), "unit", part->unit,
					"sensitivity", json_number(part->sensitivity),
					"u_mV_N", json_number(part->u_mV_N)));
	}
	return list;
}

static json_t *json_pairs(const struct force *force)
{
	json_t *list = json_array();

	for (int i = 0; i < force->n; i++) {
		const struct incise_calibrate_force_pair *p = &force->pairs[i];

		json_array_append_new(
			list, json_pack("{s:o, s:o, s:i, s:b, s:s}", "force_N",
					json_number(incise_calibrate_force_of(
						p, &force->setup)),
					"reading_mV", json_number(p->reading_mV),
					"series", p->series, "descending", p->descending,
					"state", states[force->states[i]]));
	}
	return list;
}

#define FIELD(member) JSON_FIELD(struct incise_calibrate_force, member)
#define FIELD_AS(key, member) JSON_FIELD_AS(key, struct incise_calibrate_force, member)

static const struct json_field fields[] = {FIELD(zero_mV),	  FIELD(zero_u_mV),
					   FIELD(residual_sd_mV), FIELD(scatter_sd_mV),
					   FIELD(misfit),	  {0}};

static const struct json_field metrics[] = {FIELD_AS("linearity_percent", linearity),
					    FIELD_AS("hysteresis_percent", hysteresis),
					    FIELD_AS("repeatability_percent",
						     repeatability),
					    FIELD_AS("zero_return_percent", zero_return),
					    FIELD(resolution_N),
					    FIELD(low_N),
					    FIELD(high_N),
					    FIELD(clips_N),
					    FIELD(used),
					    FIELD(saturated),
					    FIELD(outliers),
					    FIELD(loads),
					    FIELD(series),
					    FIELD(pass),
					    {0}};

json_t *force_json(const void *run)
{
	const struct force *force = run;
	const struct incise_calibrate_force *r = &force->result;
	const struct incise_calibration_record *record = &force->common.record;
	json_t *root = json_pack("{s:s, s:o, s:o, s:o, s:o}", "kind", record->kind,
				 "date", json_text(record->date), "device",
				 json_text(record->device), "method",
				 json_text(record->method), "pairs", json_pairs(force));

	if (force->common.refused) {
		json_object_set_new(root, "refused", json_text(force->common.refused));
		json_object_set_new(root, "pass", json_false());
		return root;
	}
	json_set_number(root, "found_mV_N", force->common.found.force_mV_N);
	json_set_number(root, "sensitivity_mV_N", r->sensitivity_mV_N);
	json_set_number(root, "sensitivity_u_mV_N", r->sensitivity_u_mV_N);
	json_set_number(root, "sensitivity_U_mV_N", 2 * r->sensitivity_u_mV_N);
	json_set_fields(root, fields, r);
	json_object_set_new(root, "budget", json_budget(r));
	json_set_fields(root, metrics, r);
	json_object_set_new(root, "verdict", json_text(record->verdict));
	return root;
}

/* The pairs by rising, falling and left out, those that are there, as a plot of a column. */
static void put_pairs(FILE *script, int column, const bool there[3])
{
	static const char *const names[] = {"rising", "falling", "left out"};
	static const int markers[] = {9, 11, 2};
	int n = 0;

	for (int k = 0; k < 3; k++)
		if (there[k])
			plot_add(
				script, &n,
				"'pairs.dat' using ($4 == %d ? $1 : NaN):%d with points lt %d "
				"pt %d ps 1 title '%s'",
				k, column, k + 1, markers[k], names[k]);
}

/* Both plots use one file: force, reading, residual, and whether it was used. */
void force_draw(const void *run, const char *folder)
{
	const struct force *force = run;
	const struct incise_calibrate_force *r = &force->result;
	FILE *data = plot_data(folder, "pairs.dat"), *script;
	bool there[3] = {false};

	for (int i = 0; i < force->n; i++) {
		const struct incise_calibrate_force_pair *p = &force->pairs[i];
		int kind = force->states[i] ? 2 : p->descending ? 1 : 0;

		there[kind] = true;
		fprintf(data, "%.6f %.4f %.4f %d\n",
			incise_calibrate_force_of(p, &force->setup), p->reading_mV,
			residual_mV(force, i), kind);
	}
	plot_data_end(data, folder);
	script = plot_begin(folder, "fit", 900, 560);
	fputs("set title 'Reading of the force channel over the applied force'\n"
	      "set xlabel 'force / N'\nset ylabel 'reading / mV'\neval key_below\n",
	      script);
	put_pairs(script, 2, there);
	fprintf(script,
		", \\\n  %.10g + %.10g * x with lines lc rgb ink lw 1 title 'line, %.2f mV/N'\n",
		r->zero_mV, r->sensitivity_mV_N, r->sensitivity_mV_N);
	calibrate_draw(script, folder, "fit");
	script = plot_begin(folder, "residuals", 900, 560);
	fputs("set title 'Residuals of the reading from the line'\n"
	      "set xlabel 'force / N'\nset ylabel 'residual of the reading / mV'\n"
	      "eval key_below\n",
	      script);
	there[2] = false;
	put_pairs(script, 3, there);
	fputs(", \\\n  0 with lines lc rgb ink lw 1\n", script);
	calibrate_draw(script, folder, "residuals");
}
