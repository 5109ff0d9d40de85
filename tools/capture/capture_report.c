// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What incise capture has recorded; see capture_report.h.
 */
#include <math.h>
#include <stdio.h>
#include "capture_report.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/stream_report.h"

void capture_report(const struct capture_result *result, bool json)
{
	const struct incise_recorder_stats *stats = &result->stats;
	const struct incise_stream *streams = stats->streams;
	const int n = stats->n_streams;
	uint64_t lost = stats->force_lost + stats->tracker_lost + stats->frames_lost;
	const char *path = result->path;

	if (json) {
		json_print(json_pack(
			"{so so sI sI sI sI sI sI sI sI sI so so}", "path",
			json_text(path), "seconds", json_number(result->seconds), "force",
			(json_int_t)stats->force, "tracker", (json_int_t)stats->tracker,
			"depth", (json_int_t)stats->depth, "frames",
			(json_int_t)stats->frames, "lost", (json_int_t)lost, "force_lost",
			(json_int_t)stats->force_lost, "tracker_lost",
			(json_int_t)stats->tracker_lost, "frames_lost",
			(json_int_t)stats->frames_lost, "clipped",
			(json_int_t)stats->force_clipped, "zero_mV",
			json_number(stats->zero_mV), "streams", stream_json(streams, n)));
		return;
	}
	printf("%s: %.1f s, %llu force samples (%llu clipped), %llu tracker records, ",
	       path, result->seconds, (unsigned long long)stats->force,
	       (unsigned long long)stats->force_clipped,
	       (unsigned long long)stats->tracker);
	if (n > 2)
		printf("%llu pictures, ", (unsigned long long)stats->frames);
	printf("%llu lost", (unsigned long long)lost);
	/* A short recording gets its zero when it is closed. */
	if (!isnan(stats->zero_mV))
		printf(", zero %.1f mV", stats->zero_mV);
	putchar('\n');
	stream_table(streams, n);
	cli_finish();
}

_Noreturn static void fail_of_losses(const char *path,
				     const struct incise_recorder_stats *stats)
{
	const struct {
		uint64_t n;
		const char *what;
	} lost[] = {
		{stats->force_lost, "force samples"},
		{stats->tracker_lost, "tracker records"},
		{stats->frames_lost, "pictures"},
	};
	char text[200] = "";
	size_t at = 0;

	for (int i = 0; i < 3; i++)
		if (lost[i].n)
			at += (size_t)snprintf(text + at, sizeof(text) - at, "%s%llu %s",
					       at ? ", " : "",
					       (unsigned long long)lost[i].n,
					       lost[i].what);
	cli_fail("%s: %s were lost; the table events says when", path, text);
}

void capture_judge(const struct capture_result *result)
{
	const struct incise_recorder_stats *stats = &result->stats;
	const struct incise_stream *streams = stats->streams;
	const char *path = result->path;
	const int n = stats->n_streams;

	if (result->early.code)
		cli_fail_with(&result->early);
	for (int i = 0; i < n; i++)
		if (*streams[i].ended)
			cli_fail("%s: the %s ended before the recording did: %s", path,
				 streams[i].name, streams[i].ended);
	if (!stats->force || !stats->tracker)
		cli_fail("%s: the %s gave nothing in %.1f s; check its cable and power",
			 path, stats->force ? "tracker" : "force channel",
			 result->seconds);
	if (stats->force_lost || stats->tracker_lost || stats->frames_lost)
		fail_of_losses(path, stats);
	if (n > 2 && !stats->frames)
		cli_fail("%s: the camera gave nothing in %.1f s; check its cable", path,
			 result->seconds);
}
