// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a calibration of the force channel found; see calibrate_force_report.h.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>
#include "calibrate_force_report.h"
#include "calibrate_report.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/plot.h"

static const char *const states[] = {
	[INCISE_CALIBRATE_FORCE_USED] = "used",
	[INCISE_CALIBRATE_FORCE_SATURATED] = "saturated",
	[INCISE_CALIBRATE_FORCE_OUTLIER] = "outlier",
};

static void print_figure(FILE *out, const char *name, double value, const char *unit)
{
	if (isnan(value))
		fprintf(out, "%-15s not stated\n", name);
	else
		fprintf(out, "%-15s %.3g %s\n", name, value, unit);
}

static void print_figures(const struct calibrate_force_report *report, FILE *out)
{
	const struct incise_calibrate_force *r = report->result;

	fprintf(out, "%-15s %.2f mV/N, U = %.2f mV/N (k = 2), %.3f %%\n", "sensitivity",
		r->sensitivity_mV_N, 2 * r->sensitivity_u_mV_N,
		200 * r->sensitivity_u_mV_N / r->sensitivity_mV_N);
	fprintf(out, "%-15s %.2f mV/N as found, %+.3f %%\n", "", report->found_mV_N,
		100 * (r->sensitivity_mV_N / report->found_mV_N - 1));
	fprintf(out, "%-15s %.2f mV, U = %.2f mV (k = 2)\n", "zero", r->zero_mV,
		2 * r->zero_u_mV);
	fprintf(out, "%-15s %.3g mV, scatter of one load %.3g mV\n", "residual sd",
		r->residual_sd_mV, r->scatter_sd_mV);
	print_figure(out, "linearity", r->linearity,
		     "% of full scale, best straight line");
	print_figure(out, "hysteresis", r->hysteresis, "% of full scale");
	print_figure(out, "repeatability", r->repeatability, "% of full scale");
	print_figure(out, "zero return", r->zero_return, "% of full scale");
	print_figure(out, "resolution", 1e3 * r->resolution_N, "mN");
	fprintf(out, "%-15s %.3g N to %.4g N", "range", r->low_N, r->high_N);
	if (isnan(r->clips_N))
		fprintf(out, "\n");
	else
		fprintf(out, "; the converter ends at %.4g N\n", r->clips_N);
	fprintf(out,
		"%-15s %d of %d used, %d loads, %d series; %d saturated, %d outliers\n",
		"pairs", r->used, r->pairs, r->loads, r->series, r->saturated,
		r->outliers);
	if (r->misfit > 1)
		fprintf(out,
			"%-15s loads lie %.1f times as far from a line as their uncertainty "
			"explains: U is widened by it\n",
			"misfit", r->misfit);
}

static void print_budget(const struct calibrate_force_report *report, FILE *out)
{
	const struct incise_calibrate_force *r = report->result;
	const struct incise_calibrate_force_setup *s = report->setup;

	fprintf(out,
		"\nBudget of the sensitivity's standard uncertainty\n\n"
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
	fprintf(out, "%-28s %-4s %-18s %-20s %.4f\n\n", "all, in squares", "", "", "",
		r->sensitivity_u_mV_N);
	fprintf(out,
		"Type A rests on %d degrees of freedom, and is widened so that k = 2 is 95 %%.\n"
		"Gravity %.5f m/s2, u = %.2g, %s. Air %.3g kg/m3, weights %.5g kg/m3.\n"
		"The scale resolves %.3g g: rectangular, one error for each load weighed.\n",
		r->freedom, s->gravity_m_s2, s->gravity_u_m_s2, report->gravity,
		s->air_kg_m3, s->weight_kg_m3, s->scale_g);
}

/* All of them, or those that were left out. */
static void print_pairs(const struct calibrate_force_report *report, bool all, FILE *out)
{
	const struct incise_calibrate_force *r = report->result;

	for (int i = 0; i < report->pairs->n; i++) {
		const struct incise_calibrate_force_pair *p = &report->pairs->pair[i];
		double F_N = incise_calibrate_force_of(p, report->setup);

		if (!all && report->states[i] == INCISE_CALIBRATE_FORCE_USED)
			continue;
		fprintf(out, "pair %-4d %10.5f N %10.2f mV  series %d %-4s  %s", i + 1,
			F_N, p->reading_mV, p->series, p->descending ? "down" : "up",
			states[report->states[i]]);
		if (!report->refused)
			fprintf(out, ", %+.2f mV off",
				p->reading_mV - r->zero_mV - r->sensitivity_mV_N * F_N);
		fputc('\n', out);
	}
}

void calibrate_force_print(const struct calibrate_force_report *report, bool all,
			   FILE *out)
{
	if (all)
		fprintf(out, "Calibration of a force channel, %s\n%s\n%s\n\n",
			report->record->date, report->record->device,
			report->record->method);
	if (report->refused)
		fprintf(out, "refused: %s\n", report->refused);
	else
		print_figures(report, out);
	if (all && !report->refused)
		print_budget(report, out);
	if (all)
		fputc('\n', out);
	print_pairs(report, all, out);
	if (!report->refused)
		fprintf(out, "%s: %s\n", report->record->pass ? "pass" : "fail",
			report->record->verdict);
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

json_t *calibrate_force_json(const struct calibrate_force_report *report)
{
	const struct incise_calibrate_force *r = report->result;
	json_t *pairs = json_array(), *root;

	for (int i = 0; i < report->pairs->n; i++) {
		const struct incise_calibrate_force_pair *p = &report->pairs->pair[i];

		json_array_append_new(
			pairs, json_pack("{s:o, s:o, s:i, s:b, s:s}", "force_N",
					 json_number(incise_calibrate_force_of(
						 p, report->setup)),
					 "reading_mV", json_number(p->reading_mV),
					 "series", p->series, "descending", p->descending,
					 "state", states[report->states[i]]));
	}
	root = json_pack("{s:s, s:o, s:o, s:o, s:o}", "kind", "force", "date",
			 json_text(report->record->date), "device",
			 json_text(report->record->device), "method",
			 json_text(report->record->method), "pairs", pairs);
	if (report->refused) {
		json_object_set_new(root, "refused", json_text(report->refused));
		json_object_set_new(root, "pass", json_false());
		return root;
	}
	json_object_update_new(
		root,
		json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}",
			  "found_mV_N", json_number(report->found_mV_N),
			  "sensitivity_mV_N", json_number(r->sensitivity_mV_N),
			  "sensitivity_u_mV_N", json_number(r->sensitivity_u_mV_N),
			  "sensitivity_U_mV_N", json_number(2 * r->sensitivity_u_mV_N),
			  "zero_mV", json_number(r->zero_mV), "zero_u_mV",
			  json_number(r->zero_u_mV), "residual_sd_mV",
			  json_number(r->residual_sd_mV), "scatter_sd_mV",
			  json_number(r->scatter_sd_mV), "misfit", json_number(r->misfit),
			  "budget", json_budget(r)));
	json_object_update_new(
		root, json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}",
				"linearity_percent", json_number(r->linearity),
				"hysteresis_percent", json_number(r->hysteresis),
				"repeatability_percent", json_number(r->repeatability),
				"zero_return_percent", json_number(r->zero_return),
				"resolution_N", json_number(r->resolution_N), "low_N",
				json_number(r->low_N), "high_N", json_number(r->high_N),
				"clips_N", json_number(r->clips_N)));
	json_object_update_new(
		root, json_pack("{s:i, s:i, s:i, s:i, s:i, s:b, s:o}", "used", r->used,
				"saturated", r->saturated, "outliers", r->outliers,
				"loads", r->loads, "series", r->series, "pass", r->pass,
				"verdict", json_text(report->record->verdict)));
	return root;
}

