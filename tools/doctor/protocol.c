// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The one-hour protocol of a haptic device; see protocol.h.
 */
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include "../../lib/base/ascending.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "protocol.h"

#define LINE_SAMPLES 4096 /* most, of a spectrum */
#define LINE_LEAST_HZ 5.0 /* below, a hand or a table moves */
#define POLL_MS 1.0	  /* an age is known to this */

#define SWINGS_AT(percent) \
	"swings of more than 0.1 mm at " percent " % of the plan's largest stiffness"

/* A mark of 0 depends on the device: see set_marks(). */
static const struct {
	const char *step, *quantity, *unit;
	double mark;
} steps[PROTOCOL_STEPS] = {
	[SD] = {"noise", "standard deviation along an axis", "mm", 0.05},
	[LINE] = {"noise", "strongest line above 5 Hz, amplitude", "mm", 0.02},
	[AGE] = {"latency", "age of a sample, 99 %", "ms", 0},
	[AGE_MOST] = {"latency", "age of a sample, largest", "ms", 10},
	[JITTER] = {"latency", "period of samples, standard deviation", "ms", 0},
	[LOST] = {"latency", "samples lost", "%", 0.1},
	[WEIGHT] = {"weight", "force commanded for a hung weight, deviation", "%", 10},
	[SWINGS] = {"wall", SWINGS_AT("25"), "1/s", 1},
	{"wall", SWINGS_AT("50"), "1/s", 1},
	{"wall", SWINGS_AT("75"), "1/s", 1},
	{"wall", SWINGS_AT("90"), "1/s", 1},
};

static void set_marks(struct protocol *protocol)
{
	double period_ms = 1e3 / protocol->info.rate_hz;

	for (int i = 0; i < PROTOCOL_STEPS; i++) {
		protocol->value[i] = NAN;
		protocol->mark[i] = steps[i].mark;
	}
	protocol->mark[AGE] =
		(double)protocol->info.latency_ns * 1e-6 + 2 * period_ms + POLL_MS;
	protocol->mark[JITTER] = 0.2 * period_ms;
}

static void measure_ages(struct protocol *protocol, const struct handle_sample *s, int n)
{
	double *ages = cli_alloc((size_t)n, sizeof(*ages)), sum2 = 0;
	double span_ms = (double)(s[n - 1].pose.t_ns - s[0].pose.t_ns) * 1e-6;
	double taken = (double)(s[n - 1].pose.seq - s[0].pose.seq);

	for (int i = 0; i < n; i++)
		ages[i] = (double)s[i].age_ns * 1e-6;
	for (int i = 1; i < n; i++) {
		double step = (double)(s[i].pose.seq - s[i - 1].pose.seq);
		double ms = (double)(s[i].pose.t_ns - s[i - 1].pose.t_ns) * 1e-6;

		sum2 += pow(ms - step * span_ms / taken, 2);
	}
	qsort(ages, (size_t)n, sizeof(*ages), ascending);
	protocol->rate_hz = 1e3 * (n - 1) / span_ms;
	protocol->age_median_ms = ages[n / 2];
	protocol->value[AGE] = ages[n - 1 - n / 100];
	protocol->value[AGE_MOST] = ages[n - 1];
	protocol->value[JITTER] = sqrt(sum2 / (n - 1));
	protocol->value[LOST] = 100 * (1 - (n - 1) / taken);
	free(ages);
}

/* Amplitude of the strongest line of the position, by a Hann window. */
static double find_line(const struct handle *handle, const double mean_mm[3],
			double rate_hz)
{
	int n = handle->n < LINE_SAMPLES ? handle->n : LINE_SAMPLES;
	double most2 = 0;

	for (int k = (int)ceil(LINE_LEAST_HZ * n / rate_hz); k < n / 2; k++) {
		double complex sum[3] = {0}, turn = 1, step = cexp(-2 * M_PI * I * k / n);
		double square = 0;

		for (int i = 0; i < n; i++, turn *= step)
			for (int a = 0; a < 3; a++)
				sum[a] += (1 - cos(2 * M_PI * i / n)) * turn *
					  (handle->samples[i].pose.position_mm[a] -
					   mean_mm[a]);
		for (int a = 0; a < 3; a++)
			square += pow(cabs(sum[a]), 2);
		most2 = fmax(most2, square);
	}
	return 2 * sqrt(most2) / n;
}

void protocol_measure(struct protocol *protocol, const struct handle *handle, bool rests)
{
	double mean_mm[3];

	protocol->info = handle->info;
	set_marks(protocol);
	measure_ages(protocol, handle->samples, handle->n);
	if (!rests)
		return;
	protocol->value[SD] = handle_mean(handle, mean_mm);
	protocol->value[LINE] = find_line(handle, mean_mm, protocol->rate_hz);
}

const char *protocol_failed(const struct protocol *protocol, enum protocol_step from)
{
	for (int i = from; i < PROTOCOL_STEPS; i++)
		if (protocol->value[i] > protocol->mark[i])
			return steps[i].quantity;
	return NULL;
}

json_t *protocol_json(const struct protocol *protocol)
{
	const struct incise_haptic_info *info = &protocol->info;
	json_t *list = json_array();

	for (int i = 0; i < PROTOCOL_STEPS; i++) {
		bool done = !isnan(protocol->value[i]);

		json_array_append_new(
			list,
			json_pack("{ss ss ss so so so}", "step", steps[i].step,
				  "quantity", steps[i].quantity, "unit", steps[i].unit,
				  "value", json_number(protocol->value[i]), "mark",
				  json_number(protocol->mark[i]), "pass",
				  done ? json_boolean(protocol->value[i] <=
						      protocol->mark[i])
				       : json_null()));
	}
	return json_pack(
		"{so sf sf sf sf sf sf sf so sb so so so}", "name", json_text(info->name),
		"rate_hz", protocol->rate_hz, "nominal_hz", info->rate_hz, "latency_ms",
		(double)info->latency_ns * 1e-6, "age_median_ms", protocol->age_median_ms,
		"peak_N", info->peak_N, "continuous_N", info->continuous_N, "deadman_s",
		info->deadman_s, "limit_N_mm",
		json_number(protocol->limit_N_mm > 0 ? protocol->limit_N_mm : NAN),
		"own_gravity", !!(info->features & INCISE_HAPTIC_PAGE_GRAVITY), "filters",
		json_text(info->filters), "note", json_text(info->note), "protocol",
		list);
}
