// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * cyclictest beside our own loop; see cyclictest.h. Its figures come as JSON, its late
 * wake-ups as lines on standard output, times in µs:
 *
 *     T: 0 Spike:    1301: TS:  68161260801
 */
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <incise/loop.h>
#include "../cli/child.h"
#include "../cli/cli.h"
#include "cyclictest.h"

#define SPIKES_MAX 200000
#define SPIKES_TEXT "200000"
#define END_S 5 /* after the time that it should take, which has passed */

/* Its histogram, and ours, whose last bin is all above. */
#define TRACKED_US "20000"
_Static_assert(INCISE_LOOP_BINS == 20001, "bins of both");

const char *cyclictest_possible(bool realtime)
{
	if (!child_possible("cyclictest"))
		return "cyclictest is not installed: apt-get install rt-tests";
	if (!realtime)
		return "cyclictest runs only where real-time policies are granted";
	return NULL;
}

void cyclictest_begin(struct cyclictest *c, double rate_hz, int priority, int cpu,
		      uint64_t cycles, double phase_us)
{
	char text[7][48];
	/* The room for spikes is taken only behind the option that asks for them. */
	const char *argv[] = {
		"cyclictest",
		"--quiet",
		"--mlockall",
		"--policy=fifo",
		"--threads=1",
		text[0],
		text[1],
		text[2],
		text[3],
		text[4],
		text[5],
		text[6],
		"--spike-nodes=" SPIKES_TEXT,
		"--histogram=" TRACKED_US,
		NULL,
	};

	c->report = memory_file_begin("cyclictest");
	c->out = memory_file_begin("cyclictest's lines");
	snprintf(text[0], sizeof(text[0]), "--priority=%d", priority);
	snprintf(text[1], sizeof(text[1]), "--affinity=%d", cpu);
	snprintf(text[2], sizeof(text[2]), "--interval=%.0f", 1e6 / rate_hz);
	snprintf(text[3], sizeof(text[3]), "--loops=%llu", (unsigned long long)cycles);
	snprintf(text[4], sizeof(text[4]), "--spike=%.0f", 0.25e6 / rate_hz);
	snprintf(text[5], sizeof(text[5]), "--json=%s", c->report.path);
	snprintf(text[6], sizeof(text[6]), "--secaligned=%.0f", phase_us);
	c->pid = child_start((char *const *)argv, fileno(c->out.file), -1);
}

static void take_spikes(FILE *lines, struct cyclictest_result *result)
{
	char line[200];

	result->spike = calloc(SPIKES_MAX, sizeof(*result->spike));
	if (!result->spike)
		cli_fail("no memory");
	rewind(lines);
	while (fgets(line, sizeof(line), lines) && result->spikes < SPIKES_MAX) {
		long long late_us, at_us;
		int thread;

		if (sscanf(line, "T:%d Spike:%lld: TS:%lld", &thread, &late_us, &at_us) !=
		    3)
			continue;
		result->spike[result->spikes++] =
			(struct cyclictest_spike){(at_us - late_us) * 1000, at_us * 1000};
	}
}

/* "histogram": {"14": 96, …}; what is above all bins is in none of them. */
static const char *take_histogram(json_t *thread, struct cyclictest_result *result)
{
	json_t *histogram = json_object_get(thread, "histogram"), *count;
	json_int_t cycles = json_integer_value(json_object_get(thread, "cycles"));
	uint64_t in_bins = 0;
	const char *us;

	if (!json_is_object(histogram) || cycles <= 0)
		return "cyclictest's report has no histogram";
	result->late_us = calloc(INCISE_LOOP_BINS, sizeof(*result->late_us));
	if (!result->late_us)
		cli_fail("no memory");
	json_object_foreach(histogram, us, count)
	{
		long bin = strtol(us, NULL, 10);

		if (bin < 0 || bin >= INCISE_LOOP_BINS - 1 ||
		    json_integer_value(count) < 0)
			return "cyclictest's histogram makes no sense";
		result->late_us[bin] = (uint64_t)json_integer_value(count);
		in_bins += result->late_us[bin];
	}
	result->cycles = (uint64_t)cycles;
	if (result->cycles > in_bins)
		result->late_us[INCISE_LOOP_BINS - 1] = result->cycles - in_bins;
	result->max_us = json_number_value(json_object_get(thread, "max"));
	return NULL;
}

const char *cyclictest_end(struct cyclictest *c, struct cyclictest_result *result)
{
	int status = child_end(c->pid, END_S);
	const char *why = NULL;
	json_t *report;

	*result = (struct cyclictest_result){0};
	rewind(c->report.file);
	report = json_loadf(c->report.file, 0, NULL);
	if (status || !report)
		why = "cyclictest failed; run it by hand to see why";
	else
		why = take_histogram(
			json_object_get(json_object_get(report, "thread"), "0"), result);
	if (!why)
		take_spikes(c->out.file, result);
	json_decref(report);
	fclose(c->report.file);
	fclose(c->out.file);
	if (why)
		cyclictest_free(result);
	return why;
}

void cyclictest_free(struct cyclictest_result *result)
{
	free(result->late_us);
	free(result->spike);
	*result = (struct cyclictest_result){0};
}
