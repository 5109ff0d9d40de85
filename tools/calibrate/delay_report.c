// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The report of incise calibrate delay; see delay.h.
 */
#include <math.h>
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/uncertainty.h"
#include "delay.h"

const char *const delay_names[] = {"force", "tracker", "camera", NULL};

static void print_fit(FILE *out, const char *name, const struct delay_stream *stream)
{
	const struct incise_delay_fit *fit = &stream->fit;

	if (!stream->is_fitted)
		return;
	fprintf(out,
		"tracker later than %s by %.3f ms, u = %.3f ms, 95 %% interval %.3f to "
		"%.3f ms\n"
		"  correlation %.4f, second peak %.2f of it, over %.1f s in %d blocks\n"
		"  drift from beginning to end %.3f ms (u %.3f ms, %.1f ppm)\n",
		name, fit->delay_ms, fit->sd_ms, fit->low_ms, fit->high_ms,
		fit->correlation, fit->second, fit->span_s, fit->blocks, fit->drift_ms,
		fit->drift_sd_ms, 1e3 * fit->drift_ms / fit->span_s);
	if (!isnan(fit->contact_mm))
		fprintf(out, "  contact begins at a depth of %.2f mm\n", fit->contact_mm);
}

void delay_text(const void *run, FILE *out)
{
	const struct delay *delay = run;

	fprintf(out, "Delays against the %s\n\n", delay_names[delay->reference]);
	print_fit(out, "force", &delay->streams[FORCE]);
	print_fit(out, "camera", &delay->streams[CAMERA]);
	for (int i = 0; i < STREAMS; i++) {
		const struct delay_stream *s = &delay->streams[i];
		double u = hypot(s->fits_u_ms, s->lines_u_ms);
		char text[UNCERTAINTY_TEXT];

		if (!s->has_result)
			continue;
		fprintf(out,
			"\n%s_delay_ms = %s (k = 2): %.3f ms of the recording and "
			"%.3f ms measured; u = %.2g ms\n"
			"  budget            type  u, ms   sensitivity\n"
			"  fit of the motion A     %.4f  1\n"
			"  lines of arrivals B     %.4f  1\n",
			delay_names[i],
			uncertainty_text(s->about.delay_ms + s->late_ms, 2 * u, "ms",
					 text),
			s->about.delay_ms, s->late_ms, u, s->fits_u_ms, s->lines_u_ms);
	}
}

static json_t *fit_json(const struct delay_stream *stream)
{
#define FIELD(member) JSON_FIELD(struct incise_delay_fit, member)
#define FIELD_AS(key, member) JSON_FIELD_AS(key, struct incise_delay_fit, member)
	static const struct json_field fields[] = {FIELD_AS("tracker_later_ms", delay_ms),
						   FIELD_AS("u_ms", sd_ms),
						   FIELD(low_ms),
						   FIELD(high_ms),
						   FIELD(drift_ms),
						   FIELD(drift_sd_ms),
						   FIELD(correlation),
						   FIELD_AS("second_peak", second),
						   FIELD(contact_mm),
						   FIELD(span_s),
						   FIELD(blocks),
						   {0}};
	json_t *object;

	if (!stream->is_fitted)
		return json_null();
	object = json_object();
	json_set_fields(object, fields, &stream->fit);
	return object;
}

json_t *delay_json(const void *run)
{
	const struct delay *delay = run;

	return calibrate_json(&delay->common,
			      json_pack("{ss so so}", "reference",
					delay_names[delay->reference], "force",
					fit_json(&delay->streams[FORCE]), "camera",
					fit_json(&delay->streams[CAMERA])));
}

static void put_data(const struct delay *delay, int i, const char *folder)
{
	const struct delay_stream *s = &delay->streams[i];
	int stride = 1 + s->n / 4000;
	FILE *data;
	char file[40];

	snprintf(file, sizeof(file), "%s.dat", delay_names[i]);
	data = plot_data(folder, file);
	for (int k = 0; k < s->n; k += stride)
		fprintf(data, "%.5f %.5f\n",
			(s->points[k].t_ns - delay->streams[TRACKER].points[0].t_ns) *
				1e-9,
			s->points[k].value);
	plot_data_end(data, folder);
}

/* All streams, the tracker's depth shifted by its delay. */
void delay_draw(const void *run, const char *folder)
{
	const struct delay *delay = run;
	const struct delay_stream *force = &delay->streams[FORCE];
	const struct delay_stream *camera = &delay->streams[CAMERA];
	FILE *script;
	int n = 0;

	for (int i = 0; i < STREAMS; i++)
		put_data(delay, i, folder);
	script = plot_begin(folder, "fit", 1000, 520);
	fputs("set title 'Streams of the rig, each moved by its measured delay'\n"
	      "set xlabel 'time / s'\nset ylabel 'depth / mm'\nset autoscale xfix\n"
	      "eval key_below\n",
	      script);
	if (force->n)
		fputs("set border 11\nset y2label 'force / N'\nset y2tics\n", script);
	plot_add(
		script, &n,
		"'tracker.dat' using ($1-%g):2 with lines lt 1 title 'depth by the tracker'",
		force->is_fitted ? force->fit.delay_ms * 1e-3 : 0);
	if (force->n)
		plot_add(script, &n,
			 "'force.dat' using 1:2 axes x1y2 with lines lt 2 title 'force'");
	if (camera->is_fitted)
		plot_add(script, &n,
			 "'camera.dat' using ($1+%g):2 with points lt 3 ps 0.5 "
			 "title 'depth by the camera'",
			 (camera->fit.delay_ms - force->fit.delay_ms) * 1e-3);
	putc('\n', script);
	calibrate_draw(script, folder, "fit");
}