/* Both pictures from one file: force, reading, residual, and whether it was used. */
static void draw(const struct calibrate_force_report *report, const char *folder)
{
	const struct incise_calibrate_force *r = report->result;
	FILE *data = plot_data(folder, "pairs.dat"), *script;

	for (int i = 0; i < report->pairs->n; i++) {
		const struct incise_calibrate_force_pair *p = &report->pairs->pair[i];
		double F_N = incise_calibrate_force_of(p, report->setup);

		fprintf(data, "%.6f %.4f %.4f %d\n", F_N, p->reading_mV,
			p->reading_mV - r->zero_mV - r->sensitivity_mV_N * F_N,
			report->states[i] ? 2
			: p->descending	  ? 1
					  : 0);
	}
	plot_data_end(data, folder);
	script = plot_begin(folder, "fit", 1000, 700);
	fprintf(script,
		"set xlabel 'force / N'\nset ylabel 'reading / mV'\nset key top left\n"
		"plot %.10g + %.10g * x with lines ls 1 title '%.2f mV/N', \\\n"
		"  'pairs.dat' using ($4 == 0 ? $1 : 1/0):2 with points pt 9 title 'up', \\\n"
		"  '' using ($4 == 1 ? $1 : 1/0):2 with points pt 11 title 'down', \\\n"
		"  '' using ($4 == 2 ? $1 : 1/0):2 with points pt 2 title 'left out'\n",
		r->zero_mV, r->sensitivity_mV_N, r->sensitivity_mV_N);
	if (!plot_draw(script, folder, "fit"))
		cli_fail("gnuplot could not draw %s/fit", folder);
	script = plot_begin(folder, "residuals", 1000, 700);
	fprintf(script,
		"set xlabel 'force / N'\nset ylabel 'reading - line / mV'\nset key top left\n"
		"plot 0 with lines ls 1 notitle, \\\n"
		"  'pairs.dat' using ($4 == 0 ? $1 : 1/0):3 with points pt 9 title 'up', \\\n"
		"  '' using ($4 == 1 ? $1 : 1/0):3 with points pt 11 title 'down'\n");
	if (!plot_draw(script, folder, "residuals"))
		cli_fail("gnuplot could not draw %s/residuals", folder);
}

void calibrate_force_write(const struct calibrate_force_report *report,
			   const char *folder)
{
	const char *where, *name;
	struct incise_outfile *file;
	char fit[4200];
	json_t *json;
	FILE *out;

	snprintf(fit, sizeof(fit), "%s/fit", folder);
	if (plot_possible()) {
		plot_place("report", fit, &where, &name);
		if (!report->refused)
			draw(report, folder);
	} else {
		cli_warn("gnuplot is not installed: the report has no pictures");
		if (mkdir(folder, 0777) && errno != EEXIST)
			cli_fail("%s: %s", folder, strerror(errno));
	}
	out = calibrate_report_text(folder, &file);
	calibrate_force_print(report, true, out);
	whole_file_end(file);
	json = calibrate_force_json(report);
	calibrate_report_json(folder, json);
	json_decref(json);
}
