// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The report of a capture; see capture.h.
 */
#include <math.h>
#include <stdio.h>
#include "../cli/json.h"
#include "../cli/stream_report.h"
#include "../cli/wall_report.h"
#include "capture.h"

void capture_report(const char *path, const struct incise_capture_result *result,
		    const struct calibration_used *calibration, const char *signed_by,
		    bool json)
{
	const struct incise_recorder_stats *stats = &result->stats;
	const struct incise_stream *streams = stats->streams;
	const struct incise_wall *wall = result->wall;
	const int n = stats->n_streams;
	uint64_t lost = stats->force_lost + stats->tracker_lost + stats->frames_lost;
	const int64_t end_ns =
		result->start_ns + (int64_t)(result->seconds * INCISE_NS_PER_S);
	char text[1000];

	if (json) {
		json_print(json_pack(
			"{so so so so sI sI sI sI sI sI sI sI sI so so so so}", "path",
			json_text(path), "calibration", calibration_json(calibration),
			"wall",
			wall ? wall_json(wall, result->start_ns, end_ns) : json_null(),
			"seconds", json_number(result->seconds), "force",
			(json_int_t)stats->force, "tracker", (json_int_t)stats->tracker,
			"depth", (json_int_t)stats->depth, "frames",
			(json_int_t)stats->frames, "lost", (json_int_t)lost, "force_lost",
			(json_int_t)stats->force_lost, "tracker_lost",
			(json_int_t)stats->tracker_lost, "frames_lost",
			(json_int_t)stats->frames_lost, "clipped",
			(json_int_t)stats->force_clipped, "zero_mV",
			json_number(stats->zero_mV), "poses", pose_json(&stats->poses),
			"streams", stream_json(streams, n), "signed_by",
			json_text_or_null(signed_by)));
		return;
	}
	printf("%s: %.1f s, %s (%llu clipped), %s, ", path, result->seconds,
	       cli_count(stats->force, "force sample"),
	       (unsigned long long)stats->force_clipped,
	       cli_count(stats->tracker, "tracker sample"));
	if (n > 2)
		printf("%s, ", cli_count(stats->frames, "frame"));
	printf("%llu lost", (unsigned long long)lost);
	/* A short recording has no zero before it is closed. */
	if (!isnan(stats->zero_mV))
		printf(", zero %.1f mV", stats->zero_mV);
	putchar('\n');
	if (incise_pose_counts_text(&stats->poses, text, sizeof(text)))
		puts(text);
	printf("calibration %s\n", calibration_text(calibration));
	if (wall)
		wall_text(wall, result->start_ns, end_ns);
	stream_table(streams, n);
	if (*signed_by)
		printf("signed by %s\n", signed_by);
	cli_written();
	cli_finish();
}
